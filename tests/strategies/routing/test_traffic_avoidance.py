"""Traffic avoidance: what is predicted of the others, which plan is chosen, and how it is driven."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from example_counts import examples
from hypothesis import given, settings
from hypothesis import strategies as st
from random_legs import Case, cases
from reference_astar import path
from reference_paths import FAR, Ways

from automaton.commands import main
from automaton.engine.state import LAYER_ROUTING, NIL, Array
from automaton.floor.drawn_floors import draw_floor
from automaton.floor.traffic_zones import ZONE_MODES
from automaton.papers.traffic_trials import TRIAL_ROBOTS, tasks_of, warehouse
from automaton.runs.metrics import metrics_of
from automaton.runs.simulation import Simulation
from automaton.scenario.reading import read
from automaton.scenario.text_files import shipped
from automaton.scenario.unavailable_metrics import name_of
from automaton.strategy.lookup import STEERS, declares
from automaton.world.resolve import Resolved, resolve
from strategies.routing import monte_carlo, predicted_paths, traffic_avoidance
from strategies.routing.astar import LARGER_G

MOST = 4


@st.composite
def tasks(draw: Any) -> tuple[Case, int, list[int]]:
    """A leg, a pick-up cell on the way or NIL, and the others in each zone."""
    case = draw(cases())
    traffic_zone_count = case.built()[0].grid.traffic_zone_count
    pick = draw(st.sampled_from([NIL, *case.ways.cells()]))
    count = draw(
        st.lists(st.integers(0, MOST + 1), min_size=traffic_zone_count, max_size=traffic_zone_count)
    )
    return case, pick, count


def touching(case: Case, cell: int) -> set[int]:
    """The zones of a cell, and those beside it."""
    traffic_zone = case.built()[0].grid.traffic_zone
    cells = (cell, *case.ways.floor_plan.neighbours(cell))
    return {int(z) for one in cells for z in traffic_zone[one]} - {NIL}


def foreseen(case: Case, pick: int, count: list[int], closed: set[int]) -> int:
    """Ticks of both legs by A* in plain Python; FAR if there is no way."""
    traffic_zone = case.built()[0].grid.traffic_zone
    pairs = {
        (cell, way)
        for cell in case.ways.cells()
        for way in range(4)
        if int(traffic_zone[cell, way >> 1]) in closed
    }
    ticks, pose = 0, case.start
    for target in (pick, case.target):
        if target == NIL:
            continue
        leg = path(case.ways, pose, target, "larger_g", pairs)
        if leg is None:
            return FAR
        ticks += leg[0]
        for way in leg[1]:
            left = int(traffic_zone[pose[0], way >> 1])
            ticks += 0 if left == NIL else count[left] * case.ways.move
            pose = (case.ways.floor_plan.neighbours(pose[0])[way], way % case.ways.headings)
        assert pose[0] == target
    return ticks


@settings(max_examples=examples(80))
@given(tasks(), st.booleans())
def test_the_plan_of_least_foreseen_time_is_chosen(
    task: tuple[Case, int, list[int]], more_than: bool
) -> None:
    """With the zones of A or more others closed, or with those of more than A."""
    case, pick, count = task
    floor, duration, workspace = case.built()
    workspace.count[:] = count
    own = touching(case, case.start[0]) | touching(case, case.target)
    own |= set() if pick == NIL else touching(case, pick)
    times = {traffic_avoidance.PLAIN_ASTAR: foreseen(case, pick, count, set())}
    for threshold in range(1, MOST + 1):
        busy = {zone for zone, others in enumerate(count) if others >= threshold + more_than}
        times[threshold] = foreseen(case, pick, count, busy - own)
    arguments = (floor.grid.read_only(), 0, duration, workspace, LARGER_G, np.uint64(1))
    choices = (*arguments, case.start_pose(), pick, case.target, MOST, 1 + more_than)
    with np.errstate(over="ignore"):
        chosen = traffic_avoidance.choose_threshold(*choices, traffic_avoidance.LEAST_TIME)
        cautious = traffic_avoidance.choose_threshold(*choices, traffic_avoidance.MOST_CAUTIOUS)
    assert times[chosen] == min(times.values())
    assert (
        chosen == traffic_avoidance.PLAIN_ASTAR
        or times[chosen] < times[traffic_avoidance.PLAIN_ASTAR]
    )
    busiest = max(count, default=0) - more_than
    open_to = [one for one in range(1, 1 + min(MOST, busiest)) if times[one] < FAR]
    assert cautious == (open_to[0] if open_to else traffic_avoidance.PLAIN_ASTAR)


@pytest.mark.parametrize("mode", ZONE_MODES)
def test_a_robot_may_leave_the_intersection_where_it_stands(mode: str) -> None:
    """Everything is busy: what stays open are the three aisles that meet in the middle."""
    floor_plan = draw_floor(".......\n.##.##.\n.......")
    middle = floor_plan.cell(3, 0)
    case = Case(Ways(floor_plan, "omni", 1, 1), (middle, 0), middle, mode)
    floor, _, workspace = case.built()
    workspace.count[:] = 9
    traffic_avoidance.close_zones(
        floor.grid.read_only(), workspace, 1, case.start_pose(), NIL, middle
    )

    def is_open(x: int, y: int) -> bool:
        return not workspace.closed[floor.grid.traffic_zone[floor_plan.cell(x, y)][0]]

    assert is_open(2, 0) and is_open(1, 0) and is_open(4, 0) and is_open(3, 1)
    assert not is_open(0, 1) and not is_open(1, 2)


def size_of(used: Array) -> int:
    """How many zones are in a set."""
    return sum(int(word).bit_count() for word in used.astype(np.uint64))


def sets_of_the_warehouse(
    precision: float, recall: float, share: float = predicted_paths.USED_SHARE
) -> tuple[int, int, int]:
    """Zones used, of those predicted, and predicted in all, summed over the tasks of a seed.

    `share`: of the zones that a task uses, as the noise has it.
    """
    where = warehouse()
    used = found = right = 0
    with np.errstate(over="ignore"):
        for number, robots in enumerate(tasks_of(where, 1)):
            for r, task in enumerate(robots):
                arguments = (where.grid, where.duration, where.workspace, where.trial, LARGER_G)
                monte_carlo.use_zones(*arguments, np.uint64(1), task)
                truth, seen = where.trial.used.copy(), where.trial.used.copy()
                chance = predicted_paths.false_alarms(precision, recall, share)
                keep, add = (
                    round(recall * predicted_paths.CERTAIN),
                    round(chance * predicted_paths.CERTAIN),
                )
                predicted_paths.blur(
                    seen, where.grid.traffic_zone_count, keep, add, np.uint64(1), number, r
                )
                used += size_of(truth)
                found += size_of(seen)
                right += size_of(seen & truth)
    return used, right, found


@pytest.mark.parametrize(("precision", "recall"), [(0.40, 0.84), (0.05, 0.75), (1.0, 0.5)])
def test_noise_has_the_precision_and_recall_that_were_asked_for(
    precision: float, recall: float
) -> None:
    where = warehouse()
    tasks = len(tasks_of(where, 1)) * TRIAL_ROBOTS
    share = sets_of_the_warehouse(1, 1)[0] / (tasks * where.grid.traffic_zone_count)
    assert share == pytest.approx(predicted_paths.USED_SHARE, rel=0.08), (
        "that one is of random ties"
    )
    used, right, found = sets_of_the_warehouse(precision, recall, share)
    assert right / used == pytest.approx(recall, abs=0.015)  # 16,000 zones: sd 0.004
    assert right / found == pytest.approx(precision, abs=0.01)


def test_certain_predictions_are_the_zones_themselves() -> None:
    used, right, found = sets_of_the_warehouse(1, 1)
    assert used == right == found


# A brings a load from left to right; B's task leads through the upper aisle and nowhere else.
RING = """
##d#####s##
#.......B.#
sA#######.d
#.........#
"""


def ring(tmp_path: Path, routing: str, picture: str = RING) -> Resolved:
    """Omnidirectional robots with these two orders; robot B's is left out if B is."""
    rows = "\n".join(f"    {row}" for row in picture.strip("\n").split("\n"))
    second = ", {from: [8, 0], to: [2, 0]}" if "B" in picture else ""
    scenario = tmp_path / "ring.yaml"
    scenario.write_text(
        f"name: ring\nlayout:\n  picture: |\n{rows}\n"
        f"fleet: {{kinematics: omni, robots: {1 + picture.count('B')}}}\n"
        f"orders: {{list: [{{from: [0, 2], to: [10, 2]}}{second}]}}\n"
        "stop: {when: delivered, max_duration: 500}\n"
    )
    return resolve(str(scenario), [f"strategy.routing={routing}"])


def loaded(resolved: Resolved) -> Simulation:
    """Run until robot A has its load and a route with it."""
    simulation = Simulation(resolved)
    robots = simulation.world.robots
    while robots.load[0] == NIL or robots.route_length[0] == 0:
        simulation.run(simulation.tick + 1)
    return simulation


def route(simulation: Simulation) -> str:
    """Robot A's route as letters."""
    robots = simulation.world.robots
    return "".join("ESWN"[way] for way in robots.route[0, : robots.route_length[0]])


def test_a_robot_keeps_out_of_the_aisle_that_another_one_needs(tmp_path: Path) -> None:
    assert route(loaded(ring(tmp_path, "astar"))) == "NEEEEEEEES"
    assert route(loaded(ring(tmp_path, "traffic-avoidance"))) == "SEEEEEEEEN"


def test_so_nobody_is_in_anybodys_way(tmp_path: Path) -> None:
    lost = {}
    for routing in ("astar", "traffic-avoidance"):
        simulation = Simulation(ring(tmp_path, routing))
        simulation.run()
        assert simulation.finished
        lost[routing] = metrics_of(simulation)["blocked_share"]
    assert lost["astar"] > 0 == lost["traffic-avoidance"]


@pytest.mark.parametrize("information", ["everything", "{radius: 9}"])
def test_alternatives_are_counted(tmp_path: Path, information: str) -> None:
    for routing, alternatives in (("traffic-avoidance", 1), ("astar", None)):
        ring(tmp_path, routing)
        settings = [f"strategy.routing={routing}", f"information={information}"]
        simulation = Simulation(resolve(tmp_path / "ring.yaml", settings))
        simulation.run()
        assert metrics_of(simulation).get("alternative_routes") == alternatives


def fleet(routing: str) -> dict[str, float | int]:
    """The first 200 ticks of 100 robots in the warehouse."""
    settings = ["fleet.robots=100", "stop.max_duration=200", "measure.warm_up=0"]
    simulation = Simulation(resolve("warehouse-100", [*settings, f"strategy.routing={routing}"]))
    simulation.run()
    return {**metrics_of(simulation), "digest": int(simulation.digest, 16)}


def test_a_noisy_crowd_leaves_no_alternative_up_to_six_others() -> None:
    """About eleven others are predicted in a zone, so every zone that is not its own is closed."""
    noisy = "{name: traffic-avoidance, predictor: noisy, precision: 0.4, recall: 0.84%s}"
    plain, six, twenty = (
        fleet(name) for name in ("astar", noisy % "", noisy % ", max_threshold: 20")
    )
    assert six["alternative_routes"] == 0 and six["digest"] == plain["digest"]
    assert twenty["alternative_routes"] > 50


def test_the_noise_is_that_of_the_trials() -> None:
    """Whatever the zones of a task: the chances are those of precision, recall and the mean share."""
    noisy = "{name: traffic-avoidance, predictor: noisy, precision: 0.4, recall: 0.84%s}"
    chances = []
    for more in ("", ", prevalence: 0.25"):
        resolved = resolve("warehouse-100", [f"strategy.routing={noisy % more}"])
        state = Simulation(resolved).states[LAYER_ROUTING]
        noise = np.array([state.keep_chance, state.add_chance])
        chances.append(noise / predicted_paths.CERTAIN)
    share = 27.5 / 522
    assert chances[0] == pytest.approx([0.84, 0.84 * share * 0.6 / (0.4 * (1 - share))])
    assert chances[1] == pytest.approx([0.84, 0.84 * 0.25 * 0.6 / (0.4 * 0.75)])


LONG_WAY_TO_ITS_LOAD = RING.replace("A", ".") + "#.#########\n" * 20 + "#A#########"


def test_both_legs_are_planned_when_the_task_begins(tmp_path: Path) -> None:
    """When A has its load B is long gone, but A's second leg was planned before it set out."""
    planned = loaded(ring(tmp_path, "traffic-avoidance", LONG_WAY_TO_ITS_LOAD))
    assert route(planned) == "SEEEEEEEEN"
    assert planned.world.robots.parked[1]
    alone = loaded(ring(tmp_path, "traffic-avoidance", LONG_WAY_TO_ITS_LOAD.replace("B", ".")))
    assert route(alone) == "NEEEEEEEES"


# Where right of way steers, robots follow no routes.
ROUTED = [
    name
    for name in shipped()
    if not declares("right_of_way", name_of(read(name).data["strategy"]["right_of_way"]), STEERS)
]


@pytest.mark.parametrize("information", ["everything", "orders", "{radius: 3}"])
@pytest.mark.parametrize("routing", ["astar", "traffic-avoidance"])
@pytest.mark.parametrize("name", ROUTED)
def test_every_scenario_is_driven_to_its_end(name: str, routing: str, information: str) -> None:
    """However its robots are stored: with their identities reversed it is the same run."""
    settings = [f"strategy.routing={routing}", f"information={information}"]
    if name.startswith("depots") and information != "everything":
        settings.append("strategy.allocation=first-come")  # auctions need to see everything
    if resolve(name).strategies["zoning"].name == "annealing" and information != "everything":
        settings.append("strategy.zoning=decentralized")  # and so does annealing
    resolved = resolve(name, settings)
    digests = set()
    for step in (1, -1):
        identities = np.arange(resolved.scenario.fleet.robots, dtype=np.int32)[::step]
        simulation = Simulation(resolved, storage=identities)
        simulation.run()
        assert simulation.finished or resolved.scenario.stop.when == "never"
        assert simulation.world.tally.illegal[LAYER_ROUTING] == 0
        digests.add(simulation.digest)
    assert len(digests) == 1


def test_what_is_foreseen_of_a_robot_is_what_it_drives() -> None:
    """Alone in the warehouse: the zones of both legs of its first task, predicted in tick 1."""
    settings = ["fleet.robots=1", "strategy.routing=traffic-avoidance"]
    simulation = Simulation(resolve("warehouse-100", settings))
    world = simulation.world
    cells = [int(world.robots.cell[0])]
    simulation.run(1)
    used = simulation.states[LAYER_ROUTING].predicted[0].copy()
    while world.orders.delivered[0] == NIL:
        cells.append(int(world.robots.cell[0]))
        simulation.run(simulation.tick + 1)
    foreseen = {
        zone
        for zone in range(world.grid.traffic_zone_count)
        if predicted_paths.has_zone(used, zone)
    }
    assert len(cells) > 50
    assert foreseen == {int(world.grid.traffic_zone[cell, 0]) for cell in cells} - {NIL}


@pytest.mark.parametrize(
    ("routing", "sentence"),
    [
        ("{name: traffic-avoidance, predictor: noisy}", "needs precision and recall"),
        ("{name: traffic-avoidance, recall: 0.5}", "are for predictor: noisy only"),
        ("{name: traffic-avoidance, prevalence: 0.5}", "are for predictor: noisy only"),
        ("{name: traffic-avoidance, predictor: exakt}", "did you mean 'exact'"),
        ("{name: astar, tie_break: filo}", "did you mean 'fifo'"),
    ],
)
def test_bad_parameters_are_one_sentence(
    routing: str, sentence: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["run", "tabletop-mini", "--set", f"strategy.routing={routing}"]) == 2
    errors = capsys.readouterr().err
    assert sentence in errors and errors.count("\n") == 1
