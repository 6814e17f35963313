"""The metrics of a run: their units and meanings. Importing this needs nothing."""

from __future__ import annotations

# Name, unit and meaning of every metric of a run, in the order in which they are shown.
GLOSSARY: dict[str, tuple[str, str]] = {
    "T_total": (
        "ticks",
        "ticks of the run: until all is delivered and every robot is parked, or until it stops",
    ),
    "T_R": ("operations", "operations per robot"),
    "T_Rtotal": ("operations", "operations of all robots"),
    "E_U_moves": ("share", "moves without load / moves"),
    "E_U_operations": ("share", "moves, turns and waits without load / operations"),
    "E_U_cycles": ("share", "ticks of moves, turns and waits without load / active ticks"),
    "delivered": ("orders", "orders at their targets"),
    "throughput": ("orders/1000 ticks", "deliveries by time"),
    "ticks_per_operation": ("ticks", "active ticks per operation"),
    "legs_per_order": ("pick-ups", "times that a delivered load was picked up"),
    "utilization": ("share", "active ticks / all robot ticks"),
    "blocked": ("share", "robot ticks lost to other robots and to illegal answers / active ticks"),
    "task_time": ("ticks", "from taking an order to its delivery, both ticks included"),
    "delay": ("ticks", "by how much the same task is shorter on an empty floor"),
    "delay_p95": ("ticks", "95 % of the tasks of the run have this delay or less"),
    "completions": ("orders/1000 ticks", "deliveries by time and robot, after the warm-up"),
    "lost_waiting": ("ticks", "in waits before a held cell"),
    "lost_refused": ("ticks", "in retries and steps that were refused"),
    "lost_withdrawing": ("ticks", "in which a withdrawal was decided"),
    "lost_bay": ("ticks", "in the bay because the home cell was held"),
    "lost_in_line": ("ticks", "in line before a charger"),
    "lost_illegal": ("ticks", "after illegal answers of a strategy"),
    "slowed": (
        "ticks",
        "driving slowly, not waiting: what moves begun take longer, by slow zones "
        "and by chance; no part of blocked",
    ),
    "withdrawals": ("times", "withdrawals begun"),
    "lead_time": ("ticks", "from an order's becoming known to its delivery"),
    "lead_time_p95": ("ticks", "95 % of the delivered orders have this lead time or less"),
    "energy": ("batteries", "energy used, in full batteries"),
    "charging": ("share", "ticks at chargers / all robot ticks"),
    "least_charge": ("share", "the emptiest battery at the end"),
    "ran_empty": ("times", "a robot stood still for want of energy"),
    "breakdowns": ("times", "a robot broke down"),
    "towed": ("times", "a robot was towed"),
    "out_of_order": ("ticks", "robots stood out of order on the floor"),
    "alternatives": ("times", "traffic avoidance chose another plan than that of plain A*"),
    "illegal_answers": ("times", "answers of strategies that broke a rule"),
}
