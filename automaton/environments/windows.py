"""What robots see: windows of the floor around them, and the features of each robot.

A plane holds one byte for each cell of the floor and of a margin around it, so a window is copied row by
row. A window kernel is compiled for each radius: its loops have constant lengths.
"""

from functools import cache
from typing import Any, Final

import numpy as np

from automaton.engine.digest import digest_world
from automaton.engine.jit.struct_types import clear_bytes, copy_bytes
from automaton.environments.stepping import FloorScene
from automaton.strategy.api import (
    BATTERY_FULL,
    GOAL_CHARGE,
    GOAL_DROP,
    GOAL_PARK,
    GOAL_PICK,
    GOAL_STOP,
    NIL,
    ORDER_WAITING,
    UNREACHABLE,
    distance,
    kernel,
)

U = np.uint64  # unsigned index: spares the test for negative values
CHANNELS: Final = {
    "walls": "1: robots of its type never stand here (wall, closed area, outside the floor)",
    "ways": "exits for robots of its type, as bits: east 1, south 2, west 4, north 8",
    "robots": "1: another robot on the floor has it as cell or claim",
    "headings": "1 + direction of another robot (omnidirectional: 1), else 0",
    "loads": "1: another robot here carries something",
    "pods": "1: a pod stands here",
    "orders": "open orders that it can do and that are picked up from here, at most 255",
    "goal": "1 in one cell: its goal cell, each axis clipped to the window; no goal: all 0",
    "goals": "other robots whose goal cell this is, at most 255",
}
(
    CHANNEL_WALLS,
    CHANNEL_WAYS,
    CHANNEL_ROBOTS,
    CHANNEL_HEADINGS,
    CHANNEL_LOADS,
    CHANNEL_PODS,
    CHANNEL_ORDERS,
    CHANNEL_GOAL,
    CHANNEL_GOALS,
) = range(len(CHANNELS))
# Channels with a plane for each type of robots.
CHANNELS_BY_TYPE: Final = (CHANNEL_WALLS, CHANNEL_WAYS, CHANNEL_ORDERS)
MAX_COUNT: Final = 255


@cache
def window_kernel(radius: int) -> Any:
    """The kernel that fills the windows of a radius."""
    side = 2 * radius + 1
    area = side * side
    centre = radius * side + radius

    def fill_windows(world, episode, buffers, w, workspace):
        robots, scene, windows = world.robots, episode.scene, buffers.observations
        show_robots(world, episode)
        stride, planes, target = scene.stride, episode.planes.ctypes.data, windows.ctypes.data
        for i in range(robots.cell.shape[0]):
            cell = np.int64(robots.cell[U(i)])
            here = np.int64(robots.home[U(i)] if cell == NIL else cell)
            corner = np.int64(scene.plane[U(here)]) - radius * (stride + 1)
            kind = np.int64(robots.type[U(i)])
            for k in range(scene.channels.shape[0]):
                channel, at = scene.channels[U(k)], k * area
                plane = scene.planes[U(k)]
                to = target + (w * robots.cell.shape[0] + i) * windows.shape[2] + at
                if channel == CHANNEL_GOAL:
                    clear_bytes(to, area)
                    goal = np.int64(robots.goal_cell[i])
                    if goal != NIL:
                        across = clipped(scene.column[goal] - scene.column[here], radius)
                        down = clipped(scene.row[goal] - scene.row[here], radius)
                        windows[w, i, at + centre + down * side + across] = 1
                    continue
                if channel in (CHANNEL_WALLS, CHANNEL_WAYS, CHANNEL_ORDERS):
                    plane += kind
                source = planes + plane * episode.planes.shape[1] + corner
                for y in range(side):
                    copy_bytes(to + y * side, source + y * stride, side)
                if channel == CHANNEL_ROBOTS:
                    if cell != NIL and episode.robots[episode.cell[i]] < 2:
                        windows[w, i, at + centre] = 0
                    hide_own(scene, episode, windows, w, i, at + centre, side, 0)
                elif channel in (CHANNEL_HEADINGS, CHANNEL_LOADS):
                    windows[w, i, at + centre] = 0
                    hide_own(scene, episode, windows, w, i, at + centre, side, MAX_COUNT)
                elif channel == CHANNEL_GOALS and robots.goal_cell[i] != NIL:
                    across = scene.column[robots.goal_cell[i]] - scene.column[here]
                    down = scene.row[robots.goal_cell[i]] - scene.row[here]
                    if abs(across) <= radius and abs(down) <= radius:
                        place = at + centre + down * side + across
                        windows[w, i, place] -= 1
        if scene.sight != NIL:
            hide_outside(episode, windows, w, side)

    # Numba finds compiled code by this name: radii must not have the same one.
    fill_windows.__name__ = fill_windows.__qualname__ = f"fill_windows_{radius}"
    return kernel(fill_windows)


@kernel
def clipped(offset, radius):
    """An offset of cells, within a window."""
    return min(max(np.int64(offset), -radius), radius)


@kernel
def hide_own(scene, episode, windows, w, i, centre, side, others):
    """Remove the claim of robot i from its own window, unless another robot is there."""
    claim = np.int64(episode.claim[i])
    if side == 1 or claim == NIL or episode.robots[claim] > max(others, 1):
        return
    ahead = claim - np.int64(episode.cell[i])
    if abs(ahead) == 1:
        windows[w, i, centre + ahead] = 0
    elif abs(ahead) == scene.stride:
        windows[w, i, centre + (side if ahead > 0 else -side)] = 0


@kernel
def hide_outside(episode, windows, w, side):
    """Remove what is outside the circle that robots see, except the floor and the goal."""
    scene, radius = episode.scene, side // 2
    for k in range(scene.channels.shape[0]):
        channel = scene.channels[k]
        if channel != CHANNEL_ROBOTS and channel != CHANNEL_HEADINGS and channel != CHANNEL_LOADS:
            continue
        for y in range(side):
            for x in range(side):
                far = (x - radius) * (x - radius) + (y - radius) * (y - radius)
                if far > scene.sight * scene.sight:
                    windows[w, :, (k * side + y) * side + x] = 0


# Windows and features in which ahead of the robot is up.


@kernel
def turn_views(world, episode, buffers, w, workspace):
    """Turn the windows and the features of all robots: ahead of each is up."""
    robots, scene, windows = world.robots, episode.scene, buffers.observations
    side = scene.turned_side
    for i in range(robots.cell.shape[0]):
        quarters = (np.int64(robots.heading[i]) + 1) % 4  # anticlockwise
        if windows.shape[2]:
            for k in range(scene.channels.shape[0]):
                for _ in range(quarters):
                    turn_window(windows[w, i], k * side * side, side)
                if scene.channels[k] in (CHANNEL_WAYS, CHANNEL_HEADINGS):
                    turn_values(windows[w, i], scene.channels[k], k * side * side, side, quarters)
        if buffers.features.shape[2]:
            turn_features(buffers.features[w, i], quarters)


@kernel
def turn_window(window, at, side):
    """Turn a channel, which begins at a place, by a quarter anticlockwise."""
    last = side - 1
    for y in range(side // 2):
        for x in range((side + 1) // 2):
            row, column, first = y, x, window[at + y * side + x]
            for _ in range(3):
                window[at + row * side + column] = window[at + column * side + last - row]
                row, column = column, last - row
            window[at + row * side + column] = first


@kernel
def turn_values(window, channel, at, side, quarters):
    """Turn the directions that the values of a channel mean."""
    for place in range(at, at + side * side):
        value = np.int64(window[place])
        if channel == CHANNEL_WAYS:
            window[place] = (value | value << 4) >> quarters & 15
        elif value:
            window[place] = 1 + (value - 1 - quarters) % 4


@kernel
def turn_features(features, quarters):
    """Turn the heading, and the cells to the goal."""
    for _ in range(quarters):
        features[10], features[11] = features[11], -features[10]
    for heading in range(4):
        features[heading] = heading == 3


# The planes of a world.


@kernel
def show_robots(world, episode):
    """Bring the planes up to date."""
    scene = episode.scene
    robots_plane, headings_plane = np.int64(NIL), np.int64(NIL)
    for k in range(scene.channels.shape[0]):
        channel, plane = scene.channels[k], scene.planes[k]
        if channel == CHANNEL_ROBOTS:
            robots_plane = plane
        elif channel in (CHANNEL_HEADINGS, CHANNEL_LOADS):
            headings_plane = plane
        elif channel == CHANNEL_GOALS:
            count_goals(world, episode, plane)
        elif (channel in (CHANNEL_PODS, CHANNEL_ORDERS)) and episode.revision[
            0
        ] != world.clock.revision:
            show_demand(world, episode, channel, plane)
    episode.revision[0] = world.clock.revision
    if robots_plane == NIL and headings_plane == NIL:
        return
    for k in range(scene.channels.shape[0]):
        if scene.channels[k] == CHANNEL_HEADINGS or scene.channels[k] == CHANNEL_LOADS:
            clear_robots(episode, scene.planes[k])
    move_robots(world, episode, robots_plane)
    for k in range(scene.channels.shape[0]):
        if scene.channels[k] == CHANNEL_HEADINGS or scene.channels[k] == CHANNEL_LOADS:
            mark_robots(world, episode, scene.channels[k], scene.planes[k])


@kernel
def move_robots(world, episode, plane):
    """Count robots by place, where that has changed; `plane`: of the channel `robots`, or NIL."""
    robots, scene = world.robots, episode.scene
    for i in range(robots.cell.shape[0]):
        cell, claim = np.int64(robots.cell[U(i)]), np.int64(robots.claim[U(i)])
        cell = np.int64(NIL) if cell == NIL else np.int64(scene.plane[U(cell)])
        claim = np.int64(NIL) if claim == NIL else np.int64(scene.plane[U(claim)])
        claim = np.int64(NIL) if claim == cell else claim
        if episode.cell[U(i)] != cell:
            count_robot(episode, plane, np.int64(episode.cell[i]), -1)
            count_robot(episode, plane, cell, 1)
            episode.cell[i] = cell
        if episode.claim[U(i)] != claim:
            count_robot(episode, plane, np.int64(episode.claim[i]), -1)
            count_robot(episode, plane, claim, 1)
            episode.claim[i] = claim


@kernel
def count_robot(episode, plane, place, more):
    """One robot more or less has a place."""
    if place == NIL:
        return
    episode.robots[place] = np.int64(episode.robots[place]) + more
    if plane != NIL:
        episode.planes[plane, place] = 1 if episode.robots[place] else 0


@kernel
def clear_robots(episode, plane):
    """Clear the places that robots had when they were last shown."""
    for i in range(episode.cell.shape[0]):
        if episode.cell[i] != NIL:
            episode.planes[plane, episode.cell[i]] = 0
        if episode.claim[i] != NIL:
            episode.planes[plane, episode.claim[i]] = 0


@kernel
def mark_robots(world, episode, channel, plane):
    """Enter headings or loads of all robots; of several at one place the highest number counts."""
    robots = world.robots
    for i in range(robots.cell.shape[0]):
        value = (
            1 + np.int64(robots.heading[i])
            if channel == CHANNEL_HEADINGS
            else robots.load[i] != NIL
        )
        if episode.cell[i] != NIL:
            episode.planes[plane, episode.cell[i]] = value
        if episode.claim[i] != NIL:
            episode.planes[plane, episode.claim[i]] = value


@kernel
def count_goals(world, episode, plane):
    """Count goals by cell."""
    robots, scene = world.robots, episode.scene
    episode.planes[plane] = 0
    for i in range(robots.cell.shape[0]):
        goal = np.int64(robots.goal_cell[i])
        if goal != NIL:
            place = scene.plane[goal]
            many = np.int64(episode.planes[plane, place])
            episode.planes[plane, place] = min(many + 1, MAX_COUNT)


@kernel
def show_demand(world, episode, channel, plane):
    """Show where pods stand, or from where open orders are picked up."""
    scene, slots = episode.scene, world.slots
    if channel == CHANNEL_PODS:
        episode.planes[plane] = 0
        for pod in range(world.pods.slot.shape[0]):
            slot = np.int64(world.pods.slot[pod])
            if slot != NIL:
                episode.planes[plane, scene.plane[slots.cell[slot]]] = 1
        return
    orders = world.orders
    for kind in range(scene.types):
        episode.planes[plane + kind] = 0
        for order in range(world.clock.first_open, world.clock.known_orders):
            if orders.state[order] != ORDER_WAITING or orders.reserved_by[order] != NIL:
                continue
            if orders.weight[order] > world.rules.payload[kind]:
                continue
            slot = np.int64(orders.current_slot[order])
            if slot == NIL:
                stop = np.int64(orders.first_stop[order])
                if stop < orders.first_stop[order + 1]:
                    count_order(world, episode, kind, plane, np.int64(world.stops.cell[stop]))
                continue
            for side in range(4):
                count_order(world, episode, kind, plane, np.int64(slots.access[slot, side]))


@kernel
def count_order(world, episode, kind, plane, cell):
    """An order can be picked up from a cell by robots of a type that reach it."""
    if cell == NIL or world.slots.reachable[kind, cell] == 0:
        return
    place = episode.scene.plane[cell]
    many = np.int64(episode.planes[plane + kind, place])
    episode.planes[plane + kind, place] = min(many + 1, MAX_COUNT)


# Distances and features.


@kernel
def measure_distances(world, episode, buffers, w, workspace):
    """Measure the ticks to each goal on the empty floor, and by how many it came nearer."""
    robots = world.robots
    for i in range(robots.cell.shape[0]):
        goal, claim = np.int64(robots.goal_cell[i]), np.int64(robots.claim[i])
        cell = np.int64(robots.home[i] if robots.cell[i] == NIL else robots.cell[i])
        cell = cell if claim == NIL else claim
        kind, heading = np.int64(robots.type[i]), np.int64(robots.heading[i])
        pose = (cell * 4 + heading) * 256 + kind
        episode.nearer[i] = 0
        is_known = episode.goal[i] == goal
        if is_known and episode.pose[i] == pose:
            continue
        ticks = np.int64(0)
        if goal != NIL:
            ticks = distance(world, workspace, kind, cell, heading, goal)
            ticks = ticks if ticks < UNREACHABLE else np.int64(0)
        if is_known and goal != NIL:
            episode.nearer[i] = np.int64(episode.distance[i]) - ticks
        episode.goal[i], episode.pose[i], episode.distance[i] = goal, pose, ticks


@kernel
def fill_features(world, episode, buffers, w, workspace):
    """Fill in the features of all robots; `distance` is up to date."""
    robots, out, scene = world.robots, buffers.features, episode.scene
    tick = world.clock.tick
    for i in range(robots.cell.shape[0]):
        goal_type, goal = np.int64(robots.goal_type[i]), np.int64(robots.goal_cell[i])
        headings = world.grid.type_headings[robots.type[i]]
        for k in range(4):
            out[w, i, k] = headings > 1 and robots.heading[i] == k
        out[w, i, 4] = robots.load[i] != NIL
        out[w, i, 5] = min(np.int64(robots.busy[i]) / 16, 1.0)
        out[w, i, 6] = goal_type in (GOAL_PICK, GOAL_STOP)
        out[w, i, 7] = goal_type == GOAL_DROP
        out[w, i, 8] = goal_type == GOAL_PARK
        out[w, i, 9] = goal_type == GOAL_CHARGE
        out[w, i, 10] = out[w, i, 11] = out[w, i, 12] = 0.0
        if goal != NIL:
            here = np.int64(robots.home[i] if robots.cell[i] == NIL else robots.cell[i])
            across = np.int64(scene.column[goal]) - np.int64(scene.column[here])
            down = np.int64(scene.row[goal]) - np.int64(scene.row[here])
            out[w, i, 10] = min(max(across / 16, -1.0), 1.0)
            out[w, i, 11] = min(max(down / 16, -1.0), 1.0)
            out[w, i, 12] = min(episode.distance[i] / 64, 1.0)
        charge = np.int64(robots.charge[i]) / BATTERY_FULL
        out[w, i, 13] = charge if world.rules.battery else 1.0
        order = np.int64(robots.order[i])
        out[w, i, 14] = 0.0
        if order != NIL:
            age = tick - np.int64(world.orders.release_tick[order])
            out[w, i, 14] = min(max(age / 1024, 0.0), 1.0)
        out[w, i, 15] = episode.refused[i]


@kernel
def note_digests(world, episode, buffers, w, workspace):
    """Note the digests of the state, for the log."""
    digest_world(world, episode.digests)


def scene_of(
    grid: Any, channels: tuple[str, ...], radius: int, sight: int, facing: bool
) -> FloorScene:
    """The scene of a floor. `sight`: the radius of the circle that robots see, or NIL; `facing`: views
    are turned."""
    cells = np.arange(len(grid.kind))
    row, column = np.divmod(cells, grid.width)
    stride = grid.width + 2 * radius
    types = len(grid.type_headings)
    numbers = [list(CHANNELS).index(name) for name in channels]
    planes, following = [], 0
    for channel in numbers:
        planes.append(NIL if channel == CHANNEL_GOAL else following)
        following += 0 if channel == CHANNEL_GOAL else types if channel in CHANNELS_BY_TYPE else 1
    return FloorScene.sized(
        plane=((row + radius) * stride + column + radius).astype(np.int32),
        column=column.astype(np.int32),
        row=row.astype(np.int32),
        stride=stride,
        channels=np.array(numbers, np.int64),
        planes=np.array(planes, np.int64),
        types=types,
        sight=sight,
        turned_side=2 * radius + 1 if facing else 0,
    )


def first_planes(world: Any, scene: FloorScene, radius: int) -> Any:
    """(q, p) uint8: the planes of a world before its first tick; walls and ways are filled in."""
    grid = world.grid
    many = max(
        (
            int(plane) + (scene.types if channel in CHANNELS_BY_TYPE else 1)
            for plane, channel in zip(scene.planes, scene.channels, strict=True)
        ),
        default=0,
    )
    rows = len(grid.kind) // grid.width + 2 * radius
    planes = np.zeros((max(many, 1), rows * scene.stride), np.uint8)
    for first, channel in zip(scene.planes, scene.channels, strict=True):
        if channel not in (CHANNEL_WALLS, CHANNEL_WAYS):
            continue
        for kind in range(scene.types):
            if channel == CHANNEL_WALLS:
                planes[first + kind] = 1
                planes[first + kind, scene.plane] = world.slots.reachable[kind] == 0
            else:
                planes[first + kind, scene.plane] = grid.type_cell_flags[kind] & 15
    return planes


def whole_planes(world: Any, episode: Any) -> Any:
    """(k, C) uint8: what each channel shows of all cells, for robots of all types together."""
    scene = episode.scene
    out = np.zeros((len(scene.channels), len(scene.plane)), np.uint8)
    for row, first, channel in zip(out, scene.planes, scene.channels, strict=True):
        if channel == CHANNEL_GOAL:
            goals = world.robots.goal_cell
            row[goals[goals != NIL]] = 1
            continue
        many = scene.types if channel in CHANNELS_BY_TYPE else 1
        join = {CHANNEL_WALLS: np.minimum, CHANNEL_WAYS: np.bitwise_or}.get(channel, np.maximum)
        join.reduce(episode.planes[first : first + many, scene.plane], axis=0, out=row)
    return out
