"""The kernels that compiled strategies may call: the world's public view, in compiled form.

Strategies import compiled code from here and nowhere else (an import contract holds this).
"""

from __future__ import annotations

from collections.abc import Sequence

from automaton.compiled import kernel
from automaton.kernels.charging_curve import charging_ticks
from automaton.kernels.holders import lane_of
from automaton.kernels.motion import has_room
from automaton.kernels.operations import first_cell
from automaton.kernels.random_numbers import (
    STREAM_ABORTS,
    STREAM_RETREATS,
    STREAM_STRATEGY,
    random_between,
    random_bits,
)
from automaton.kernels.routes.astar import astar, search
from automaton.kernels.routes.avoidance import LEAST_TIME, PLAIN, choose_threshold, close_zones
from automaton.kernels.routes.forecast import forecast_all, forecast_one
from automaton.kernels.routes.frontier import TIES
from automaton.kernels.routes.noise import CERTAIN, USED_SHARE, blur, false_alarms
from automaton.kernels.routes.predicted import next_goal_cell
from automaton.kernels.routes.replay import add_zones, count_zones, has_zone
from automaton.kernels.routes.task_forecast import (
    add_task_forecast,
    add_task_forecasts,
    remove_task_forecast,
)
from automaton.kernels.routes.time_dependent import time_dependent_path
from automaton.kernels.routes.zone_forecast import (
    KEPT,
    OWN_PARAMETERS,
    forget,
    forget_all,
    row_size,
    shared_size,
)
from automaton.kernels.search import (
    UNREACHABLE,
    begin_search,
    distance,
    find_path,
    follow_gradient,
    mark_goal,
    nearest_mark,
)
from automaton.kernels.slot_access import can_bring, can_do, dropoff_cell, pickup_cell
from automaton.kernels.zone_network import add_predicted
from automaton.strategy.layer import memory_of
from automaton.world.state import Memory, World

__all__ = [
    "CERTAIN",
    "KEPT",
    "LEAST_TIME",
    "OWN_PARAMETERS",
    "PLAIN",
    "STREAM_ABORTS",
    "STREAM_RETREATS",
    "STREAM_STRATEGY",
    "TIES",
    "UNREACHABLE",
    "USED_SHARE",
    "add_predicted",
    "add_task_forecast",
    "add_task_forecasts",
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
    "distance",
    "dropoff_cell",
    "false_alarms",
    "find_path",
    "follow_gradient",
    "forecast_all",
    "forecast_memory",
    "forecast_one",
    "forget",
    "forget_all",
    "has_room",
    "has_zone",
    "kernel",
    "lane_of",
    "mark_goal",
    "nearest_mark",
    "next_goal_cell",
    "pickup_cell",
    "position",
    "random_between",
    "random_bits",
    "remove_task_forecast",
    "search",
    "time_dependent_path",
]


@kernel
def position(view, i):
    """The cell from which a robot drives on: in a long move the one that it enters, in a parking
    bay its home."""
    return first_cell(view.robots, i)


def forecast_memory(
    view: World, horizon: int, own: Sequence[int] = (), shares: bool = False
) -> Memory:
    """Memory for `forecast_all` over so many ticks, at most 65,535.

    Nothing in it outlasts a call but memory.per_robot[:, KEPT], a number of the strategy's own for
    each robot. `own`: further parameters, in memory.parameters[OWN_PARAMETERS:]. `shares`: what is
    predicted of a zone is a share of all ticks (`add_task_forecasts`).
    """
    traffic_zone_count = view.grid.traffic_zone_count
    shared = shared_size(traffic_zone_count, horizon)
    return memory_of(
        view, row_size(horizon), shared, parameters=(horizon, traffic_zone_count, int(shares), *own)
    )
