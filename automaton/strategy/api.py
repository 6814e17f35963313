"""The imports of a strategy: its contract, the declarations and constants of the world, and
kernels.

    from automaton.strategy.api import CMD_PARK, NIL, Strategy, Struct, field, kernel

It loads Numba. Modules with parameters of shipped strategies do not import it, since every
`automaton check` reads them; nor do the modules of this package.
"""

from __future__ import annotations

from automaton.engine.batches import allocation_of
from automaton.engine.blockers import walk_to_cycle
from automaton.engine.decisions import (
    CMD_DROP_AT,
    CMD_GO,
    CMD_HOLD,
    CMD_PARK,
    CMD_RETREAT,
    CMD_STEP,
    CMD_TAKE_ORDER,
    CMD_WAIT,
    Decisions,
)
from automaton.engine.distance_tables import UNREACHABLE
from automaton.engine.energy import CURVE_RATE, charging_ticks, level_after
from automaton.engine.facilities import Design, Roads, ServiceZones, design_for, empty_design
from automaton.engine.gates import (
    closed_until,
    gate_before,
    has_gates,
    is_in_full_gate,
    opens_soon,
)
from automaton.engine.holders import lane_of
from automaton.engine.jit.kernel import kernel, prefetch
from automaton.engine.jit.structs import (
    CONSTANT,
    DERIVED,
    SCRATCH,
    STATIC,
    STOP,
    NamedNumbers,
    Struct,
    field,
    number,
)
from automaton.engine.motion import direction_between, has_room, is_empty
from automaton.engine.operations import (
    end_of_stops,
    energy_cost,
    first_cell,
    has_load,
    heading_towards,
    headings_of,
    is_facing,
    limited_ticks,
    next_stop_cell,
    types_of_robots,
    with_load,
    without_load,
)
from automaton.engine.random_numbers import (
    STREAM_ABORTS,
    STREAM_RETREATS,
    STREAM_STORAGE,
    STREAM_STRATEGY,
    is_due,
    random_between,
    random_bits,
    random_ticks,
    splitmix64,
)
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
    find_step_costs,
    follow_gradient,
    how_turned,
    is_closed,
    mark_goal,
    nearest_mark,
    parent_of,
    pop,
    push,
    table_of,
    tables_fit,
    ways_on,
    weighted_table_of,
    write_path,
)
from automaton.engine.state import (
    ACTION_BAY_BLOCKED,
    ACTION_BLOCKED,
    ACTION_CHARGE,
    ACTION_COUNT,
    ACTION_DELAYED,
    ACTION_DOWN,
    ACTION_DROP,
    ACTION_FOLLOWING,
    ACTION_GATE,
    ACTION_HELD_BACK,
    ACTION_IDLE,
    ACTION_ILLEGAL,
    ACTION_MOVE,
    ACTION_PICK,
    ACTION_QUEUE,
    ACTION_RETREAT,
    ACTION_SERVE,
    ACTION_STATION_QUEUE,
    ACTION_TRY_DROP,
    ACTION_TURN,
    ACTION_WAIT,
    BATTERY_FULL,
    BATTERY_PERCENT,
    FOLLOWING_CONVOY,
    FOLLOWING_HANDOVER,
    FOLLOWING_NONE,
    GATE_BLOCK,
    GOAL_CHARGE,
    GOAL_DROP,
    GOAL_NONE,
    GOAL_PARK,
    GOAL_PICK,
    GOAL_STOP,
    KEEP,
    MAY_TURN,
    NEED_ALLOCATION,
    NEED_CHARGING,
    NEED_RIGHT_OF_WAY,
    NEED_ROUTE,
    NIL,
    NO_WAY_THROUGH,
    ORDER_CARRIED,
    ORDER_DELIVERED,
    ORDER_LIST,
    ORDER_STARTED,
    ORDER_UNRELEASED,
    ORDER_WAITING,
    REASON_AROUND_CLOSED,
    REASON_AROUND_ROBOTS,
    REASON_IDLE,
    REASON_NEW_GOAL,
    REASON_NO_ORDER,
    REASON_ORDER_RETURNED,
    REASON_ORDER_TAKEN,
    REASON_PERIODIC,
    REASON_PICKED,
    REASON_REPLAN,
    REASON_RETREATING,
    REASON_RETRIES_EXHAUSTED,
    REASON_SERVED,
    REASON_ZONE_EVENT,
    RETRY_EXHAUSTED,
    RETRY_NONE,
    RETRY_WAITED,
    STATUS_DEPLETED,
    STATUS_EXHAUSTED,
    STATUS_FAILED,
    STATUS_FAILING,
    STATUS_REMOVED,
    STATUS_TOWED,
    STATUS_UP,
    Array,
    Batch,
    Grid,
    Memory,
    Workspace,
    World,
)
from automaton.engine.table_rows import cost_in, has_room_for
from automaton.engine.trips import has_place, is_in_own_queue
from automaton.engine.visibility import copy_segment
from automaton.errors import InputError
from automaton.strategy.contract import NoState, Strategy
from automaton.strategy.placing import (
    FIXED,
    LEAST_PRIORITY,
    STORAGE_POLICIES,
    PlacingState,
    begin_cell,
    can_bring,
    can_do,
    cell_beside,
    deliver,
    dropoff_cell,
    highest_priority,
    is_open,
    pickup_cell,
    place_load,
    places_load,
    position,
    set_down,
    take_order,
    takes_load,
)
from automaton.strategy.weighted_tables import DistanceTables, no_tables, weighted_tables
