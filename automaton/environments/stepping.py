"""The compiled driver: it takes many worlds from the learner's layer in one tick to the same place in
the next, and fills the buffers of an environment.

    actions enter -> later layers, motion -> rewards -> faults, orders, stations, earlier layers
                  -> masks, observations

Each world is a row of addresses; nothing is allocated, and the interpreter is not needed.
"""

from functools import cache
from typing import Any, Final

import numpy as np
from numba import types

from automaton.engine.batches import decide_signature
from automaton.engine.features import FEATURES, signature
from automaton.engine.jit.kernel import jit_is_on
from automaton.engine.jit.struct_types import declared_type, function_at, struct_at
from automaton.engine.loop import PHASES, close_tick, open_tick, serve_layer
from automaton.engine.observation import Observation
from automaton.engine.state import STRATEGY_COUNT, Record
from automaton.environments.external import ACT_COUNTS, ACT_NONE, EnteredActions, U, allowed_actions
from automaton.strategy.api import (
    ACTION_BLOCKED,
    ACTION_GATE,
    BATTERY_FULL,
    NIL,
    ORDER_DELIVERED,
    Array,
    Batch,
    Decisions,
    Memory,
    NamedNumbers,
    Struct,
    Workspace,
    World,
    field,
    kernel,
    number,
)

LEARNER_PHASE: Final = PHASES - 1  # entry of LAYER_SEQUENCE: right of way
MAX_DECISION_TICKS: Final = 1000  # of a step that waits for a robot to act

# What a world does in the next step: episodes.state.
STATE_NEW: Final = 0  # its first tick begins
STATE_RUNNING: Final = 1
STATE_ENDED: Final = 2
STATE_STOPPED: Final = 3  # the memory for distance tables is used up, or the run was interrupted

# Components of rewards, in the order of their weights.
REWARDS: Final = {
    "delivered": "orders that the robot ended",
    "team": "orders that ended in its world, divided by the number of robots",
    "picked": "loads and pods that it picked up",
    "nearer": "ticks by which its goal came nearer on the empty floor; 0 when the goal changed",
    "blocked": "ticks that it lost to refused moves",
    "invalid": "actions against the mask",
    "energy": "charge used, as a share of a full battery",
    "tick": "1 for each tick",
}
(
    REWARD_DELIVERED,
    REWARD_TEAM,
    REWARD_PICKED,
    REWARD_NEARER,
    REWARD_BLOCKED,
    REWARD_INVALID,
    REWARD_ENERGY,
    REWARD_TICK,
) = range(len(REWARDS))
FEATURE_COUNT: Final = 16


class StepBuffers(Struct):
    """What an environment shows and takes: W worlds of n robots, a actions, o values of a window."""

    actions: Array = field("(W, n) int32", "action of each robot")
    observations: Array = field("(W, n, o) uint8", "windows, channel by channel, row by row")
    features: Array = field("(W, n, f) float32", "features of each robot")
    masks: Array = field("(W, n, a) int8", "1 = allowed")
    acting: Array = field("(W, n) uint8", "1 = the action of the robot will count")
    elapsed: Array = field("(W, n) int32", "ticks since the robot last acted")
    rewards: Array = field("(W, n) float32", "rewards of the step")
    terminations: Array = field("(W, n) bool", "the stop condition holds")
    truncations: Array = field("(W, n) bool", "the episode has lasted max_ticks")
    seeds: Array = field("(W,) uint64", "seed of the episode")
    ticks: Array = field("(W,) int64", "ticks executed in the episode")
    invalid: Array = field("(W,) int64", "actions so far against the mask")


class FloorScene(Struct):
    """What all worlds of an environment have in common: C cells, k channels.

    A plane is the floor with a margin, so that windows never end outside it.
    """

    plane: Array = field("(C,) int32", "place of a cell in a plane")
    column: Array = field("(C,) int32", "column of a cell")
    row: Array = field("(C,) int32", "row of a cell")
    stride: int = field("int64", "length of a row of a plane")
    channels: Array = field("(k,) int64", "what each channel shows: a number of CHANNELS")
    planes: Array = field("(k,) int64", "its plane, for the first type of robots; NIL: none")
    types: int = field("int64", "types of robots, with and without loads")
    sight: int = field("int64", "radius of a circle that robots see, in cells; NIL: no circle")
    turned_side: int = field(
        "int64", "side of windows that are turned: ahead is up; 0: north is up"
    )


class Episode(Struct):
    """What the driver remembers of a world, n robots; q planes of p places."""

    allowed: Array = field("(n,) int64", "allowed actions, as bits")
    order: Array = field("(n,) int32", "order before the tick, or NIL", default=NIL)
    load: Array = field("(n,) int32", "load before the tick, or NIL", default=NIL)
    blocked: Array = field("(n,) int64", "ticks lost to refused moves so far")
    refused: Array = field("(n,) uint8", "1 = its move was refused in the last tick")
    energy: Array = field("(n,) int64", "charge used so far")
    goal: Array = field("(n,) int32", "goal cell to which `distance` is, or NIL", default=NIL)
    pose: Array = field("(n,) int64", "pose from which `distance` is, or NIL", default=NIL)
    distance: Array = field("(n,) int32", "ticks to the goal on the empty floor")
    nearer: Array = field("(n,) int32", "ticks by which an unchanged goal came nearer")
    planes: Array = field("(q, p) uint8", "planes of channels, by type where types differ")
    robots: Array = field("(p,) uint8", "robots that have a place as cell or claim")
    cell: Array = field("(n,) int32", "place of its cell when last shown, or NIL", default=NIL)
    claim: Array = field("(n,) int32", "place of its claim, or NIL", default=NIL)
    revision: Array = field("(1,) int64", "clock.revision of planes of orders", default=NIL)
    digests: Array = field("(d,) uint64", "digests of the state after its last tick, if logged")
    scene: FloorScene


class Course(NamedNumbers):
    """How all worlds of an environment are stepped."""

    robots: int = number("robots of a world")
    actions: int = number("number of actions")
    drive: int = number("FREE or GUIDED, and the action `handle`")
    until_acting: int = number("1: a step lasts until a robot acts; 0: a tick")
    max_ticks: int = number("ticks after which an episode is truncated")
    measures: int = number("1: distances to goals are kept up to date")
    counts_losses: int = number("1: refused moves and charge are counted")


class Stepper(Struct):
    """Everything that the driver reads: W worlds of k addresses, s strategies, f features."""

    course: Course = field(Course)
    addresses: Array = field("(W, k) int64", "addresses of the structs of a world")
    functions: Array = field("(g, 2) int64", "words of functions: strategies, features, views")
    mode: Array = field("(s,) uint8", "how each strategy decides")
    used: Array = field("(f,) uint8", "whether a feature is called")
    weights: Array = field("(r,) float64", "weight of each component of rewards")
    state: Array = field("(W,) int64", "what each world does next: STATE_*")
    buffers: StepBuffers


# The structs of a world, in the order of its addresses; then the memories of its strategies.
WORLD_STRUCTS: Final = (
    *((World, True), (World, True), (World, False), (Record, True), (Batch, True), (Batch, True)),
    *((Batch, False), (Decisions, True), (Observation, True), (Observation, True)),
    *((EnteredActions, True), (Episode, True)),
)
(
    world_at, visible_world_at, view_at, record_at, full_batch_at, batch_at,
    batch_view_at, decisions_at, observation_at, watch_at, actions_at, episode_at,
) = (struct_at(*shape) for shape in WORLD_STRUCTS)  # fmt: skip
memory_at, stepper_at, workspace_at = (struct_at(one, True) for one in (Memory, Stepper, Workspace))
ADDRESS_COUNT: Final = len(WORLD_STRUCTS) + STRATEGY_COUNT


@cache
def view_signature() -> Any:
    """The types of the arguments of a kernel that fills a buffer: observations or features."""
    shown = declared_type(World), declared_type(Episode), declared_type(StepBuffers)
    return types.void(*shown, types.int64, declared_type(Workspace)) if jit_is_on() else None


DECIDE = decide_signature() if jit_is_on() else None
# The functions that a world calls, in the order of their words: strategies, features, views.
(
    zoning_strategy_at, charging_strategy_at, allocation_at, routing_at, right_of_way_at,
    allocation_2_at, allocation_3_at, allocation_4_at,
) = (function_at(row, DECIDE) for row in range(STRATEGY_COUNT))  # fmt: skip
(
    faults_at, delays_at, gates_at, trips_at, stations_at, visits_at, move_ticks_at, battery_at,
    sight_at, zoning_at, charging_at, recording_at, observing_at, deadlocks_at,
) = (
    function_at(row, signature(one) if jit_is_on() else None)
    for row, one in enumerate(FEATURES, STRATEGY_COUNT)
)  # fmt: skip
FIRST_VIEW: Final = STRATEGY_COUNT + len(FEATURES)
fill_windows_at, fill_features_at, measure_distances_at, note_digests_at, turn_views_at = (
    function_at(row, view_signature()) for row in range(FIRST_VIEW, FIRST_VIEW + 5)
)


# One world.


@kernel
def step_world(stepper, workspace, w):
    """Step world w until its learner is asked again, or its episode ends."""
    row = stepper.addresses[w]
    world, episode = world_at(row[0]), episode_at(row[11])
    if stepper.state[w] == STATE_ENDED or stepper.state[w] == STATE_STOPPED:
        clear_rewards(stepper, w)
        return
    let_tables_go(workspace)
    is_first = stepper.state[w] == STATE_NEW
    begin_step(stepper, episode, actions_at(row[10]), w, is_first)
    for _ in range(MAX_DECISION_TICKS):
        if not is_first:
            if not serve(stepper, workspace, w, LEARNER_PHASE):
                return
            end_tick(stepper, world, episode, workspace, w, 1)
        is_first = False
        if not begin_tick(stepper, world, episode, workspace, w):
            return
        is_acting = note_allowed(stepper, world, episode, w)
        if is_acting or stepper.state[w] == STATE_ENDED or stepper.course.until_acting == 0:
            break
    show_world(stepper, world, episode, workspace, w)
    begun = 1 if stepper.state[w] == STATE_RUNNING else 0
    stepper.buffers.ticks[w] = world.clock.tick - begun


@kernel
def let_tables_go(workspace):
    """Worlds share a workspace: the tables that a tick of another world keeps may be replaced."""
    for tables in (workspace.tables, workspace.streets):
        if 0 < tables.status.rows <= tables.entries.shape[0] * tables.drivable.shape[0]:
            tables.kept_in[:] = NIL


@kernel
def clear_rewards(stepper, w):
    """A world that stands still earns nothing."""
    stepper.buffers.rewards[w] = 0.0
    stepper.buffers.elapsed[w] = 0


@kernel
def begin_step(stepper, episode, entered, w, is_first):
    """Take the actions of world w over, and count those against the mask; they are not executed."""
    buffers, invalid = stepper.buffers, stepper.weights[REWARD_INVALID]
    count, refused = stepper.course.actions, 0
    entered.are_checked = 1
    for i in range(stepper.course.robots):
        action, allowed = np.int64(buffers.actions[U(w), U(i)]), episode.allowed[U(i)]
        if is_first or allowed & ACT_COUNTS:
            buffers.elapsed[U(w), U(i)] = 0
            buffers.rewards[U(w), U(i)] = 0.0
        elif stepper.course.until_acting == 0:
            buffers.rewards[U(w), U(i)] = 0.0
        if is_first:
            buffers.terminations[w, i] = buffers.truncations[w, i] = False
        elif action < 0 or action >= count or allowed >> action & 1 == 0:
            action = np.int64(0)
            refused += 1
            buffers.rewards[U(w), U(i)] += invalid
        entered.actions[U(i)] = action if allowed & ACT_COUNTS else ACT_NONE
    buffers.invalid[w] += refused


@kernel
def begin_tick(stepper, world, episode, workspace, w):
    """Begin ticks of world w until its learner is asked or its episode ends; returns whether the run
    goes on."""
    words, record = stepper.functions, record_at(stepper.addresses[w, 3])
    if stepper.state[w] == STATE_NEW:
        stepper.state[w] = STATE_RUNNING
    while stepper.state[w] == STATE_RUNNING:
        begins = open_tick(
            world, record, workspace, stepper.used,
            faults_at(words), delays_at(words), gates_at(words), trips_at(words),
            stations_at(words),
        )  # fmt: skip
        if begins:
            goes_on = True
            for phase in range(LEARNER_PHASE):
                goes_on = goes_on and serve(stepper, workspace, w, phase)
            return goes_on
        end_tick(stepper, world, episode, workspace, w, 0)
    return True


@kernel
def end_tick(stepper, world, episode, workspace, w, begins):
    """Move, add the rewards of the tick, and end the episode if it is over."""
    for i in range(world.robots.cell.shape[0]):
        episode.order[U(i)] = world.robots.order[U(i)]
        episode.load[U(i)] = world.robots.load[U(i)]
    close(stepper, w, begins)
    add_rewards(stepper, world, episode, workspace, w)
    if episode.digests.shape[0]:
        note_digests_at(stepper.functions)(world, episode, stepper.buffers, w, workspace)
    actions_at(stepper.addresses[w, 10]).actions[:] = ACT_NONE
    if world.clock.finished or world.clock.tick >= stepper.course.max_ticks:
        stepper.state[w] = STATE_ENDED
        stepper.buffers.terminations[w] = world.clock.finished != 0
        stepper.buffers.truncations[w] = world.clock.finished == 0


@kernel
def serve(stepper, workspace, w, phase):
    """Ask one layer of world w; returns whether the run goes on."""
    row, words = stepper.addresses[w], stepper.functions
    world = world_at(row[0])
    asked = (
        world, visible_world_at(row[1]), record_at(row[3]), full_batch_at(row[4]), batch_at(row[5]),
        decisions_at(row[7]),
    )  # fmt: skip
    of_layers = (
        stepper.used, zoning_at(words), charging_at(words), sight_at(words),
        recording_at(words),
    )  # fmt: skip
    decide = (
        zoning_strategy_at(words), charging_strategy_at(words), allocation_at(words),
        routing_at(words), right_of_way_at(words), allocation_2_at(words), allocation_3_at(words),
        allocation_4_at(words),
    )  # fmt: skip
    memories = (
        memory_at(row[12]), memory_at(row[13]), memory_at(row[14]), memory_at(row[15]),
        memory_at(row[16]), memory_at(row[17]), memory_at(row[18]), memory_at(row[19]),
    )  # fmt: skip
    goes_on = serve_layer(
        asked, of_layers, view_at(row[2]), batch_view_at(row[6]), decide, memories, workspace,
        stepper.mode, phase,
    )  # fmt: skip
    if not goes_on:
        stepper.state[w] = STATE_STOPPED
    return goes_on


@kernel
def close(stepper, w, begins):
    """Motion of world w."""
    row, words = stepper.addresses[w], stepper.functions
    close_tick(
        world_at(row[0]), record_at(row[3]), batch_at(row[5]), decisions_at(row[7]),
        observation_at(row[8]), watch_at(row[9]), stepper.used, begins,
        gates_at(words), trips_at(words), visits_at(words), move_ticks_at(words),
        battery_at(words), recording_at(words), observing_at(words),
        deadlocks_at(words),
    )  # fmt: skip


# Rewards: what a tick has changed, before the next one begins.


@kernel
def add_rewards(stepper, world, episode, workspace, w):
    """Add the rewards of a tick, and its ticks."""
    buffers, weights, robots = stepper.buffers, stepper.weights, world.robots
    ended = 0
    for i in range(robots.cell.shape[0]):
        order, load = np.int64(episode.order[U(i)]), np.int64(robots.load[U(i)])
        reward = weights[REWARD_TICK]
        is_over = order != robots.order[U(i)] and order != NIL
        if is_over and world.orders.state[U(order)] == ORDER_DELIVERED:
            reward += weights[REWARD_DELIVERED]
            ended += 1
        if load != NIL and load != episode.load[U(i)]:
            reward += weights[REWARD_PICKED]
        buffers.rewards[U(w), U(i)] += reward
        buffers.elapsed[U(w), U(i)] += 1
    if stepper.course.counts_losses:
        add_losses(stepper, world, episode, w)
    if ended and weights[REWARD_TEAM] != 0.0:
        for i in range(robots.cell.shape[0]):
            buffers.rewards[w, i] += weights[REWARD_TEAM] * ended / robots.cell.shape[0]
    if weights[REWARD_NEARER] != 0.0:
        measure_distances_at(stepper.functions)(world, episode, buffers, w, workspace)
        for i in range(robots.cell.shape[0]):
            buffers.rewards[w, i] += weights[REWARD_NEARER] * episode.nearer[i]


@kernel
def add_losses(stepper, world, episode, w):
    """Add the rewards for refused moves and for charge."""
    buffers, weights = stepper.buffers, stepper.weights
    for i in range(world.robots.cell.shape[0]):
        blocked = lost_to_refusals(world, i)
        episode.refused[i] = blocked > episode.blocked[i]
        used = np.int64(world.tally.energy_used[i])
        reward = weights[REWARD_BLOCKED] * (blocked - episode.blocked[i])
        reward += weights[REWARD_ENERGY] * ((used - episode.energy[i]) / BATTERY_FULL)
        episode.blocked[i], episode.energy[i] = blocked, used
        buffers.rewards[w, i] += reward


@kernel
def lost_to_refusals(world, i):
    """Ticks that robot i has lost to refused moves."""
    ticks = world.tally.ticks
    blocked = ticks[i, ACTION_BLOCKED, 0] + ticks[i, ACTION_BLOCKED, 1]
    return blocked + ticks[i, ACTION_GATE, 0] + ticks[i, ACTION_GATE, 1]


# What robots may do, and what they see.


@kernel
def note_allowed(stepper, world, episode, w):
    """Fill in the masks of world w; returns whether an action will count."""
    buffers, actions = stepper.buffers, stepper.course.actions
    is_over = stepper.state[w] == STATE_ENDED
    any_acting = np.int64(0)
    for i in range(world.robots.cell.shape[0]):
        allowed = np.int64(1) if is_over else allowed_actions(world, stepper.course.drive, i)
        episode.allowed[U(i)] = allowed
        for action in range(actions):
            buffers.masks[U(w), U(i), U(action)] = allowed >> action & 1
        buffers.acting[U(w), U(i)] = 1 if allowed & ACT_COUNTS else 0
        any_acting |= allowed
    return any_acting & ACT_COUNTS != 0


@kernel
def show_world(stepper, world, episode, workspace, w):
    """Fill in observations and features of world w."""
    buffers, words = stepper.buffers, stepper.functions
    if stepper.course.measures:
        measure_distances_at(words)(world, episode, buffers, w, workspace)
    if buffers.observations.shape[2]:
        fill_windows_at(words)(world, episode, buffers, w, workspace)
    if buffers.features.shape[2]:
        fill_features_at(words)(world, episode, buffers, w, workspace)
    if episode.scene.turned_side:
        turn_views_at(words)(world, episode, buffers, w, workspace)


def step_worlds(address, workspace_address, first, last):
    """Step the worlds from `first` up to, not including, `last`."""
    stepper, workspace = stepper_at(address), workspace_at(workspace_address)
    for w in range(first, last):
        step_world(stepper, workspace, w)


def step_in_python(*addresses):
    """The same without the compiler, where NumPy would warn of hashes that wrap."""
    with np.errstate(over="ignore"):
        step_worlds(*addresses)


@cache
def compiled_driver():
    """The driver; compiled or loaded once per process."""
    if not jit_is_on():
        return step_in_python
    return kernel(step_worlds, signature=types.void(*[types.int64] * 4))
