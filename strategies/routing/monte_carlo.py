"""The Monte Carlo trial of Bhattathiri, Li & Kuhl: one robot is dispatched among active robots.

Robot 0 is dispatched; the others are active. Each drives from the access cell of a rack to a dock and
on to another rack, drawn uniformly by (seed, trial, robot). Picking and setting down take no time.
Two interpretations of a slow zone with c others:

    static     a move takes 1 + c ticks; c counts all others whose path uses the zone at any time
    dynamic    all begin at tick 0; c counts the others in the zone when the move starts
"""

import numpy as np

from automaton.strategy.api import (
    ACTION_MOVE,
    NIL,
    Array,
    Struct,
    cost_unit,
    field,
    kernel,
    random_between,
)
from strategies.routing.astar import search, write_steps
from strategies.routing.predicted_paths import (
    add_zones,
    blur,
    count_common,
    count_zones,
    delay_of,
    words,
)
from strategies.routing.traffic_avoidance import PLAIN_ASTAR, choose_threshold, close_zones

STREAM_TRIALS = 12  # of random draws; each stream has a number of its own

START, PICK, DROP = 0, 1, 2  # columns of a task

# Columns of the results: of plain A*, then of the chosen path.
TRIAL_TIME = 0  # ticks
TRIAL_DISTANCE = 1  # moves
TRIAL_ENCOUNTERS = 2  # others met in a zone: pairs of a zone and a robot
TRIAL_CHOSEN = 3  # the three again for the chosen path start here
TRIAL_ALTERNATIVE = 6  # 1 = the chosen path is not that of plain A*
TRIAL_COLUMNS = 7


class MonteCarloWorkspace(Struct):
    """Scratch of a trial of r robots; R steps of the longest task, Z zones."""

    task: Array = field("(r, 3) int32", "start, pick-up and drop-off cell")
    route: Array = field("(r, R) uint8", "directions of both legs")
    plain: Array = field("(R,) uint8", "robot 0's directions by plain A*")
    length: Array = field("(r,) int32")
    at: Array = field("(r,) int32", "steps driven")
    cell: Array = field("(r,) int32")
    busy: Array = field("(r,) int32", "ticks until it arrives")
    zone: Array = field("(r,) int32", "the zone it is in")
    met: Array = field("(r,) int32", "the zone in which it is now with robot 0")
    used: Array = field("(words,) int64", "zones of one path, a bit for each")
    actual: Array = field("(Z,) int32", "others with a path through each zone")


def monte_carlo_workspace(robots: int, steps: int, zones: int) -> MonteCarloWorkspace:
    """Scratch for trials of this number of robots; `steps`: at most, of both legs together."""
    return MonteCarloWorkspace.sized({"r": robots, "R": steps, "Z": zones, "words": words(zones)})


@kernel
def draw_tasks(seed, racks, docks, tasks):
    """tasks: (trials, r, 3) int32, the start, pick-up and drop-off cell of each robot.

    racks, docks: the cells from which each rack and each dock is served.
    """
    for number in range(tasks.shape[0]):
        for r in range(tasks.shape[1]):
            for k in range(3):
                cells = docks if k == PICK else racks
                last = cells.shape[0] - 1
                tasks[number, r, k] = cells[
                    random_between(0, last, seed, STREAM_TRIALS, number, 3 * r + k)
                ]


@kernel
def count_foreseen(grid, duration, workspace, trial, ties, seed, tasks, keep, add, foreseen):
    """foreseen: (trials, Z) int32, others whose plain A* path uses a zone, with the errors of `blur`."""
    for number in range(tasks.shape[0]):
        foreseen[number] = 0
        for r in range(1, tasks.shape[1]):
            use_zones(grid, duration, workspace, trial, ties, seed, tasks[number, r])
            blur(trial.used, grid.traffic_zone_count, keep, add, seed, number, r)
            count_zones(trial.used, foreseen[number])


@kernel
def run_trials(
    grid, duration, workspace, trial, ties, seed, tasks, foreseen, most, least_count, rule, dynamic,
    out,
):  # fmt: skip
    """out: (trials, TRIAL_COLUMNS) int64; robot 0 plans by the forecast and drives in the true traffic.

    tasks: (trials, r, 3) of `draw_tasks`; foreseen: (trials, Z), others in each zone; most,
    least_count, rule: of `choose_threshold`; dynamic: 1 for that interpretation.
    """
    for number in range(tasks.shape[0]):
        trial.actual[:] = 0
        for r in range(tasks.shape[1]):
            for k in range(3):
                trial.task[r, k] = tasks[number, r, k]
            if r > 0:
                use_zones(grid, duration, workspace, trial, ties, seed, tasks[number, r])
                count_zones(trial.used, trial.actual)
        for zone in range(workspace.count.shape[0]):
            workspace.count[zone] = foreseen[number, zone]
        row = out[number]
        run_trial(
            grid, duration, workspace, trial, ties, seed, most, least_count, rule, dynamic, row
        )


@kernel
def run_trial(grid, duration, workspace, trial, ties, seed, most, least_count, rule, dynamic, row):
    """row: (TRIAL_COLUMNS,) of the trial with trial.task, trial.actual and workspace.count."""
    start, pick, drop = trial.task[0, START], trial.task[0, PICK], trial.task[0, DROP]
    threshold = choose_threshold(
        grid, 0, duration, workspace, ties, seed, start, pick, drop, most, least_count, rule
    )
    close_zones(grid, workspace, threshold + least_count - 1, start, pick, drop)
    for column in (0, TRIAL_CHOSEN):
        avoid_zones = column == TRIAL_CHOSEN and threshold != PLAIN_ASTAR
        part = row[column : column + TRIAL_CHOSEN]
        if dynamic:
            drive_dynamic(grid, duration, workspace, trial, ties, seed, avoid_zones, part)
        else:
            drive_static(grid, duration, workspace, trial, ties, seed, avoid_zones, part)
        if column == 0:
            for k in range(trial.length[0]):
                trial.plain[k] = trial.route[0, k]
    row[TRIAL_ALTERNATIVE] = differs(trial, row[TRIAL_DISTANCE])


@kernel
def drive_static(grid, duration, workspace, trial, ties, seed, avoid_zones, row):
    """row[TRIAL_TIME, TRIAL_DISTANCE, TRIAL_ENCOUNTERS] of robot 0 by the static interpretation."""
    row[TRIAL_TIME] = plan_routes(grid, duration, workspace, trial, ties, seed, 0, avoid_zones)
    row[TRIAL_DISTANCE] = trial.length[0]
    row[TRIAL_ENCOUNTERS] = count_common(trial.used, trial.actual)


@kernel
def drive_dynamic(grid, duration, workspace, trial, ties, seed, avoid_zones, row):
    """row[TRIAL_TIME, TRIAL_DISTANCE, TRIAL_ENCOUNTERS] of robot 0 by the dynamic interpretation."""
    for r in range(1, trial.task.shape[0]):
        plan_routes(grid, duration, workspace, trial, ties, seed, r, False)
    plan_routes(grid, duration, workspace, trial, ties, seed, 0, avoid_zones)
    meet(grid, duration, trial, row)
    row[TRIAL_DISTANCE] = trial.length[0]


@kernel
def plan_routes(grid, duration, workspace, trial, ties, seed, r, avoid_zones):
    """trial.route[r] = the directions of both legs of robot r; return its ticks without other robots.

    Leaves the zones that it uses in trial.used.
    """
    trial.used[:] = 0
    trial.length[r] = 0
    ticks = 0
    pose = np.int64(trial.task[r, START])
    for k in (PICK, DROP):
        pose = search(grid, 0, duration, workspace, ties, seed, pose, trial.task[r, k], avoid_zones)
        ticks += workspace.state.cost
        ticks += cost_unit(grid) * delay_of(grid, duration, workspace, pose, trial.actual)
        add_zones(grid, workspace, pose, trial.used)
        begun = trial.length[r]
        trial.length[r] += write_steps(grid, workspace, pose, trial.route[r, begun:])
    return ticks


@kernel
def use_zones(grid, duration, workspace, trial, ties, seed, task):
    """trial.used = the zones of both legs of a task by plain A*."""
    trial.used[:] = 0
    pose = np.int64(task[START])
    for k in (PICK, DROP):
        pose = search(grid, 0, duration, workspace, ties, seed, pose, np.int64(task[k]), False)
        add_zones(grid, workspace, pose, trial.used)


@kernel
def meet(grid, duration, trial, row):
    """Drive all routes from tick 0 until robot 0 arrives; write its time and encounters to `row`.

    Robots in a zone are counted at the start of a tick, by the cell in which they stand or which they
    leave. A robot that has arrived leaves the floor. Two robots meet when both are in the same zone.
    """
    for r in range(trial.task.shape[0]):
        trial.cell[r] = trial.task[r, START]
        trial.at[r] = 0
        trial.busy[r] = 0
        trial.met[r] = NIL
    ticks = 0
    encounters = 0
    while trial.at[0] < trial.length[0]:
        for r in range(trial.task.shape[0]):
            trial.zone[r] = NIL
            if trial.at[r] < trial.length[r]:
                way = np.int64(trial.route[r, trial.at[r]])
                trial.zone[r] = grid.traffic_zone[trial.cell[r], way >> 1]
        here = trial.zone[0]
        for r in range(1, trial.task.shape[0]):
            together = here != NIL and trial.zone[r] == here
            encounters += together and trial.met[r] != here
            trial.met[r] = here if together else NIL
        go_on(grid, duration, trial)
        ticks += 1
    row[TRIAL_TIME] = ticks
    row[TRIAL_ENCOUNTERS] = encounters


@kernel
def go_on(grid, duration, trial):
    """Advance all moves by a tick; a new move takes as many ticks as there are robots in its zone."""
    for r in range(trial.task.shape[0]):
        if trial.at[r] >= trial.length[r]:
            continue
        if trial.busy[r] == 0:
            m = 0
            for other in range(trial.task.shape[0]):
                m += trial.zone[r] != NIL and trial.zone[other] == trial.zone[r]
            trial.busy[r] = max(m, 1) * duration[ACTION_MOVE]
        trial.busy[r] -= 1
        if trial.busy[r] == 0:
            trial.cell[r] += grid.offset[trial.route[r, trial.at[r]]]
            trial.at[r] += 1


@kernel
def differs(trial, length):
    """Whether robot 0's route differs from the plain one, which has this length."""
    if length != trial.length[0]:
        return 1
    for k in range(length):
        if trial.plain[k] != trial.route[0, k]:
            return 1
    return 0
