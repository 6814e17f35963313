"""Charging by quotes: the rule that prices a robot's list in an auction also sends it to charge.

A robot is looked at when it is free, has taken an order, or is left without one. Its list - the order
that it has taken but not begun, then its plan - is quoted by the strategy's policy; if the quote has a
stop before the first task, the robot goes there now and gives the order back. With any allocation.
"""

from __future__ import annotations

from typing import Any, ClassVar

from automaton.engine.jit.structs import Struct, field
from automaton.engine.robot_states import BATTERY_PERCENT
from automaton.engine.state import World
from automaton.strategy.kernels import kernel
from automaton.strategy.layer import Strategy
from strategies.allocation.auction.charging_choice import choose_charging
from strategies.allocation.auction.floor_market import FloorMarket, make_floor_market
from strategies.allocation.auction.market import (
    BATTERY_FULL,
    POLICY_FILL_UP,
    POLICY_HIERARCHICAL,
    POLICY_JOINT,
    POLICY_THRESHOLD,
    POLICY_THRESHOLD_REACHABLE,
)
from strategies.charging.charging_parameters import FillUp, Insertion, Opportunity, Threshold


class ChargingState(Struct):
    """A parameter, and room; it remembers nothing."""

    idle_below: int = field("int64", "idle robots with less charge go to charge")
    market: FloorMarket  # room for the list of one robot


@kernel
def decide(view, batch, decisions, memory, workspace):
    """Send robots to chargers."""
    state = ChargingState.of(memory)
    choose_charging(view, batch, decisions.charging, state.market, workspace, state.idle_below)


class Quoted(Strategy):
    """A charging strategy with a policy of quotes; allocations read it, too."""

    layer: ClassVar[str] = "charging"
    compiled: ClassVar[Any] = decide
    parameters: Any
    idle_below = 0  # idle robots with less go to charge

    def __init__(self, parameters: Any = None) -> None:
        super().__init__(parameters)
        self.period = self.parameters.check_idle_every

    def policy(self) -> dict[str, int]:
        """What a quote depends on: policy, end_reach, threshold and target."""
        raise NotImplementedError

    @property
    def queues(self) -> bool:
        """Whether robots that were sent to a charger before count in a quote."""
        queues: bool = self.parameters.count_queues
        return queues

    def reset(self, view: World) -> ChargingState:
        """Make room for the list of one robot."""
        longest = view.robots.order_queue.shape[1] + 1
        market = make_floor_market(view, 1, longest, longest, self.policy(), self.queues)
        return ChargingState(idle_below=self.idle_below, market=market)


class InsertCharging(Quoted):
    """Optimal insertion (De Ryck et al., section 3.3): where and as much as the list needs."""

    Parameters: ClassVar[Any] = Insertion

    def policy(self) -> dict[str, int]:
        return {
            "policy": POLICY_HIERARCHICAL
            if self.parameters.mode == "hierarchical"
            else POLICY_JOINT,
            "end_reach": int(self.parameters.never_strand),
            "threshold": 0,
            "target": BATTERY_FULL,
        }


class FillUpCharging(Quoted):
    """Charge where it costs the list least, up to a target: what is left at the end is credited."""

    Parameters: ClassVar[Any] = FillUp

    def policy(self) -> dict[str, int]:
        target = round(self.parameters.target * BATTERY_PERCENT)
        return {"policy": POLICY_FILL_UP, "end_reach": 1, "threshold": 0, "target": target}


class ThresholdCharging(Quoted):
    """Threshold-100 (De Ryck et al., section 5.2): below a threshold to the nearest charger, full."""

    Parameters: ClassVar[Any] = Threshold

    def policy(self) -> dict[str, int]:
        return {
            "policy": POLICY_THRESHOLD
            if self.parameters.mode == "threshold-only"
            else POLICY_THRESHOLD_REACHABLE,
            "end_reach": 0,
            "threshold": round(self.parameters.threshold * BATTERY_PERCENT),
            "target": BATTERY_FULL,
        }


class OpportunityCharging(InsertCharging):
    """Idle robots charge where no robot is, and leave for any order that they can finish.

    They are looked at when they become idle, and when a place at a charger is free.
    """

    Parameters: ClassVar[Any] = Opportunity
    watches_chargers = True

    def __init__(self, parameters: Any = None) -> None:
        super().__init__(parameters)
        self.idle_below = round(self.parameters.start_below * BATTERY_PERCENT)

    def policy(self) -> dict[str, int]:
        return {
            "policy": POLICY_HIERARCHICAL,
            "end_reach": 1,
            "threshold": 0,
            "target": BATTERY_FULL,
        }
