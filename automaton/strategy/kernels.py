"""The kernels that compiled strategies may call: the world's public view, in compiled form.

Strategies import compiled code from here and nowhere else (an import contract holds this).
"""

from __future__ import annotations

from automaton.engine.batches import allocation_of
from automaton.engine.blocker_cycles import walk_to_cycle
from automaton.engine.charging_curve import CURVE_RATE, charging_ticks, level_after
from automaton.engine.distance_tables import UNREACHABLE
from automaton.engine.gate_queries import (
    closed_until,
    gate_before,
    has_gates,
    is_in_full_gate,
    opens_soon,
)
from automaton.engine.headings import heading_towards, headings_of, is_facing
from automaton.engine.holders import lane_of
from automaton.engine.jit.kernel import kernel
from automaton.engine.motion import direction_between, has_room, is_empty
from automaton.engine.next_stop import end_of_stops, has_load, next_stop_cell
from automaton.engine.operations import energy_cost, types_of_robots, with_load, without_load
from automaton.engine.prefetch import prefetch
from automaton.engine.random_numbers import (
    STREAM_ABORTS,
    STREAM_RETREATS,
    STREAM_STORAGE,
    STREAM_STRATEGY,
    random_between,
    random_bits,
    splitmix64,
)
from automaton.engine.refinement import is_due, random_ticks
from automaton.engine.requests import first_cell
from automaton.engine.search import (
    AROUND_CLOSED,
    AROUND_KNOWN,
    AROUND_ROBOTS,
    STARTED,
    TURNED_AHEAD,
    TURNED_BEHIND,
    begin_search,
    cost_at,
    distance,
    fetch_cost,
    find_path,
    follow_gradient,
    how_turned,
    is_closed,
    mark_goal,
    nearest_mark,
    parent_of,
    pop,
    push,
    table_of,
    ways_on,
    weighted_table_of,
    write_path,
)
from automaton.engine.speed_limits import limited_ticks
from automaton.engine.station_queues import is_in_own_queue
from automaton.engine.step_costs import find_step_costs
from automaton.engine.table_rows import cost_in, has_room_for
from automaton.engine.trips import has_place
from automaton.engine.zone_segments import copy_segment
from automaton.strategy.access_cells import (
    begin_cell,
    can_bring,
    can_do,
    cell_beside,
    dropoff_cell,
    pickup_cell,
    position,
)
from automaton.strategy.open_orders import LEAST_PRIORITY, highest_priority, is_open, take_order
from automaton.strategy.placing import (
    FIXED,
    POLICIES,
    PlacingState,
    deliver,
    place_load,
    places_load,
    set_down,
    takes_load,
)

__all__ = [
    "AROUND_CLOSED",
    "AROUND_KNOWN",
    "AROUND_ROBOTS",
    "CURVE_RATE",
    "FIXED",
    "LEAST_PRIORITY",
    "POLICIES",
    "STARTED",
    "STREAM_ABORTS",
    "STREAM_RETREATS",
    "STREAM_STORAGE",
    "STREAM_STRATEGY",
    "TURNED_AHEAD",
    "TURNED_BEHIND",
    "UNREACHABLE",
    "PlacingState",
    "allocation_of",
    "begin_cell",
    "begin_search",
    "can_bring",
    "can_do",
    "cell_beside",
    "charging_ticks",
    "closed_until",
    "copy_segment",
    "cost_at",
    "cost_in",
    "deliver",
    "direction_between",
    "distance",
    "dropoff_cell",
    "end_of_stops",
    "energy_cost",
    "fetch_cost",
    "find_path",
    "find_step_costs",
    "first_cell",
    "follow_gradient",
    "gate_before",
    "has_gates",
    "has_load",
    "has_place",
    "has_room",
    "has_room_for",
    "heading_towards",
    "headings_of",
    "highest_priority",
    "how_turned",
    "is_closed",
    "is_due",
    "is_empty",
    "is_facing",
    "is_in_full_gate",
    "is_in_own_queue",
    "is_open",
    "kernel",
    "lane_of",
    "level_after",
    "limited_ticks",
    "mark_goal",
    "nearest_mark",
    "next_stop_cell",
    "opens_soon",
    "parent_of",
    "pickup_cell",
    "place_load",
    "places_load",
    "pop",
    "position",
    "prefetch",
    "push",
    "random_between",
    "random_bits",
    "random_ticks",
    "set_down",
    "splitmix64",
    "table_of",
    "take_order",
    "takes_load",
    "types_of_robots",
    "walk_to_cycle",
    "ways_on",
    "weighted_table_of",
    "with_load",
    "without_load",
    "write_path",
]
