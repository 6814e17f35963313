"""Predicted zones of robots: on their A* paths, with added noise, or by a trained network.

A set of zones has a bit for each zone, in int64 words. A move belongs to the zone of the cell that it
leaves, so the last cell of a path does not count.
"""

from functools import lru_cache
from typing import Final

import numpy as np

from automaton.strategy.api import (
    ACTION_MOVE,
    CONSTANT,
    GOAL_PICK,
    NIL,
    SCRATCH,
    STARTED,
    Array,
    Struct,
    dropoff_cell,
    field,
    first_cell,
    heading_towards,
    kernel,
    limited_ticks,
    next_stop_cell,
    parent_of,
    random_between,
    random_bits,
    splitmix64,
    with_load,
)
from strategies.routing.astar import astar, search
from strategies.routing.routing_parameters import whole_layers

WORD_BITS = 64  # zones per word of a set
STREAM_PREDICTIONS = 11  # of random draws; each stream has a number of its own
STREAM_LEGS = 13
CERTAIN = 1 << 32  # probabilities are whole numbers of 2^-32
USED_SHARE: Final = 27.5 / 522  # of a task in warehouse-100 (A*, random ties)


def words(zones: int) -> int:
    """The number of int64 words of a set of zones."""
    return -(-zones // WORD_BITS)


@kernel
def has_zone(used, zone):
    """1 if a zone is in a set, else 0."""
    return (used[zone >> 6] >> (zone & (WORD_BITS - 1))) & 1


@kernel
def count_zones(used, count):
    """count[z] += 1 for each zone of a set."""
    for word in range(used.shape[0]):
        bits = used[word]
        for k in range(WORD_BITS):
            if bits == 0:
                break
            if (bits >> k) & 1:
                count[word * WORD_BITS + k] += 1
                bits &= bits - 1


@kernel
def count_common(used, count):
    """The sum of count[z] over the zones of a set."""
    common = 0
    for zone in range(count.shape[0]):
        if has_zone(used, zone):
            common += np.int64(count[zone])
    return common


# The zones of the path that the last search left in workspace.came, and the cost of robots in them.


@kernel
def add_zones(grid, workspace, pose, used):
    """Add the zones of the path to a pose to a set; used: (words,) int64, a bit for each zone."""
    at = pose
    while workspace.came[at] != STARTED:
        how = np.int64(workspace.came[at])
        if how < 4:
            zone = zone_left(grid, at, how)
            if zone != NIL:
                used[zone >> 6] |= np.int64(1) << (zone & (WORD_BITS - 1))
        at = parent_of(grid, at, how)


@kernel
def delay_of(grid, duration, workspace, pose, count):
    """Ticks lost to others on the path to a pose: a move takes 1 + count[zone] times as long.

    count: (Z,) int32, other robots in each zone (the static interpretation of slow zones).
    """
    delay = np.int64(0)
    at = pose
    while workspace.came[at] != STARTED:
        how = np.int64(workspace.came[at])
        before = parent_of(grid, at, how)
        if how < 4:
            zone = zone_left(grid, at, how)
            if zone != NIL:
                ticks = limited_ticks(grid, duration[ACTION_MOVE], before // grid.headings, how)
                delay += np.int64(count[zone]) * ticks
        at = before
    return delay


@kernel
def zone_left(grid, pose, how):
    """The zone of the move in direction `how` that ended in a pose; NIL on an intersection."""
    cell = (pose >> (grid.headings >> 1)) - grid.offset[how]
    return np.int64(grid.traffic_zone[cell, how >> 1])


# The expected paths of robots: the rest of their routes, and of their tasks by A*.


@kernel
def count_predicted(view, workspace, ties, besides, steps, marked, field):
    """field: (C,) int32, number of driving robots that will cross each cell.

    `besides`: the identity of a robot that does not count. A robot's path is the rest of its route,
    or the path to its goal cell, and then the path to the drop-off of its load.
    `workspace`, `steps` (L,) uint8 and `marked` (C,) int32 are scratch.
    """
    robots, headings = view.robots, view.grid.headings
    field[:] = 0
    marked[:] = 0
    for i in range(robots.cell.shape[0]):
        goal_cell = np.int64(robots.goal_cell[i])
        if goal_cell == NIL or robots.identity[i] == besides:
            continue
        cell, heading = first_cell(robots, i), np.int64(robots.heading[i])
        route_index, end = np.int64(robots.route_index[i]), np.int64(robots.route_length[i])
        if route_index < end:
            length = end - route_index
            for s in range(length):
                steps[s] = robots.route[i, route_index + s]
            follow(view.grid, cell, steps, length, i + 1, marked, field)
        else:
            pose, robot_type = cell * headings + heading, np.int64(robots.type[i])
            length = follow_path(
                view, workspace, ties, i, robot_type, pose, goal_cell, steps, marked, field
            )
        if length > 0:
            heading = heading_towards(view.grid, robots.type[i], np.int64(steps[length - 1]))
        beyond = next_goal_cell(view, i)
        if beyond != NIL:
            pose = goal_cell * headings + heading
            robot_type = with_load(view, np.int64(robots.type[i]))
            follow_path(view, workspace, ties, i, robot_type, pose, beyond, steps, marked, field)


@kernel
def next_goal_cell(view, i):
    """The drop-off or first stop of the load that robot i drives to pick up; or NIL."""
    order = np.int64(view.robots.order[i])
    if order == NIL or view.robots.goal_type[i] != GOAL_PICK:
        return np.int64(NIL)
    if view.trips.pod.shape[0] > 0:
        return next_stop_cell(view, order)
    target, pick = np.int64(view.orders.target[order]), np.int64(view.robots.goal_cell[i])
    return dropoff_cell(view, view.robots.type[i], target, pick)


@kernel
def follow_path(view, workspace, ties, i, robot_type, pose, target, steps, marked, field):
    """Count the cells of robot i's A* path, as one of a type, from a pose to a cell.

    Returns the length of the path, or NIL.
    """
    rules = view.rules
    duration = rules.duration[robot_type]
    length = astar(
        view.grid, robot_type, duration, workspace, ties, rules.seed, pose, target, False, steps
    )
    if length != NIL:
        follow(view.grid, pose // view.grid.headings, steps, length, i + 1, marked, field)
    return length


@kernel
def follow(grid, cell, steps, length, mark, marked, field):
    """Count a cell and those of the next steps, each once per robot: marks prevent counting it twice."""
    for s in range(length + 1):
        if marked[cell] != mark:
            marked[cell] = mark
            field[cell] += 1
        if s < length:
            cell += grid.offset[steps[s]]


# Noisy predictions: the zones of a robot's task as a classifier with some precision predicts them.
#
# Each zone has an independent draw, addressed by (seed, task, robot, zone): a zone of the task is kept
# with probability `recall`; any other zone is added with the probability of `false_alarms`.


@kernel
def blur(used, traffic_zone_count, keep, add, seed, task, robot):
    """Replace a set of zones by its prediction; keep, add: probabilities in units of 1/CERTAIN."""
    base = random_bits(seed, STREAM_PREDICTIONS, task, robot)
    for zone in range(traffic_zone_count):
        bit = np.int64(1) << (zone & (WORD_BITS - 1))
        chance = np.int64(splitmix64(base + np.uint64(zone)) >> np.uint64(32))
        if used[zone >> 6] & bit:
            if chance >= keep:
                used[zone >> 6] &= ~bit
        elif chance < add:
            used[zone >> 6] |= bit


def false_alarms(precision: float, recall: float, used: float) -> float:
    """The probability of predicting a zone that a task does not use.

        recall * used * (1 - precision) / (precision * (1 - used))

    `used`: the share of the zones that a task uses on average. Over many tasks, the share `precision`
    of all predicted zones is then right.
    """
    return min(1.0, recall * used * (1 - precision) / (precision * (1 - used)))


# A trained network that predicts the zones of a leg in integers, identically on every machine.
#
#     start zone, end zone -> three hidden layers of rectifiers -> a logit for each zone
#
# All numbers are fixed-point, value * 2^bits. Integer sums do not depend on the order, so compilers
# may reorder them.


class DenseLayer(Struct):
    """A layer of a network, with a buffer for its output."""

    weights: Array = field("(inputs, outputs) int32", role=CONSTANT)
    bias: Array = field("(outputs,) int32", role=CONSTANT)
    sums: Array = field("(outputs,) int64", role=SCRATCH)


class KernelNetwork(Struct):
    """A network for kernels. The first layer has a row for each start zone, then for each end zone."""

    bits: int = field("int64", "number of bits after the binary point")
    zones: int = field("int64", "0: there is no network")
    first: DenseLayer
    second: DenseLayer
    third: DenseLayer
    last: DenseLayer


def no_network():
    """A placeholder if no network is used."""
    layers = {
        name: DenseLayer.sized({"inputs": 0, "outputs": 0})
        for name in ("first", "second", "third", "last")
    }
    return KernelNetwork(bits=0, zones=0, **layers)


@lru_cache(maxsize=4)
def _short_layers(network):
    """The layers in int32 for kernels; read-only, since all runs share them."""
    layers = [
        (weights.astype(np.int32), bias.astype(np.int32))
        for weights, bias in whole_layers(network)[1]
    ]
    for part in (part for layer in layers for part in layer):
        part.setflags(write=False)
    return layers


def kernel_network(network):
    """The network for kernels, with its own scratch."""
    first, second, third, last = (
        DenseLayer.sized(weights=weights, bias=bias) for weights, bias in _short_layers(network)
    )
    return KernelNetwork(
        bits=whole_layers(network)[0],
        zones=network.zones,
        first=first,
        second=second,
        third=third,
        last=last,
    )


@kernel
def add_predicted(network, start, end, used):
    """Add the predicted zones of a leg to a set; used: (words,) int64, a bit for each.

    `start`, `end`: zones or NIL. A zone with a probability above 1/2, a logit above 0, is predicted.
    """
    first, bits = network.first, network.bits
    first.sums[:] = 0
    if start != NIL:
        add_row(first.weights[start], 1, first.sums)
    if end != NIL:
        add_row(first.weights[network.zones + end], 1, first.sums)
    add_row(first.bias, 1, first.sums)
    run_layer(network.second, 0, bits, first.sums)
    run_layer(network.third, bits, bits, network.second.sums)
    run_layer(network.last, bits, bits, network.third.sums)
    for zone in range(network.zones):
        if network.last.sums[zone] > 0:
            used[zone >> 6] |= np.int64(1) << (zone & (WORD_BITS - 1))


@kernel
def run_layer(layer, shift, bits, inputs):
    """layer.sums = (weights x positive inputs >> shift) + bias."""
    layer.sums[:] = 0
    add_row(layer.bias, np.int64(1) << bits, layer.sums)
    for i in range(inputs.shape[0]):
        factor = inputs[i] >> shift
        if factor > 0:
            add_row(layer.weights[i], factor, layer.sums)


@kernel
def add_row(row, factor, sums):
    """sums[j] += factor * row[j]."""
    for j in range(sums.shape[0]):
        sums[j] += np.int64(row[j]) * factor


@kernel
def predict_legs(network, start, end, used):
    """used[k] = the predicted zones of leg k: start, end (n,) int64 zones or NIL; used (n, words)."""
    for k in range(start.shape[0]):
        used[k] = 0
        add_predicted(network, start[k], end[k], used[k])


# Single legs and the zones of their paths: the training data of networks.


@kernel
def draw_legs(racks, docks, seed, start, end):
    """Legs, alternately from a rack to a dock and back, drawn by (seed, leg); start, end: (n,) cells."""
    for k in range(start.shape[0]):
        rack = racks[random_between(0, racks.shape[0] - 1, seed, STREAM_LEGS, 0, k)]
        dock = docks[random_between(0, docks.shape[0] - 1, seed, STREAM_LEGS, 1, k)]
        start[k] = dock if k & 1 else rack
        end[k] = rack if k & 1 else dock


@kernel
def trace_legs(grid, duration, workspace, ties, start, end, used):
    """used[k] = the zones of the A* path from pose start[k] to cell end[k]; used: (n, words).

    Returns the number of traced legs; it stops at a leg without a path.
    """
    for k in range(start.shape[0]):
        used[k] = 0
        pose = search(grid, 0, duration, workspace, ties, np.uint64(0), start[k], end[k], False)
        if pose == NIL:
            return np.int64(k)
        add_zones(grid, workspace, pose, used[k])
    return np.int64(start.shape[0])
