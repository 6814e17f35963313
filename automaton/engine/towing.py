"""What becomes of the pod of a robot that is towed: it is put into the nearest free storage cell.

Its order waits there with the stops that are left, for any robot; one with none left is over, unless it
names another cell.
"""

import numpy as np

from automaton.engine.jit.kernel import kernel
from automaton.engine.loads import complete_order, end_leg, reserve_order
from automaton.engine.motion import put_pod_into
from automaton.engine.next_stop import next_stop
from automaton.engine.operations import put_off
from automaton.engine.record_changes import record_change
from automaton.engine.record_codes import CHANGE_LOAD_LEFT
from automaton.engine.search import begin_search, mark_goal, nearest_mark
from automaton.engine.state import NIL, ORDER_WAITING
from automaton.engine.trips import give_place_back, offer, store_pod


@kernel
def put_pod_aside(world, record, workspace, i):
    """The pod of robot i, which is about to be towed, stands in storage; False: no cell is free."""
    robots, orders, trips = world.robots, world.orders, world.trips
    slot = nearest_storage(world, workspace, i)
    if slot == NIL:
        return False
    order, identity = np.int64(robots.load[i]), np.int64(robots.identity[i])
    cell = np.int64(world.slots.cell[slot])
    end_leg(world, i, order)
    put_off(world, i)
    robots.order[i] = NIL
    record_change(world.clock, record, CHANGE_LOAD_LEFT, identity, slot)
    put_pod_into(world.traffic.occupancy, cell)
    give_place_back(world, identity)
    orders.current_slot[order] = slot
    trips.begun[order] = orders.stops_done[order]  # a visit that was cut short begins again
    stays = orders.target[order] == NIL or orders.target[order] == slot
    if stays and next_stop(world, order) == NIL:
        complete_order(world, order)
        store_pod(world, order, slot, True)
        reserve_order(world, record, order, NIL)
        return True
    orders.state[order] = ORDER_WAITING
    store_pod(world, order, slot, False)
    reserve_order(world, record, order, NIL)
    offer(world, record, order, cell)
    return True


@kernel
def nearest_storage(world, workspace, i):
    """The slot that robot i, with its pod, gets to soonest of those that are free; NIL: none is.

    Ties go to the lowest number, which also decides where it gets to none of them.
    """
    robots, slots = world.robots, world.slots
    robot_type = np.int64(robots.type[i])
    search = begin_search(workspace)
    for slot in range(slots.first_spare):
        if world.pods.slot_class[slot] == NIL or slots.content[slot] != NIL:
            continue
        if slots.reserved_by[slot] == NIL and slots.reachable[robot_type, slots.cell[slot]]:
            mark_goal(workspace, search, np.int64(slots.cell[slot]), slot)
    leave_out_held(world, workspace, i)
    cell, heading = np.int64(robots.cell[i]), np.int64(robots.heading[i])
    nearest = np.int64(nearest_mark(world, workspace, search, robot_type, cell, heading, False))
    slot = np.int64(0)
    while nearest == NIL and slot < slots.first_spare:
        if workspace.mark_stamp[slots.cell[slot]] == search:
            nearest = slot
        slot += 1
    return nearest


@kernel
def leave_out_held(world, workspace, i):
    """No goals are the cells of robots with a load but i; where none drives under pods, of any robot.

    That is the cell in which one stands, and the one that it enters.
    """
    robots = world.robots
    for j in range(robots.cell.shape[0]):
        if j == i or robots.cell[j] == NIL or (robots.load[j] == NIL and world.rules.under):
            continue
        workspace.mark_stamp[robots.cell[j]] = NIL
        if robots.claim[j] != NIL:
            workspace.mark_stamp[robots.claim[j]] = NIL
