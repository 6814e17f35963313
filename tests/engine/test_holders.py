"""Robots are looked up by cell: `traffic.holder` is what a scan of all robots finds."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from random_strategies import Mood, RandomAllocation, RandomRightOfWay, RandomRouting

from automaton.runs.simulation import Simulation
from automaton.strategy.api import FOLLOWING_CONVOY, NIL, Strategy
from automaton.world.resolve import resolve
from strategies.right_of_way import retreat

FLOORS = (
    "......\n.####.\n......",  # a ring for one robot in each cell
    "==..==\n.####=\n==~~..",  # lanes, and cells for any number
    "~~====\n=~.~=.\n....~~",
    "......\n>>..=.\n......",  # a one-way aisle
)
SCENARIO = """name: crowd
layout:
  picture: |
    {floor}
    sdsdsd
fleet: {{robots: {robots}, kinematics: {kinematics}, start: random}}
durations: {{move: {move}, turn: 2, pick: 2, drop: 1}}
faults: {{failure_probability: 0.01, tow_after: 3, repair_time: 5}}
information: {information}
stop: {{when: never, max_duration: 25}}
seed: {seed}
"""


def standing(view: Any, i: int) -> bool:
    return bool(view.robots.cell[i] != NIL)


def naive_holders(view: Any) -> Any:
    """(C, 2): for each lane, who enters it, or else who stands in it; all robots are asked."""
    robots, cell_flags = view.robots, view.grid.cell_flags
    found = np.full((len(cell_flags), 2), NIL, np.int32)
    leaving = []
    for i in range(len(robots.cell)):
        if not standing(view, i):
            continue
        held = [(robots.cell[i], robots.travel[i])]
        if robots.claim[i] == robots.cell[i]:
            held.append((robots.cell[i], robots.travel[i] ^ 2))
        elif robots.claim[i] != NIL:
            leaving.append((*held.pop(), robots.identity[i]))
            step = robots.claim[i] - robots.cell[i]
            held.append((robots.claim[i], view.grid.offset.tolist().index(step)))
        for cell, direction in held:
            if int(cell_flags[cell]) >> 5 & 3:
                lane = lane_of(cell_flags, cell, direction)
                assert found[cell, lane] in (NIL, robots.identity[i]), "one robot holds it"
                found[cell, lane] = robots.identity[i]
    for cell, direction, identity in leaving:
        lane = lane_of(cell_flags, cell, direction)
        is_entered = found[cell, lane] != NIL and view.rules.following == FOLLOWING_CONVOY
        if int(cell_flags[cell]) >> 5 & 3 and not is_entered:
            assert found[cell, lane] in (NIL, identity), "one robot holds it"
            found[cell, lane] = identity
    return found


def lane_of(cell_flags: Any, cell: Any, direction: Any) -> int:
    return int(direction) >> 1 if int(cell_flags[cell]) >> 5 & 3 == 2 else 0


def by_identity(view: Any) -> list[int]:
    return [int(i) for i in view.robots.at_index if standing(view, i)]


def naive_wants(view: Any, i: int) -> int:
    """Of all robots, the first whose route leads into the cell of robot i next."""
    robots = view.robots
    for j in by_identity(view):
        if j != i and robots.route_index[j] < robots.route_length[j]:
            step = view.grid.offset[robots.route[j, robots.route_index[j]]]
            if robots.cell[j] + step == robots.cell[i]:
                return j
    return NIL


def naive_beside(view: Any, i: int, *others: int) -> list[int]:
    """All robots that may move into the cell of robot i, but for some."""
    robots, grid = view.robots, view.grid
    return [
        j
        for j in by_identity(view)
        if j not in (i, *others)
        for way in range(4)
        if grid.type_cell_flags[robots.type[j], robots.cell[j]] >> way & 1
        and robots.cell[j] + grid.offset[way] == robots.cell[i]
    ]


def naive_presses(view: Any, i: int) -> int:
    for first in naive_beside(view, i):
        behind, at = i, first
        for _ in range(len(view.robots.cell)):
            if not retreat.is_boxed_in(view, at):
                break
            if view.robots.retreat_moves[at] or naive_wants(view, at) != NIL:
                return first
            beside = naive_beside(view, at, behind)
            if not beside:
                break
            behind, at = at, beside[0]
    return NIL


class Probe(RandomRightOfWay):
    """Compares what is looked up with what scans find, then decides at random."""

    holders = True

    def __init__(self) -> None:
        super().__init__(Mood(illegal=0, active=60))
        self.state = None
        self.found = 0

    def decide(self, view: Any, batch: Any, decisions: Any, memory: Any, workspace: Any) -> None:
        assert np.array_equal(view.traffic.holder, naive_holders(view))
        state = self.state = self.state or WITHDRAW.reset(view)
        state.calls += 1
        retreat.list_crowds(view, state)
        for i in batch.robot[: batch.count]:
            if standing(view, i):
                wants = naive_wants(view, i)
                assert retreat.robot_entering_cell_of(view, state, i) == wants
                pressing = naive_presses(view, i)
                assert retreat.boxed_in_neighbour(view, state, i) == pressing
                self.found += wants != NIL or pressing != NIL
        super().decide(view, batch, decisions, memory, workspace)


GIVE_WAY = "strategy.right_of_way={name: retreat, idle_give_way: true}"
WITHDRAW = retreat.Retreat(resolve("crossing", [GIVE_WAY]).strategies["right_of_way"].parameters)


def compared(path: Path, storage: Any, seed: int, **crowd: Any) -> int:
    """Run a crowd, compared tick by tick; how often somebody was in the way of somebody."""
    crowd["floor"] = crowd["floor"].replace("\n", "\n    ")
    path.write_text(SCENARIO.format(**crowd, seed=seed))
    probe, mood = Probe(), Mood(seed=seed, illegal=0, active=200)
    run = Simulation(
        resolve(path),
        storage=storage,
        strategies=[None, None, RandomAllocation(mood), RandomRouting(mood), probe],
    )
    run.run()
    assert run.tick == 25
    assert np.all(run.world.traffic.holder == NIL), "nothing outlasts a decision"
    return probe.found


@given(
    floor=st.sampled_from(FLOORS),
    robots=st.integers(3, 12),
    kinematics=st.sampled_from(["omni", "differential"]),
    move=st.integers(1, 3),
    information=st.sampled_from(["everything", "orders", "{radius: 2}"]),
    seed=st.integers(0, 2**32),
    data=st.data(),
)
@settings(max_examples=60)
def test_what_is_looked_up_is_what_a_scan_of_all_robots_finds(
    tmp_path_factory: pytest.TempPathFactory, seed: int, data: Any, **crowd: Any
) -> None:
    storage = np.array(data.draw(st.permutations(range(crowd["robots"]))), np.int32)
    compared(tmp_path_factory.mktemp("crowd") / "crowd.yaml", storage, seed, **crowd)


@pytest.mark.parametrize("floor", FLOORS)
def test_robots_are_in_the_way_of_others_in_such_runs(tmp_path: Path, floor: str) -> None:
    crowd = {"robots": 10, "kinematics": "omni", "move": 2, "information": "everything"}
    storage = np.arange(10, dtype=np.int32)
    assert compared(tmp_path / "crowd.yaml", storage, 1, floor=floor, **crowd) > 0


class Blind(Strategy):
    """Says nothing of holders, and so sees none."""

    layer = "right_of_way"
    period = 1

    def decide(self, view: Any, batch: Any, decisions: Any, memory: Any, workspace: Any) -> None:
        assert np.all(view.traffic.holder == NIL)


def test_who_does_not_say_that_it_looks_robots_up_sees_no_holders(tmp_path: Path) -> None:
    scenario = resolve(file_of(tmp_path, 5))
    strategies: list[Strategy | None] = [None, None, None, None, Blind()]
    run = Simulation(scenario, strategies=strategies)
    run.run(until=3)
    assert np.all(run.world.robots.cell != NIL), "there is somebody to see"


COUNTED = """
import sys
import numpy as np
from automaton.world.resolve import resolve
from automaton.runs.simulation import Simulation

class Counted(np.ndarray):
    def __getitem__(self, index):
        global looks
        looks += 1
        return np.asarray(self)[index]

run = Simulation(resolve(sys.argv[1]))
run.run(until=2)
run.view.robots.__dict__["cell"] = run.world.robots.cell.view(Counted)
looks = 0
run.run(until=3)
print(looks)
"""
FILE = """name: file
layout:
  picture: |
    {cells}
    sd{wall}
fleet: {{robots: {robots}, kinematics: omni, start: random}}
orders: {{list: [{{from: [0, 1], to: [1, 1]}}]}}
strategy:
  allocation: {{name: shortest-job, idle: stay}}
  right_of_way: {{name: retreat, idle_give_way: true}}
stop: {{when: never, max_duration: 10}}
"""


def file_of(folder: Path, robots: int) -> Path:
    """A floor that is a file of robots, so that nobody can move."""
    path = folder / f"{robots}.yaml"
    cells, wall = "." * robots, "#" * (robots - 2)
    path.write_text(FILE.format(cells=cells, wall=wall, robots=robots))
    return path


def looks(folder: Path, robots: int) -> int:
    """How often cells of robots are looked up in a tick."""
    path = file_of(folder, robots)
    done = subprocess.run(
        [sys.executable, "-c", COUNTED, str(path)],
        env={**os.environ, "NUMBA_DISABLE_JIT": "1"},
        capture_output=True,
        text=True,
        check=True,
    )
    return int(done.stdout)


def test_twice_as_many_robots_are_looked_at_twice_as_often(tmp_path: Path) -> None:
    """A hundred robots that stand in a file; each asked whether one of them has to get on."""
    few, many = looks(tmp_path, 50), looks(tmp_path, 100)
    assert 50 < few < many < 2.2 * few
