"""The rule of due times: an order is due when its scenario says, from the first tick to the last one."""

from __future__ import annotations

from typing import Any, Final

from automaton.evidence.verification.motion_rules import Complaint

NEVER: Final = 2**31 - 1  # no due time


def check_due_times(
    header: dict[str, Any], scenario: dict[str, Any], report_violation: Complaint
) -> None:
    """Report the first order whose recorded due time is not that of a scenario."""
    count = len(header["orders"]["source"])
    recorded = header["orders"].get("due")
    known = [NEVER] * count if recorded is None else recorded.tolist()
    listed = scenario["orders"].get("list")
    said = [NEVER] * count if listed is None else [due_tick(line) for line in listed]
    for order, (tick, expected) in enumerate(zip(known, said, strict=False)):
        if tick != expected:
            here, there = ("never" if one == NEVER else str(one) for one in (tick, expected))
            text = f"order {order} is due in tick {here}, by its scenario {there}"
            report_violation("due", [], -1, text)
            return


def due_tick(line: dict[str, Any]) -> int:
    """The tick in which an order of a list is due, NEVER if it has no due time."""
    due = line.get("due")
    if due is None:
        return NEVER
    at: int = due["at"] if isinstance(due, dict) else line.get("release", 0) + due
    return min(at, NEVER - 1)
