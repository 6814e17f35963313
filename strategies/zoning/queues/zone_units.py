"""Parameters in the units of kernels: ticks, cells, thousandths."""

from __future__ import annotations

from typing import Final

from automaton.engine.state import ACTION_DROP, ACTION_MOVE, ACTION_PICK, World
from automaton.strategy.layer import Strategy
from automaton.units import SECONDS_PER_UNIT
from strategies.zoning.design.zone_workspace import ZoneRules, typical_distance, zone_rules

MILLION: Final = 1_000_000
ALL_PAIRS: Final = "all"  # tip_pairs of annealing and decentralized


def seconds_of_tick(view: World) -> float:
    """Seconds in a tick; 1 where the scenario does not say."""
    return view.rules.tick_us / 1e6 if view.rules.tick_us else 1.0


def ticks(view: World, seconds: float) -> int:
    """Seconds in ticks, at least 1 if they are any."""
    found = round(seconds / seconds_of_tick(view))
    return max(1, found) if seconds > 0 else 0


def cells(view: World, length: float) -> float:
    """A length in the scenario's unit, in cells."""
    return 1000 * length / view.rules.cell_milli if view.rules.cell_milli else length


def order_weights(allocation: Strategy | None) -> dict[str, int]:
    """`age` and `job` of shortest job first, in thousandths: as the allocation has them, if it does."""
    # Not above: after an edit there the kernels of zones would be compiled again, too.
    from strategies.allocation.shortest_job_parameters import ShortestJobParameters

    own, usual = getattr(allocation, "parameters", None), ShortestJobParameters()
    return {
        name: round(1000 * getattr(own, name, default))
        for name, default in (("age", usual.age), ("job", usual.job))
    }


def rules_of_zones(
    view: World, adjacency: float | None, tip_pairs: str, decentralized: bool = False
) -> ZoneRules:
    """The numbers by which zones are made; those of robots that negotiate are whole millionths."""
    all_pairs = tip_pairs == ALL_PAIRS
    tick = seconds_of_tick(view)
    duration = view.rules.duration[view.rules.loaded_types]  # of the first type, with its loads
    between = view.service_zones.roads.between
    adjacent = typical_distance(between) if adjacency is None else cells(view, adjacency)
    speed = SECONDS_PER_UNIT["min"] / (tick * float(duration[ACTION_MOVE]))
    work_ticks = float(duration[ACTION_PICK] + duration[ACTION_DROP])
    handling = tick * work_ticks / SECONDS_PER_UNIT["min"]
    if not decentralized:
        return zone_rules(speed, adjacent, handling=handling, all_pairs=all_pairs)
    speed, adjacent, handling = (
        round(MILLION * one) / MILLION for one in (speed, adjacent, handling)
    )
    return zone_rules(
        speed, adjacent, base=0.0, handling=handling, limit=adjacent, blocks=False, shared=True,
        all_pairs=all_pairs,
    )  # fmt: skip
