"""EPIBT in the world: its plans hold, and a second implementation in plain Python makes the same ones."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from played_back import recorded
from random_floors import pictures

from automaton.engine.state import (
    ACTION_BLOCKED,
    ACTION_HELD_BACK,
    ACTION_MOVE,
    NIL,
    ORDER_DELIVERED,
)
from automaton.errors import InputError
from automaton.runs.simulation import Simulation
from automaton.verification.validator import validate_stored
from automaton.world.resolve import Resolved, resolve
from strategies.right_of_way.epibt.epibt_state import (
    FORWARD,
    LEFT,
    RIGHT,
    WAIT,
    operations_of,
    path_of,
)

FLOOR = """
tttttttt
tt#tt#tt
tttt#ttt
t#tttttt
tttttt#t
tt#ttttt
"""
SCENARIO = """
name: crowd
layout:
  picture: |
    {picture}
fleet: {{robots: {robots}, kinematics: differential, start: random}}
durations: {{pick: {pick}, drop: 0, turn: 1}}
orders:
  generator: visits
  count: 3000
  arrivals: {{closed_loop: {{in_system: {in_system}}}}}
strategy: {{allocation: first-come, right_of_way: {{name: epibt}}}}
stop: {{when: never, max_duration: {ticks}}}
"""


def crowd(
    *overrides: str,
    folder: Path,
    robots: int = 12,
    ticks: int = 150,
    pick: int = 0,
    picture: str = FLOOR,
) -> Resolved:
    """A closed loop of visits on a small floor."""
    text = SCENARIO.format(
        picture=picture.strip().replace("\n", "\n    "),
        robots=robots,
        ticks=ticks,
        pick=pick,
        in_system=robots + robots // 2,
    )
    (folder / "crowd.yaml").write_text(text)
    return resolve(folder / "crowd.yaml", overrides)


def epibt(**parameters: object) -> str:
    text = ", ".join(f"{name}: {value}" for name, value in parameters.items())
    return f"strategy.right_of_way={{name: epibt{', ' * bool(text)}{text}}}"


def run_to_end(resolved: Resolved, seed: int = 1, storage: object = None) -> Simulation:
    run = Simulation(resolved, seed=seed, storage=storage)  # type: ignore[arg-type]
    run.run()
    return run


def visits(run: Simulation) -> int:
    return int((run.world.orders.state == ORDER_DELIVERED).sum())


def ticks_of(run: Simulation, action: int) -> int:
    return int(run.world.tally.ticks[:, action].sum())


TOURS = "orders={generator: tours, count: 300, stops: {from: 1, to: 3}}"
SECOND = {
    "reference_epibt:Reference": (epibt(), "seed=1"),
    "reference_epibt:Deeper": (epibt(depth=4, first="oldest"), "seed=1"),
    "reference_epibt:Crowded": (epibt(first="shortest", starved_after=20, drivers=5), TOURS),
}


@pytest.mark.parametrize("reference", SECOND)
@pytest.mark.parametrize(("robots", "pick"), [(12, 0), (24, 2)])
def test_a_second_implementation_makes_the_same_plans(
    tmp_path: Path, reference: str, robots: int, pick: int
) -> None:
    """Visits of 2 ticks make robots obstacles for others that have planned to pass."""
    parameters, demand = SECOND[reference]
    shape: dict[str, Any] = {"folder": tmp_path, "robots": robots, "pick": pick, "ticks": 30}
    own = crowd(parameters, demand, **shape)
    other = crowd(f"strategy.right_of_way={reference}", demand, **shape)
    assert run_to_end(own).digest == run_to_end(other).digest


SQUARE = [[x, y] for y in range(2) for x in range(5)]


@settings(
    max_examples=12, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture]
)
@given(
    below=pictures("....#", 5, 3),
    start=st.permutations(SQUARE).flatmap(
        lambda cells: st.integers(1, 10).map(lambda n: cells[:n])
    ),
    depth=st.integers(3, 5),
    tries=st.sampled_from([0, 2]),
    guidance=st.sampled_from(["none", "lattice"]),
    pick=st.sampled_from([0, 3]),
)
def test_plans_are_free_of_conflicts(
    tmp_path: Path,
    below: str,
    start: list[list[int]],
    depth: int,
    tries: int,
    guidance: str,
    pick: int,
) -> None:
    """The world refuses no move, and finds no decision illegal."""
    overrides = (epibt(depth=depth, repair_tries=tries, guidance=guidance), f"fleet.start={start}")
    picture = "ttttt\nttttt\n" + below
    resolved = crowd(
        *overrides, folder=tmp_path, robots=len(start), ticks=40, pick=pick, picture=picture
    )
    run = run_to_end(resolved)
    assert run.world.tally.illegal.sum() == 0
    assert ticks_of(run, ACTION_BLOCKED) == 0
    assert len(np.unique(run.world.robots.cell)) == len(start)
    assert visits(run) > 0


@pytest.mark.parametrize(("move", "turn"), [(2, 1), (1, 3), (3, 4)])
def test_moves_and_turns_of_several_ticks_are_planned(tmp_path: Path, move: int, turn: int) -> None:
    """No move is refused, and no robot is left behind for long."""
    slow = (epibt(), f"durations.move={move}", f"durations.turn={turn}")
    run = run_to_end(crowd(*slow, folder=tmp_path, robots=20, ticks=600, pick=2))
    assert run.world.tally.illegal.sum() == ticks_of(run, ACTION_BLOCKED) == 0
    assert (run.world.tally.operations[:, ACTION_MOVE].sum(axis=1) > 40).all()
    assert visits(run) > 100


def test_what_is_left_of_a_plan_is_a_plan() -> None:
    """In ticks, too: who goes on with the rest of it is where the others think it is."""
    offsets = (1, 100, -1, -100)
    for depth, *pace, late in ((3, 2, 4, 1, 0), (3, 1, 2, 1, 0), (4, 3, 1, 1, 0), (3, 2, 1, 1, 1)):
        known = operations_of(depth)
        for actions, number in zip(known.actions, known.following, strict=True):
            here, held = path_of(offsets, actions, 0, pace, late)
            done = {FORWARD: pace[0], WAIT: 1}.get(actions[0], pace[1])
            heading = {RIGHT: 1, LEFT: 3}.get(actions[0], 0)
            rest, rest_held = path_of(offsets, known.actions[number], heading, pace, late)
            rest, rest_held = [*rest, rest[-1]], [*rest_held, rest[-1]]
            start = here[done - 1]
            for tick in range(len(here) - done):
                assert here[done + tick] - start == rest[min(tick, len(rest) - 1)]
                assert held[done + tick] - start == rest_held[min(tick, len(rest) - 1)]


def test_a_recorded_run_keeps_the_rules(tmp_path: Path) -> None:
    resolved = crowd(epibt(repair_tries=1), folder=tmp_path, robots=30, ticks=100)
    assert validate_stored(recorded(resolved)).valid


def test_a_crowd_goes_on(tmp_path: Path) -> None:
    """30 robots on 42 cells: most cells are held, and still each robot gets somewhere."""
    run = run_to_end(crowd(epibt(first="oldest"), folder=tmp_path, robots=30, ticks=400))
    assert visits(run) > 300
    assert (run.world.tally.operations[:, ACTION_MOVE].sum(axis=1) > 0).all()


def test_each_rule_of_the_order_decides_something(tmp_path: Path) -> None:
    """Otherwise the second implementation could not tell whether one of them is followed."""
    rules = {"first": "shortest", "starved_after": 20, "drivers": 5}
    parts = [rules, *({k: v for k, v in rules.items() if k != left} for left in rules)]
    runs = [crowd(epibt(**one), TOURS, folder=tmp_path, robots=24, ticks=30) for one in parts]
    assert len({run_to_end(run).digest for run in runs}) == 4


def test_the_order_of_storage_changes_nothing(tmp_path: Path) -> None:
    resolved = crowd(epibt(repair_tries=2), folder=tmp_path, robots=24)
    storage = np.random.default_rng(1).permutation(24).astype(np.int32)
    assert run_to_end(resolved, storage=storage).digest == run_to_end(resolved).digest


def test_repairs_are_counted_and_so_repeatable(tmp_path: Path) -> None:
    """They change the run, and a run with them can be made again."""
    runs = [
        run_to_end(crowd(epibt(repair_tries=tries), folder=tmp_path, robots=24))
        for tries in (0, 3, 3)
    ]
    assert runs[0].digest != runs[1].digest == runs[2].digest


OPEN = "\n".join(["tttttttt"] * 8)


@pytest.mark.parametrize("tries", [0, 1])
def test_robots_without_work_stay_where_they_are(tmp_path: Path, tries: int) -> None:
    """One visit among three robots on an open floor: two of them never move."""
    overrides = (epibt(repair_tries=tries), "orders={generator: visits, count: 1}")
    run = run_to_end(crowd(*overrides, folder=tmp_path, robots=3, ticks=40, picture=OPEN))
    assert visits(run) == 1
    assert np.count_nonzero(run.world.tally.operations[:, ACTION_MOVE].sum(axis=1)) == 1


def test_the_lattice_leads_along_its_streets(tmp_path: Path) -> None:
    """More of the moves on guided floors go the way of their rows and columns."""
    along = []
    for guidance in ("none", "lattice"):
        resolved = crowd(epibt(guidance=guidance), folder=tmp_path, robots=6, picture=OPEN)
        run = Simulation(resolved, seed=1)
        with_street = moves = 0
        for tick in range(1, 151):
            before = run.world.robots.cell.copy()
            run.run(tick)
            for cell, after in zip(before, run.world.robots.cell, strict=True):
                if cell != after:
                    x, y = resolved.floor_plan.xy(int(cell))
                    step = int(np.flatnonzero(run.world.grid.offset == after - cell)[0])
                    runs = (0 if y % 2 else 2) if step % 2 == 0 else (3 if x % 2 else 1)
                    moves += 1
                    with_street += step == runs
        along.append(with_street / moves)
    assert along[0] < 0.6 < along[1]


BAYS = """
bttttb
bt##tb
bttttb
"""


def test_robots_leave_their_parking_bays_when_their_home_cells_are_free(tmp_path: Path) -> None:
    overrides = (epibt(), "fleet.start=parking-bays")
    run = run_to_end(crowd(*overrides, folder=tmp_path, robots=6, picture=BAYS))
    assert (run.world.robots.cell != NIL).any() and visits(run) > 50
    assert (run.world.tally.operations[:, ACTION_MOVE].sum(axis=1) > 0).all()
    assert run.world.tally.illegal.sum() == 0 == ticks_of(run, ACTION_BLOCKED)


def test_robots_that_go_down_are_gone_round(tmp_path: Path) -> None:
    overrides = (epibt(), "faults={failure_probability: 0.01, tow_after: 5, repair_time: 10}")
    run = run_to_end(crowd(*overrides, folder=tmp_path, robots=12))
    assert run.world.tally.failures.sum() > 0 and visits(run) > 50
    assert run.world.tally.illegal.sum() == 0


@pytest.mark.parametrize(
    ("overrides", "sentence"),
    [
        (("fleet.kinematics=omni",), "kinematics differential, found omni; use pibt"),
        (("durations.move=65",), "too few for depth 3 with durations.move 65 and durations.turn 1"),
        (("durations.turn=65",), "it plans 256 ticks at most, too few for depth 3"),
        (
            (epibt(drivers=3), "durations.turn=2"),
            "with drivers every move and turn must take one tick",
        ),
        (("information=orders",), "information must be everything"),
        (("strategy.routing=astar",), "routing 'astar' would have no effect"),
        (("strategy.right_of_way={name: epibt, depth: 6}",), "depth"),
    ],
    ids=str,
)
def test_what_it_does_not_plan_for_is_refused(
    tmp_path: Path, overrides: tuple[str, ...], sentence: str
) -> None:
    with pytest.raises(InputError) as refused:
        crowd(*overrides, folder=tmp_path)
    assert sentence in str(refused.value) and "\n" not in str(refused.value)


def test_cells_for_two_robots_are_refused(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"room for 2 robots in \(1, 1\); use pibt"):
        crowd(folder=tmp_path, robots=2, picture="ttt\n.=.\nttt")


def test_a_run_of_100_ticks_is_as_it_was(tmp_path: Path) -> None:
    run = run_to_end(crowd(folder=tmp_path, robots=20, ticks=100))
    assert (visits(run), ticks_of(run, ACTION_HELD_BACK), run.digest) == GOLDEN


GOLDEN = (120, 202, "0113812c06a3a59f")
