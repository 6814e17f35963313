"""The kernels that compiled strategies may call: the world's public view, in compiled form.

Strategies import compiled code from here and nowhere else (an import contract holds this).
"""

from __future__ import annotations

from collections.abc import Sequence

from automaton.compiled import kernel
from automaton.kernels.charging_curve import charging_ticks
from automaton.kernels.draws import ABORTS, STRATEGY, WITHDRAWALS, draw, draw_between
from automaton.kernels.holders import lane_of
from automaton.kernels.motion import has_room
from automaton.kernels.operations import first_cell
from automaton.kernels.routes.astar import astar, search
from automaton.kernels.routes.avoidance import LEAST_TIME, PLAIN, choose_threshold, close_zones
from automaton.kernels.routes.expected import expect, expect_no_more, expect_one
from automaton.kernels.routes.forecast import foresee, foresee_one
from automaton.kernels.routes.frontier import TIES
from automaton.kernels.routes.noise import CERTAIN, USED_SHARE, blur, false_alarms
from automaton.kernels.routes.predicted import next_stand
from automaton.kernels.routes.presence import (
    KEPT,
    OWN_PARAMETERS,
    forget,
    forget_all,
    row_size,
    shared_size,
)
from automaton.kernels.routes.replay import add_zones, count_zones, has_zone
from automaton.kernels.routes.timed import find_in_time
from automaton.kernels.search import (
    FAR,
    begin_search,
    descend,
    distance,
    find_path,
    mark_goal,
    nearest_mark,
)
from automaton.kernels.stands import can_bring, can_do, drop_stand, pick_stand
from automaton.kernels.zone_network import add_predicted
from automaton.strategy.layer import memory_of
from automaton.world.state import Memory, World

__all__ = [
    "ABORTS",
    "CERTAIN",
    "FAR",
    "KEPT",
    "LEAST_TIME",
    "OWN_PARAMETERS",
    "PLAIN",
    "STRATEGY",
    "TIES",
    "USED_SHARE",
    "WITHDRAWALS",
    "add_predicted",
    "add_zones",
    "astar",
    "begin_search",
    "blur",
    "can_bring",
    "can_do",
    "charging_ticks",
    "choose_threshold",
    "close_zones",
    "count_zones",
    "descend",
    "distance",
    "draw",
    "draw_between",
    "drop_stand",
    "expect",
    "expect_no_more",
    "expect_one",
    "false_alarms",
    "find_in_time",
    "find_path",
    "forecast_memory",
    "foresee",
    "foresee_one",
    "forget",
    "forget_all",
    "has_room",
    "has_zone",
    "kernel",
    "lane_of",
    "mark_goal",
    "nearest_mark",
    "next_stand",
    "pick_stand",
    "position",
    "search",
]


@kernel
def position(view, i):
    """The cell from which a robot drives on: in a long move the one that it enters, in a bay its home."""
    return first_cell(view.robots, i)


def forecast_memory(
    view: World, horizon: int, own: Sequence[int] = (), shares: bool = False
) -> Memory:
    """Memory for `foresee` over so many ticks, at most 65,535.

    Nothing in it outlasts a call but memory.own[:, KEPT], a number of the strategy's own for each
    robot. `own`: further parameters, in memory.parameters[OWN_PARAMETERS:]. `shares`: what is foreseen
    of a zone is a share of all ticks (`expect`).
    """
    zones = view.grid.zones
    shared = shared_size(zones, horizon)
    return memory_of(
        view, row_size(horizon), shared, parameters=(horizon, zones, int(shares), *own)
    )
