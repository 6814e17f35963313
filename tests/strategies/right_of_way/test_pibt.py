"""PIBT: who makes way for whom, and that everybody gets through."""

from __future__ import annotations

from itertools import pairwise, product
from textwrap import dedent

import numpy as np
import pytest
from drawn_scenes import scene
from lane_trials import starved
from small_runs import SmallRun

from automaton.engine.distance_tables import UNREACHABLE
from automaton.engine.state import (
    ACTION_DROP,
    ACTION_MOVE,
    ACTION_PICK,
    ACTION_WAIT,
    GOAL_CHARGE,
    GOAL_NONE,
    LAYER_RIGHT_OF_WAY,
)
from automaton.engine.table_rows import cost_in
from automaton.errors import InputError
from automaton.runs.simulation import Simulation
from automaton.scenario.schema import Durations, Fault, Faults
from automaton.world.resolve import resolve
from strategies.right_of_way.pibt.pibt import Pibt

GOAL = GOAL_CHARGE  # where there is no charger, a robot simply stays there


def drive(picture, ticks=40, **options):
    """Robots with goals by name (A=(x, y)); returns the run and, by robot, the tick of its arrival.

    `busy`: ticks for which robots work at the start; `parked`: robots that are at home then.
    """
    goals = {name: options.pop(name) for name in list(options) if name.isupper()}
    busy, parked = options.pop("busy", {}), options.pop("parked", "")
    run = SmallRun(picture, strategies={"right_of_way": Pibt()}, **options)
    robots = run.world.robots
    for name, cell in goals.items():
        robots.goal_type[run.index(name)] = GOAL
        robots.goal_cell[run.index(name)] = run.floor_plan.cell(*cell)
    for name, left in busy.items():
        robots.busy[run.index(name)], robots.action[run.index(name)] = left, ACTION_WAIT
    for name in parked:
        robots.parked[run.index(name)] = 1
        run.world.clock.unparked -= 1
    arrived = {}
    for tick in range(1, ticks + 1):
        run.tick()
        for name in goals:
            i = run.index(name)
            if robots.cell[i] == robots.goal_cell[i]:
                arrived.setdefault(name, tick)
    assert run.world.tally.illegal[LAYER_RIGHT_OF_WAY] == 0
    return run, arrived


def test_two_robots_that_meet_head_on_pass_each_other():
    _, arrived = drive("A...B\n.###.\n.....", A=(4, 0), B=(0, 0))
    assert set(arrived) == {"A", "B"}


@pytest.mark.parametrize("kinematics", ["omni", "differential"])  # tables of POSE16 and JOINT
def test_costs_of_steps_are_those_of_the_next_cells(kinematics):
    run, _ = drive("A...\n.>#.\n....", A=(3, 2), ticks=3, kinematics=kinematics)
    state, i = run.run.states[LAYER_RIGHT_OF_WAY], run.index("A")
    grid, tables = run.world.grid, run.run.workspace.tables
    cell, row = state.priced_cell[i], tables.row_of[state.priced_goal[i]]
    for direction in range(4):
        beside, heading = cell + grid.offset[direction], direction & (grid.headings - 1)
        is_open = grid.type_cell_flags[0, cell] >> direction & 1
        expected = cost_in(tables, row, beside, heading) if is_open else UNREACHABLE
        assert state.costs[i, direction] == expected, direction


@pytest.mark.parametrize(
    ("goal", "expected"),
    [([1, 0], (1, 1)), ([3, 2], (3, 1)), ([1, 2], (1, 1)), ([3, 0], (3, 1))],
)
def test_fixed_ties_prefer_west_and_east(goal, expected):
    """Both first steps to a corner are as good; with ties by hash both occur."""
    found = {"fixed": set(), "hash": set()}
    for ties, seed in product(found, range(1, 9)):
        strategy = {"allocation": "greedy", "right_of_way": {"name": "pibt", "ties": ties}}
        orders = {"list": [{"stops": [goal]}]}
        resolved = scene(".....\n.....\n.....", [(2, 1)], orders=orders, strategy=strategy)
        run = Simulation(resolved, seed)
        run.run(until=1)
        found[ties].add(resolved.floor_plan.xy(int(run.world.robots.cell[0])))
    assert found["fixed"] == {expected} and len(found["hash"]) == 2


def test_a_full_ring_rotates():
    run, arrived = drive("AB\nDC", A=(1, 1), B=(0, 1), C=(0, 0), D=(1, 0), ticks=12)
    assert set(arrived) == set("ABCD")
    assert run.world.tally.operations[:, 1].sum() >= 8, "each moves twice at least"


def test_who_has_nothing_to_do_makes_way():
    run, arrived = drive("A.B.\n##.#", A=(3, 0), ticks=10)
    assert arrived == {"A": 3}
    assert run.world.robots.goal_type[run.index("B")] == GOAL_NONE


def test_a_robot_that_turns_has_reserved_the_cell_that_it_turns_to():
    """B comes straight to the cell that A, which is slow to turn, has chosen first."""
    run, arrived = drive(
        dedent("""
        #.#
        A..
        #B#
        """),
        kinematics="differential",
        durations=Durations(turn=4),
        A=(2, 1),
        B=(1, 0),
        ticks=30,
    )
    assert set(arrived) == {"A", "B"}
    assert run.run.world.tally.operations[:, 2].sum() <= 3, "nobody turns there and back"


def test_one_robot_at_a_time_is_let_into_a_dead_end_and_out_again():
    _, arrived = drive("A...\n.##.\nB...\n.###", A=(0, 3), ticks=20)
    assert arrived
    _, arrived = drive("....\n.##.\n....\nA###", A=(3, 0), ticks=20)
    assert arrived["A"] <= 10


@pytest.mark.parametrize("goals", [{"A": (0, 1), "B": (4, 1)}, {"A": (4, 1), "B": (0, 1)}])
def test_two_robots_do_not_stand_across_a_cell_for_two(goals):
    """Both have to turn there, which needs both lanes, so one comes in after the other has left."""
    floor = "##A##\n=====\n##B##"
    for move, turn in product((1, 2), (1, 2)):
        durations = Durations(move=move, turn=turn)
        _, arrived = drive(floor, kinematics="differential", durations=durations, **goals)
        assert set(arrived) == {"A", "B"}


# The second and the third jammed when robots that stand across did not push each other.
@pytest.mark.parametrize("seed", [3, 424, 694])
def test_an_aisle_for_two_between_pods_jams_no_more_than_one_for_a_single_robot(seed):
    robots, lines = starved(seed, 1500)
    assert robots[1] <= robots[0]
    assert lines[1] > 0.8 * lines[0]


def moves_of(run, name):
    return int(run.world.tally.operations[run.index(name), ACTION_MOVE].sum())


B_IS_DOWN = Faults(listed=(Fault(at=1, robot=1),), tow_after=None, repair_time=None)


def test_a_robot_that_is_down_is_gone_round():
    run, arrived = drive(".....\n.AB..\n.....", A=(4, 1), faults=B_IS_DOWN)
    assert arrived["A"] <= 8
    assert moves_of(run, "A") == 5, "three, and two for the detour"


def test_an_aisle_that_is_blocked_for_good_is_left_for_the_next_one():
    """Distances lead back into the aisle from every cell between it and the next one."""
    aisles = dedent("""
    .....
    A###.
    .###.
    B###.
    .###.
    .....
    """)
    run, arrived = drive(aisles, A=(0, 5), faults=B_IS_DOWN, ticks=30)
    assert moves_of(run, "A") == 1 + 2 + 4 + 5 + 4, "round, without turning back"
    assert arrived["A"] <= 18


def test_a_robot_that_works_for_long_is_gone_round():
    run, arrived = drive(".....\n.AB..\n.....", A=(4, 1), busy={"B": 30})
    assert arrived["A"] <= 8
    assert moves_of(run, "A") == 5


def test_the_busy_are_waited_for_where_a_detour_takes_longer():
    """They are not driven back and forth behind, nor the long way round."""
    run, arrived = drive("A.B....\n.#####.\n.......", A=(6, 0), busy={"B": 5})
    assert moves_of(run, "A") == 6
    assert arrived["A"] <= 12


HOMES_IN_A_DEAD_END = """
name: homes
layout:
  picture: |
    ......
    .####.
    ..x.y.
    #.####
    #.####
    #.####
  legend: {x: {kind: station}, y: {kind: station}}
fleet: {robots: 3, kinematics: differential, start: [[1, 4], [1, 5], [1, 3]]}
orders: {generator: stations, count: 6}
strategy: {allocation: first-come, right_of_way: pibt}
stop: {when: parked, max_duration: 300}
seed: 1
"""


def test_robots_whose_homes_share_a_dead_end_park_in_it_all(tmp_path):
    """Whoever comes first: the one farthest in parks first."""
    (tmp_path / "homes.yaml").write_text(HOMES_IN_A_DEAD_END)
    run = Simulation(resolve(tmp_path / "homes.yaml"))
    run.run(until=300)
    assert run.world.robots.parked.all()
    assert run.tick < 150


def test_a_robot_that_is_parked_deep_in_a_dead_end_comes_out_for_one_that_works_there():
    _, arrived = drive(".B..\n.##.\n....\n#.##\n#.##\n#A##", B=(1, 4), parked="A", ticks=30)
    assert arrived


def test_where_a_robot_has_turned_to_it_goes_first():
    """Even if it would rather go elsewhere by then: others have made way for it."""
    run, _ = drive(
        "...\n.A.\n...", A=(0, 1), kinematics="differential", durations=Durations(turn=4), ticks=2
    )
    run.world.robots.goal_cell[0] = run.floor_plan.cell(2, 1)
    run.tick(3)
    assert run.floor_plan.xy(int(run.world.robots.cell[0])) == (0, 1)


def test_two_robots_that_want_into_one_dead_end_go_in_one_after_the_other():
    picture = "A....B\n.####.\n......\n##.###\n##.###"
    run, arrived = drive(picture, A=(2, 4), B=(2, 3), ticks=30)
    first, second = sorted(arrived, key=arrived.get)
    assert arrived[second] - arrived[first] >= 4, "the first has come out before"
    assert run.floor_plan.xy(int(run.world.robots.cell[run.index(first)]))[1] < 3


def test_who_leaves_a_dead_end_goes_before_who_wants_into_it():
    """B stands before it, with a goal in it; A comes out first, though both are as old."""
    _, arrived = drive("......\n.####.\n..B...\n##A###", A=(5, 0), B=(2, 3), ticks=20)
    assert set(arrived) == {"A", "B"}


def test_it_goes_with_no_routes():
    with pytest.raises(InputError, match="routing 'congestion' would have no effect"):
        resolve("crossing", ["strategy.right_of_way=pibt", "strategy.routing=congestion"])


def aisles(tmp_path, kind, robots, ticks, **settings):
    """A floor of aisles between corridors; each order leads from an aisle to a station at the bottom."""
    rows = {
        "two": ["." * 17] * 2 + ["#a" * 8 + "#"] * 5 + ["." * 17] * 2,
        "one": ["." * 17] * 2 + ["#e#f" * 4 + "#"] * 5 + ["." * 17] * 2,
        "dead": ["#a" * 8 + "#"] * 7 + ["." * 17] * 2,
        "stub": ["." * 17] * 2 + ["#a" * 8 + "#"] * 5 + ["." * 17] * 2,
    }[kind]
    stations = "".join("t" if x % 4 == 2 else "#" if kind == "stub" else "." for x in range(17))
    rows = [*rows, stations] if kind == "stub" else [*rows[:-1], stations]
    draws = np.random.default_rng(7)
    sources = [(x, y) for y, row in enumerate(rows) for x, one in enumerate(row) if one in "aef"]
    ends = [(x, len(rows) - 1) for x in range(17) if stations[x] == "t"]
    free = [(x, y) for y, row in enumerate(rows) for x, one in enumerate(row) if one not in "#t"]
    lines = [
        "0,{},{},{},{}".format(*draws.choice(sources), *draws.choice(ends))
        for _ in range(2 * ticks)
    ]
    (tmp_path / "orders.csv").write_text(
        "released,from_x,from_y,to_x,to_y\n" + "\n".join(lines) + "\n"
    )
    start = [list(map(int, cell)) for cell in draws.permutation(free)[:robots]]
    used = "".join(rows)
    legend = (
        "{"
        + ", ".join(
            entry
            for entry in (
                "a: {kind: station}",
                "e: {kind: station, exits: [south]}",
                "f: {kind: station, exits: [north]}",
            )
            if entry[0] in used
        )
        + "}"
    )
    text = "name: aisles\nlayout:\n  picture: |\n"
    text += "".join(f"    {row}\n" for row in rows) + f"  legend: {legend}\n"
    text += f"fleet: {{robots: {robots}, kinematics: differential, start: {start}}}\n"
    text += "durations: {move: 1, turn: 2, pick: 8, drop: 8}\n"
    text += "orders: {transports: {file: orders.csv}}\n"
    text += "strategy: {allocation: first-come, right_of_way: pibt}\n"
    text += f"stop: {{when: never, max_duration: {ticks}}}\nseed: 3\n"
    text += "".join(f"{key}: {value}\n" for key, value in settings.items())
    path = tmp_path / "aisles.yaml"
    path.write_text(text)
    return path


@pytest.mark.parametrize(
    ("kind", "robots"), [("two", 24), ("two", 40), ("one", 40), ("stub", 40), ("dead", 16)]
)
def test_everybody_gets_through(tmp_path, kind, robots):
    run = Simulation(resolve(aisles(tmp_path, kind, robots, 2400)))
    done = []
    for tick in (800, 1600, 2400):
        run.run(until=tick)
        done.append(run.world.tally.operations[:, [ACTION_PICK, ACTION_DROP]].sum((1, 2)).copy())
    for before, after in pairwise(done):
        assert (after > before).all(), "every robot finished a visit"
    assert run.world.tally.illegal.sum() == 0


def test_how_robots_are_stored_changes_nothing(tmp_path):
    resolved = resolve(aisles(tmp_path, "stub", 20, 300))
    digests = set()
    for storage in (None, np.random.default_rng(1).permutation(20).astype(np.int32)):
        run = Simulation(resolved, storage=storage)
        run.run(until=300)
        digests.add(run.digest)
    assert len(digests) == 1


def test_limited_sight_gives_no_illegal_answers(tmp_path):
    run = Simulation(resolve(aisles(tmp_path, "two", 12, 300, information="{radius: 3}")))
    run.run(until=300)
    assert run.world.tally.illegal.sum() == 0
    assert (run.world.orders.delivered >= 0).sum() > 5


def test_robots_that_see_nothing_are_refused(tmp_path):
    with pytest.raises(InputError, match="set a radius, or use retreat"):
        resolve(aisles(tmp_path, "two", 12, 300, information="orders"))
