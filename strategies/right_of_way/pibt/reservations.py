"""Who is in a cell, or in a lane of a cell for two, and who has chosen it for after this move."""

import numpy as np

from automaton.engine.state import NIL
from automaton.strategy.kernels import kernel, lane_of
from strategies.right_of_way.pibt.pibt_state import U


@kernel
def resource_in(view, cell, direction):
    """What a robot travelling in a direction takes of a cell, NIL where there is no limit."""
    lane = lane_of(np.int64(view.grid.cell_flags[U(cell)]), direction)
    return NIL if lane == NIL else cell + lane * view.grid.cell_flags.shape[0]


@kernel
def holder_of(view, cell, direction):
    """The robot that holds this resource now, or NIL."""
    lane = lane_of(np.int64(view.grid.cell_flags[U(cell)]), direction)
    if lane == NIL:
        return np.int64(NIL)
    identity = np.int64(view.traffic.holder[U(cell), U(lane)])
    return np.int64(NIL) if identity == NIL else np.int64(view.robots.at_index[U(identity)])


@kernel
def own_resource(view, i):
    return resource_in(view, np.int64(view.robots.cell[U(i)]), np.int64(view.robots.travel[U(i)]))


@kernel
def reserve(state, resource, i):
    if resource != NIL:
        state.reserved[U(resource)] = (state.calls[0] << 32) | i


@kernel
def reserver_of(state, resource):
    """Who has reserved a resource in this call, or NIL."""
    if resource == NIL:
        return np.int64(NIL)
    word = state.reserved[U(resource)]
    return word & 0xFFFFFFFF if word >> 32 == state.calls[0] else np.int64(NIL)


@kernel
def is_for_two(view, cell):
    return (np.int64(view.grid.cell_flags[U(cell)]) >> 5) & 3 == 2


@kernel
def is_lane_free(view, state, i):
    """Whether robot i can turn where it is: in a cell for two it takes both lanes."""
    cell, travel = np.int64(view.robots.cell[U(i)]), np.int64(view.robots.travel[U(i)])
    if not is_for_two(view, cell):
        return True
    if holder_of(view, cell, travel ^ 2) != NIL:
        return False
    comer = reserver_of(state, resource_in(view, cell, travel ^ 2))
    return comer == NIL or comer == i


@kernel
def reserve_other_lane(view, state, i):
    """Robot i turns: in a cell for two no other robot comes into the other lane meanwhile."""
    cell, travel = np.int64(view.robots.cell[U(i)]), np.int64(view.robots.travel[U(i)])
    if is_for_two(view, cell):
        reserve(state, resource_in(view, cell, travel ^ 2), i)
