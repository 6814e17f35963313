"""The ticks of a refined run, worked out a second time: where coarse ticks begin and end.

Strategies decide and robots begin something in the first of `stride` ticks, stops are done in the last
one. What chance decides is drawn in coarse ticks.
"""

from __future__ import annotations

from typing import Any

from automaton.evidence.verification.drawn_durations import durations_of, repairs_of
from automaton.scenario.orders import plain_data
from automaton.scenario.refinement import refined_data


class CoarseTicks:
    """How the ticks of a recording follow from those of its scenario."""

    def __init__(self, scenario: dict[str, Any]) -> None:
        self.factor: int = scenario.get("refine", 1)
        self.stride = self.factor if scenario.get("decide", "coarse") == "coarse" else 1

    def of(self, tick: int) -> int:
        """The coarse tick to which a tick belongs."""
        return (tick - 1) // self.factor + 1

    def begin_of(self, tick: int) -> int:
        """The tick in which a coarse one begins; 0 is before the first one."""
        return self.factor * (tick - 1) + 1 if tick > 0 else 0

    def decides(self, tick: int) -> bool:
        """Whether anything is decided, released or begun in a tick."""
        return (tick - 1) % self.stride == 0

    def ends(self, tick: int) -> bool:
        """Whether stops are done in a tick."""
        return tick % self.stride == 0

    def draws(self, tick: int) -> bool:
        """Whether chance decides in a tick on faults and delays."""
        return (tick - 1) % self.factor == 0


def in_fine_ticks(scenario: dict[str, Any]) -> dict[str, Any]:
    """A recorded scenario in the ticks of its run; closings and chances stay as they were read."""
    factor = scenario.get("refine", 1)
    if factor == 1:
        return scenario
    fine: dict[str, Any] = plain_data(refined_data(scenario))
    fine["floor"]["closed"] = scenario["floor"]["closed"]
    faults, as_read = fine["faults"], scenario["faults"]
    if as_read["repair_in_place"] is not None:
        ticks = repairs_of(as_read["repair_in_place"])
        faults["repair_in_place"] = {"empirical": [factor * one for one in ticks]}
    if as_read["delays"] is not None:
        table = [factor * one for one in durations_of(as_read["delays"])]
        faults["delays"] |= {"probability": as_read["delays"]["probability"], "table": table}
    return fine
