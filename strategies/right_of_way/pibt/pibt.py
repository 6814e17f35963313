"""Priority inheritance with backtracking (PIBT; Okumura et al.) for robots whose actions take time.

In each tick robots choose where to go. Robots that have gone longest without finishing a visit choose
first; a robot in the way of another is pushed, and chooses next. Unlike in the published method, robots
turn, and turns, moves, picks and drops may take several ticks. Only free robots choose, and:

reserve while turning   a turning robot has reserved the cell to which it turns, and is leaving its own
wait for the busy       a robot may choose the cell of a working robot, plus the ticks until it is done
commit                  after a turn, the cell to which the robot turned comes first

With limited sight each robot decides for all robots that it sees, and follows its own part of the
decision. Robots publish their priorities (`robots.priority`), which every robot nearby sees.

A dead end admits one robot with a goal in it at a time; robots that leave a dead end go first.
"""

from typing import ClassVar

import numpy as np

from automaton.strategy.api import (
    ACTION_GATE,
    ACTION_TURN,
    CMD_GO,
    CMD_HOLD,
    FOLLOWING_CONVOY,
    GOAL_NONE,
    GOAL_PARK,
    KEEP,
    NIL,
    STATUS_UP,
    STOP_ON_TARGETS,
    Strategy,
    direction_between,
    gate_before,
    has_gates,
    is_facing,
    is_in_full_gate,
    is_in_own_queue,
    kernel,
    opens_soon,
    splitmix64,
)
from strategies.right_of_way.pibt.options import option_of, rank_all_options, turns_to
from strategies.right_of_way.pibt.pibt_state import (
    MODE_DECIDED,
    MODE_FIXED,
    MODE_LEAVING,
    MODE_UNDECIDED,
    STAY_OPTION,
    PibtState,
    U,
    aisles_of,
    clears_aisle,
    count_in_dead_ends,
    dead_ends_that_hold,
    empty_dead_ends,
    has_to_leave,
    holder_of,
    holds_both_lanes,
    is_across,
    is_lane_free,
    look_into_aisles,
    own_resource,
    reserve,
    reserve_ahead,
    reserve_other_lane,
    reserver_of,
    resource_in,
    waits_for_aisle,
)
from strategies.right_of_way.pibt.pushes import (
    NOT_ASKED,
    departs,
    direction_of,
    fetch_cells,
    holds_back,
    push,
)
from strategies.right_of_way.right_of_way_parameters import PibtParameters
from strategies.right_of_way.steering import (
    COUNTERS,
    Deadlocks,
    break_deadlocks,
    comes_to_charge,
    count_callers,
    guiding_tables,
    has_stood_long,
    has_work,
    is_at_goal,
    is_given_up,
    is_time_to_look,
    moves_against_streets,
    note_progress,
    round_of_stall,
    service_areas_of,
    way_to_make_room,
)

MAX_PRIORITY = 32_767
PREFETCH_DISTANCE = 8  # robots in the queue
STEPS_ASIDE = 0  # ranks of robots
LEAVES = 1
WORKS = 2
HAS_NOTHING = 3
RANKS = 4


@kernel
def decide(view, batch, decisions, memory, workspace):
    state = PibtState.of(memory)
    look_at_robots(view, batch, state)
    if view.rules.radius == NIL:
        update_queue(view, state)
        count = state.queue.shape[0]
    else:
        count = list_robots_in_sight(view, batch, decisions, state)
    decide_all(view, state, workspace, count)
    give_commands(view, batch, decisions, state)
    if view.rules.radius == NIL and is_time_to_look(view, state.deadlocks):
        look_for_deadlocks(view, state)


class Pibt(Strategy):
    """Robots make way by inherited priority (PIBT); turns and moves of any length."""

    layer = "right_of_way"
    Parameters = PibtParameters
    compiled = decide
    counters: ClassVar = COUNTERS
    holders = True
    steers = True
    period = 1

    def reset(self, view):
        """Return the state at the start of a run: the queue of robots begins in an order by hash.

        With limited sight the queue stays unused: robots use published priorities.
        """
        n, cells = len(view.robots.cell), len(view.grid.cell_flags)
        ends = dead_ends_that_hold(view.grid, n)
        is_one_shot = view.rules.stop == STOP_ON_TARGETS
        names = ("aisle", "aisle_depth", "aisle_way_out")
        aisles = dict(zip(names, aisles_of(view.grid, ends.number), strict=True))
        queue = np.zeros(n, np.int32)
        if view.rules.radius == NIL:
            seed = np.uint64(view.rules.seed)
            with np.errstate(over="ignore"):
                draws = [int(splitmix64(seed ^ np.uint64(robot))) for robot in range(n)]
            queue[:] = np.argsort(np.array(draws, np.uint64), kind="stable")
        waits = holds_back(view)
        guided = self.parameters.guidance == "lattice"
        against = moves_against_streets(view.grid) if guided else np.zeros((0, 4), bool)
        return PibtState.sized(
            {"n": n, "m": n + 1, "w": 4, "s": 1, "r": 2 * cells, "e": max(ends.total, 1)}
            | {"o": cells if is_one_shot else 0},
            **(aisles if is_one_shot else {}),
            dead_ends=ends.total,
            holds_back=int(waits),
            rings=int(not waits or view.rules.following == FOLLOWING_CONVOY),
            lanes=int((view.grid.cell_flags >> 5 & 3 == 2).any()),
            service_areas=service_areas_of(view),
            guided=int(guided),
            fixed_ties=int(self.parameters.ties == "fixed"),
            tables=guiding_tables(view, guided),
            against=against.astype(np.uint8),
            queue=queue,
            deadlocks=Deadlocks.sized({"n": n, "s": 1}, patience=self.parameters.deadlock_patience),
            dead_end=ends.number,
            way_out=ends.way_out,
            depth=ends.depth,
        )


# Participants.


@kernel
def look_at_robots(view, batch, state):
    """Find the robots that take part, the cells they move to, and the dead ends they need."""
    robots, limited = view.robots, view.rules.radius != NIL
    state.calls += 1
    empty_dead_ends(state)
    look_into_aisles(view, state)
    count_callers(view, state.service_areas)
    for i in range(robots.cell.shape[0]):
        # With limited sight the choices of other robots are not visible.
        sees_plans = not limited or i == batch.robot[0]
        state.mode[i] = MODE_FIXED
        state.begun[i] = state.turning[i] if sees_plans else 0
        state.departs[i] = NOT_ASKED
        if robots.cell[i] == NIL:
            continue
        look_where_it_goes(view, state, i)
        if state.dead_ends:
            count_in_dead_ends(view, state, i)
        if limited and robots.busy[i] == 0 and robots.status[i] == STATUS_UP:
            let_choose(view, state, i)
        if sees_plans:
            state.turning[i] = state.begun[i]
    for k in range(batch.count):
        let_choose(view, state, np.int64(batch.robot[k]))


@kernel
def look_where_it_goes(view, state, i):
    """Set and reserve the cell to which robot i moves or turns."""
    robots = view.robots
    cell, claim, begun = np.int64(robots.cell[i]), np.int64(robots.claim[i]), state.begun[i]
    state.next[i] = cell
    if claim != NIL and claim != cell:
        state.next[i] = claim
        state.mode[i] = MODE_LEAVING
    elif robots.busy[i] and robots.action[i] == ACTION_TURN and begun:
        state.next[i] = cell + view.grid.offset[begun - 1]
        state.mode[i] = MODE_LEAVING
        reserve_other_lane(view, state, i)
    elif robots.busy[i]:
        waits_at_gate = robots.action[i] == ACTION_TURN and has_gates(view)
        if waits_at_gate and view.rules.radius == NIL:  # it turns to the gate and keeps its cell
            reserve(state, own_resource(view, i), i)
        state.begun[i] = 0
    if state.lanes and claim in (NIL, cell) and holds_both_lanes(view, state, i):
        if is_lane_free(view, state, i):
            reserve_other_lane(view, state, i)
    if state.mode[i] == MODE_LEAVING:
        to = np.int64(state.next[i])
        reserve_ahead(view, state, i, to, direction_between(view.grid, cell, to))


@kernel
def let_choose(view, state, i):
    """Let free robot i choose, unless it is where it has work, or in the queue there."""
    if view.robots.cell[i] == NIL or not (is_at_goal(view, i) or is_in_own_queue(view, i)):
        state.mode[i] = MODE_UNDECIDED
    else:
        state.begun[i] = 0
        state.turning[i] = 0


# Order of choice.


@kernel
def update_queue(view, state):
    """Move robots that have finished a visit to the end of the queue.

    In a stall the robot at its head also moves there, once in each round. Then gates do not affect ranks:
    a robot that enters and fills a block would yield to the robots inside, and then push them back.
    """
    robots, queue = view.robots, state.queue
    remaining, moved, stall = 0, 0, np.int64(0)
    if may_stall(view, state):
        note_progress(view, state.deadlocks)
        stall = round_of_stall(view, state.deadlocks)
    for place in range(queue.shape[0]):
        identity = queue[place]
        i = np.int64(robots.at_index[identity])
        if has_finished(view, state, i):
            state.finished[moved] = identity
            moved += 1
        else:
            queue[remaining] = identity
            remaining += 1
    for place in range(moved):
        queue[remaining + place] = state.finished[place]
    if stall > max(state.stall[0], 1):
        first = queue[0]
        for place in range(queue.shape[0] - 1):
            queue[place] = queue[place + 1]
        queue[queue.shape[0] - 1] = first
    state.stall[0] = stall


@kernel
def may_stall(view, state):
    """Whether stalls are detected: if robots are held back or stopped by gates, and see all others."""
    return view.rules.radius == NIL and (has_gates(view) or state.holds_back)


@kernel
def has_finished(view, state, i):
    """Whether robot i has finished the work at its goal cell since the last check.

    A robot that lost the last tick at a full block also counts; otherwise it would push back robots that
    come out.
    """
    robots = view.robots
    before, cell = np.int64(state.aim_type[i]), np.int64(state.aim_cell[i])
    if before == robots.goal_type[i] and cell == robots.goal_cell[i]:
        is_kept = robots.action[i] == ACTION_GATE and is_beside_full_gate(view, i)
        return is_kept and state.stall[0] == 0
    state.aim_type[i], state.aim_cell[i] = robots.goal_type[i], robots.goal_cell[i]
    return has_work(view, before) and robots.cell[i] == cell


@kernel
def list_robots_in_sight(view, batch, decisions, state):
    """Add the robots that choose to the queue, by their published priorities; return their number.

    The deciding robot sees only its own times, and publishes them as its priority.
    """
    robots, own = view.robots, np.int64(batch.robot[0])
    if has_finished(view, state, own) or state.since[own] == 0:
        state.since[own] = view.clock.tick
    age = view.clock.tick - state.since[own]
    decisions.right_of_way.priority[0] = min(age, MAX_PRIORITY)
    count = 0
    for i in range(robots.cell.shape[0]):
        if state.mode[U(i)] == MODE_UNDECIDED:
            first = MAX_PRIORITY - np.int64(robots.priority[U(i)])
            state.in_sight[count] = (first << 32) | np.int64(robots.identity[U(i)])
            count += 1
    sort_words(state.in_sight, count)
    for place in range(count):
        state.queue[place] = state.in_sight[place] & 0xFFFFFFFF
    return count


@kernel
def sort_words(words, count):
    """Sort the first `count` words in place, in ascending order (heapsort)."""
    for k in range(count // 2):
        sift_down(words, count // 2 - 1 - k, count)
    for last in range(count - 1, 0, -1):
        words[0], words[last] = words[last], words[0]
        sift_down(words, 0, last)


@kernel
def sift_down(words, parent, count):
    while 0 <= parent < count // 2:
        child = 2 * parent + 1
        if child + 1 < count and words[child + 1] > words[child]:
            child += 1
        if words[parent] >= words[child]:
            return
        words[parent], words[child] = words[child], words[parent]
        parent = child


@kernel
def rank_of(view, state, i):
    """The rank of a robot: first, robots that make room, or leave a dead end or a full block.

    Last are robots that are idle or must not enter. A robot that waits for a door or lift ranks like one
    that leaves, so that it keeps its place: elsewhere its request would be useless.
    """
    robots = view.robots
    if state.deadlocks.aside[U(i)]:
        return STEPS_ASIDE
    if has_gates(view) and robots.cell[U(i)] != NIL and state.stall[0] == 0:
        if is_in_full_gate(view, robots.cell[U(i)]):
            return LEAVES
        gate = gate_that_keeps(view, state, i)
        if gate != NIL:
            return LEAVES if opens_soon(view, gate, i) else HAS_NOTHING
    if way_to_make_room(view, state.service_areas, i, robots.cell[U(i)]) != NIL:
        return LEAVES
    if clears_aisle(view, state, i):
        return LEAVES
    if waits_for_aisle(view, state, i):
        return HAS_NOTHING
    if state.dead_ends == 0:
        is_idle = robots.goal_type[U(i)] == GOAL_NONE or robots.goal_type[U(i)] == GOAL_PARK
        return HAS_NOTHING if is_idle and not has_work(view, robots.goal_type[U(i)]) else WORKS
    cell, goal = np.int64(robots.cell[i]), np.int64(robots.goal_cell[i])
    here = np.int64(NIL) if cell == NIL else np.int64(state.dead_end[cell])
    if has_to_leave(view, state, i):
        return LEAVES
    if robots.goal_type[i] == GOAL_NONE:
        return HAS_NOTHING
    there = np.int64(state.dead_end[goal])
    if here != NIL and here != there:
        return LEAVES
    must_wait = there != NIL and there != here and state.tenants[there] > 0
    is_idle = robots.goal_type[i] == GOAL_PARK and not has_work(view, robots.goal_type[i])
    return HAS_NOTHING if is_idle or must_wait else WORKS


@kernel
def gate_that_keeps(view, state, i):
    """The gate that keeps robot i out of its preferred cell, or NIL."""
    cell, option = np.int64(view.robots.cell[U(i)]), option_of(state, i, 0)
    if option >= STAY_OPTION:
        return np.int64(NIL)
    return gate_before(view, i, cell + view.grid.offset[U(option)])


@kernel
def is_beside_full_gate(view, i):
    """Whether a gate that will not open soon keeps robot i out of an adjacent cell."""
    cell = np.int64(view.robots.cell[U(i)])
    for direction in range(4):
        if (np.int64(view.grid.cell_flags[U(cell)]) >> direction) & 1:
            gate = gate_before(view, i, cell + view.grid.offset[U(direction)])
            if gate != NIL and not opens_soon(view, gate, i):
                return True
    return False


# Choices and commands.


@kernel
def decide_all(view, state, workspace, count):
    """Let the robots of the queue choose by rank, and within a rank by place."""
    rank_all_options(view, state, workspace)
    at_index = view.robots.at_index
    for place in range(count):
        i = np.int64(at_index[U(state.queue[U(place)])])
        state.rank[U(place)] = (
            rank_of(view, state, i) if state.mode[U(i)] == MODE_UNDECIDED else RANKS
        )
    for rank in range(RANKS):
        for place in range(count):
            if place + PREFETCH_DISTANCE < count:
                fetch_cells(
                    view, state, np.int64(at_index[U(state.queue[U(place + PREFETCH_DISTANCE)])])
                )
            if state.rank[U(place)] != rank:
                continue
            i = np.int64(at_index[U(state.queue[U(place)])])
            if state.mode[U(i)] == MODE_UNDECIDED:
                choose(view, state, i)


@kernel
def choose(view, state, i):
    if view.robots.cell[i] == NIL:
        leave_bay(view, state, i)
    else:
        push(view, state, i)


@kernel
def leave_bay(view, state, i):
    """Reserve the home cell for robot i, in its parking bay, and push the robot that is there."""
    robots = view.robots
    home = np.int64(robots.home[i])
    state.mode[i] = MODE_DECIDED
    state.next[i] = NIL
    if robots.goal_type[i] == GOAL_NONE or robots.goal_type[i] == GOAL_PARK:
        return
    resource = resource_in(view, home, np.int64(robots.heading[i]))
    if resource == NIL or gate_before(view, i, home) != NIL:
        state.next[i] = home
        return
    if reserver_of(state, resource) != NIL:
        return
    identity = np.int64(view.traffic.holder[home, resource // view.grid.cell_flags.shape[0]])
    if identity == NIL:
        reserve(state, resource, i)
        state.next[i] = home
        return
    holder = np.int64(robots.at_index[identity])
    if state.mode[holder] == MODE_UNDECIDED:
        reserve(state, resource, i)
        push(view, state, holder)


@kernel
def give_commands(view, batch, decisions, state):
    out, robots = decisions.right_of_way, view.robots
    for k in range(batch.count):
        i = np.int64(batch.robot[k])
        if state.mode[i] != MODE_DECIDED:
            continue
        cell, to = np.int64(robots.cell[U(i)]), np.int64(state.next[U(i)])
        state.turning[U(i)] = 0
        if cell == NIL:
            if robots.goal_type[i] != GOAL_NONE and robots.goal_type[i] != GOAL_PARK:
                out.command[k] = CMD_HOLD if to == NIL else CMD_GO
                out.value[k] = NIL if to == NIL else 0
        elif to != cell:
            direction = direction_of(state, i)
            out.command[U(k)] = CMD_GO
            out.value[U(k)] = direction
            if not is_facing(view, i, direction):
                state.turning[U(i)] = direction + 1
            elif state.holds_back and not departs(view, state, i):
                hold_back(view, state, out, k, i)
        elif turns_meanwhile(view, state, i):
            out.command[U(k)] = CMD_GO
            out.value[U(k)] = option_of(state, i, 0)
        elif state.asks[U(i)] and may_turn_to(view, state, i, np.int64(state.asks[U(i)]) - 1):
            out.command[U(k)] = CMD_GO
            out.value[U(k)] = state.asks[U(i)] - 1
        elif robots.goal_type[U(i)] != GOAL_NONE:
            out.command[k] = CMD_HOLD
            best = option_of(state, i, 0)
            out.value[k] = NIL if best >= STAY_OPTION else best


@kernel
def turns_meanwhile(view, state, i):
    """Whether robot i turns while it waits, since it stands across both lanes of a cell for two."""
    cell, heading = np.int64(view.robots.cell[U(i)]), np.int64(view.robots.heading[U(i)])
    best = option_of(state, i, 0)
    if best >= STAY_OPTION or turns_to(view, i, best) == 0:
        return False
    return is_across(view, state, i, cell, heading) and is_lane_free(view, state, i)


@kernel
def hold_back(view, state, out, k, i):
    """Let robot i wait for the holder of its chosen cell; it keeps the choice if the holder leaves."""
    direction = direction_of(state, i)
    to = np.int64(state.next[U(i)])
    u = holder_of(view, to, direction)
    if state.mode[U(u)] != MODE_FIXED:
        state.turning[U(i)] = direction + 1
    if comes_to_charge(view, i, to):
        return  # it queues there
    out.command[U(k)] = CMD_HOLD if view.robots.goal_type[U(i)] != GOAL_NONE else KEEP
    out.value[U(k)] = direction


@kernel
def may_turn_to(view, state, i, direction):
    """Whether robot i faces this direction, or may turn to it in its cell."""
    return is_facing(view, i, direction) or is_lane_free(view, state, i)


# Wait cycles.


@kernel
def look_for_deadlocks(view, state):
    """Find the blockers of robots that have stood for long, and break wait cycles."""
    for i in range(view.robots.cell.shape[0]):
        if state.mode[i] == MODE_DECIDED and has_stood_long(view, state.deadlocks, i):
            has_way_out = state.deadlocks.aside[i] and state.next[i] != view.robots.cell[i]
            if has_way_out and not is_given_up(view, state.deadlocks, i):
                continue
            enter_blocker(view, state, i)
            state.deadlocks.aside[i] = 0
    break_deadlocks(view, state.deadlocks)


@kernel
def enter_blocker(view, state, i):
    """Set the robot that is in robot i's preferred cell, or prevents the turn to it."""
    direction = option_of(state, i, 0)
    if state.deadlocks.aside[i]:
        direction = np.int64(state.deadlocks.aside[i]) - 1
    if direction >= STAY_OPTION:
        return
    cell, towards = np.int64(view.robots.cell[i]), direction
    if not may_turn_to(view, state, i, direction):
        towards = np.int64(view.robots.travel[i]) ^ 2
    else:
        cell += view.grid.offset[direction]
    u = holder_of(view, cell, towards)
    if u != NIL and u != i:
        state.deadlocks.blocker[i] = view.robots.identity[u]
        state.deadlocks.first_choice[i] = direction + 1
