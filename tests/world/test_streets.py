"""Streets of a scenario: weights and closed moves, their files, and what is refused."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

import automaton
from automaton.engine.search import distance, shortest_distance
from automaton.errors import InputError
from automaton.recording.frames import resolved_of
from automaton.recording.recording_reader import read_recording
from automaton.runs.simulation import Simulation
from automaton.scenario.street_files import GGO_COLUMNS
from automaton.verification.verification import verify
from automaton.world.floor_parts import with_limits_and_streets
from automaton.world.resolve import branched, resolve
from automaton.world.scenario_warnings import scenario_warnings

EAST, SOUTH, WEST, NORTH = range(4)
RING = """\
......
.####.
......
.####.
......"""
Data = dict[str, Any]


def scenario(streets: Any, picture: str = RING, **changes: Any) -> Data:
    return {
        "name": "streets",
        "layout": {"picture": picture},
        "fleet": {"robots": 1, "start": [[0, 0]]},
        "orders": {"generator": "tours", "count": 4, "stops": {"from": 2, "to": 2}},
        "strategy": {"right_of_way": "pibt"},
        "stop": {"when": "delivered", "max_duration": 500},
        "streets": streets,
        **changes,
    }


def weight(data: Data, x: int, y: int, direction: int) -> int:
    floor_plan = resolve(data).floor_plan
    return int(floor_plan.move_weights[floor_plan.cell(x, y), direction])


def test_later_streets_overwrite_earlier_ones_edge_by_edge() -> None:
    data = scenario(
        [
            {"row": 0, "east": 0.5, "west": 2},
            {"row": 0, "columns": [1, 2], "east": 3},
            {"path": [[0, 0], [0, 4], [5, 4]], "there": 0.25, "back": 4},
            {"area": {"from": [4, 0], "to": [5, 0]}, "wait": 7},
            {"at": [5, 2], "north": 0.015},
        ]
    )
    assert [weight(data, x, 0, EAST) for x in range(5)] == [50, 300, 300, 50, 50]
    assert [weight(data, x, 0, WEST) for x in range(1, 6)] == [200] * 5
    assert (weight(data, 0, 1, SOUTH), weight(data, 0, 1, NORTH)) == (25, 400)
    assert (weight(data, 2, 4, EAST), weight(data, 2, 4, WEST)) == (25, 400)
    assert weight(data, 5, 2, NORTH) == 2  # rounded half up
    floor_plan = resolve(data).floor_plan
    assert [floor_plan.wait_weights[floor_plan.cell(x, 0)] for x in (3, 4, 5)] == [100, 700, 700]


@pytest.mark.parametrize("phase", [(0, 0), (1, 0), (0, 1)])
def test_crisscross_alternates(phase: tuple[int, int]) -> None:
    data = scenario({"preset": "crisscross", "phase": list(phase), "against": 2}, "....\n" * 4)
    runs_east = [weight(data, 1, y, EAST) == 50 for y in range(4)]
    runs_south = [weight(data, x, 1, SOUTH) == 50 for x in range(4)]
    assert runs_east == [(y + phase[0]) % 2 == 0 for y in range(4)]
    assert runs_south == [(x + phase[1]) % 2 == 1 for x in range(4)]
    assert {weight(data, 1, y, way) for y in range(4) for way in (EAST, WEST)} == {50, 200}


def test_the_scale_mean_makes_the_mean_of_all_moves_1() -> None:
    floor_plan = resolve(
        scenario({"preset": "crisscross", "scale": "mean"}, "....\n" * 4)
    ).floor_plan
    bits = (floor_plan.exits.reshape(-1)[:, None] >> np.arange(4)) & 1 > 0
    assert floor_plan.move_weights[bits].mean() == pytest.approx(100, abs=1)


def test_a_closed_move_is_no_move_of_the_floor() -> None:
    floor_plan = resolve(scenario([{"row": 0, "west": "closed"}])).floor_plan
    assert [int(floor_plan.exits[1, 1 + x]) >> WEST & 1 for x in range(6)] == [0] * 6
    assert [int(floor_plan.exits[1, 1 + x]) >> EAST & 1 for x in range(6)] == [1] * 5 + [0]
    assert not len(floor_plan.move_weights)  # all weights are 1


ONE_WAY = """\
>>>>>v
^.##.v
^<<<<<"""


def test_an_open_move_is_made_against_the_arrows_and_after_an_earlier_street() -> None:
    way_in = [{"column": 1, "rows": [0, 2], "south": "open", "north": "open"}]
    for streets, is_open in (
        (way_in, 0),
        ([*way_in, {"row": 0, "west": "open"}], 1),
        ([*way_in, {"row": 0, "west": "open"}, {"row": 0, "west": "closed"}], 0),
        (
            [
                *way_in,
                {"row": 0, "east": "closed"},
                {"path": [[0, 0], [5, 0]], "there": "open", "back": "open"},
            ],
            1,
        ),
        ({"preset": "crisscross", "then": [*way_in, {"row": 0, "west": "open"}]}, 1),
    ):
        exits = resolve(scenario(streets, ONE_WAY)).floor_plan.exits
        assert [int(exits[1, 1 + x]) >> WEST & 1 for x in range(6)] == [0] + [is_open] * 5
        assert int(exits[2, 2]) >> NORTH & 1 and not int(exits[2, 2]) >> EAST & 1


def test_robots_pass_each_other_on_a_street_of_capacity_2() -> None:
    """In a corridor without a passing place."""
    data = scenario([{"row": 0, "capacity": 2}], "......")
    data["fleet"] = {"robots": 2, "start": [[0, 0], [5, 0]], "kinematics": "omni"}
    data["orders"] = {"tasks": [[[5, 0]], [[0, 0]]], "assign": "round-robin"}
    assert automaton.simulate(data).finished
    assert (resolve(data).floor_plan.capacity[1, 1:-1] == 2).all()
    assert not automaton.simulate({**data, "streets": None}).finished
    data["streets"].append({"at": [3, 0], "capacity": 1})
    assert resolve(data).streets_in_words == "streets: 5 cells for 2 robots"


def test_a_robot_alone_takes_the_ticks_that_its_way_promises() -> None:
    """The weights send it around, from [0, 0] by the outer lane; without them it goes straight."""
    away = [{"row": 0, "east": 9, "west": 9}, {"column": 0, "north": 9}]
    orders = {"tasks": [[[5, 0]]]}
    for row in ("pibt", "epibt", "retreat"):
        data = scenario(away, strategy={"right_of_way": row}, durations={"move": 2, "turn": 1})
        data["orders"] = orders
        run = Simulation(resolve(data))
        world, space = run.world, run.workspace
        start, heading = int(world.robots.cell[0]), int(world.robots.heading[0])
        goal = resolve(data).floor_plan.cell(5, 0)
        promised = int(distance(world, space, 0, start, heading, goal))
        assert promised == int(shortest_distance(world, space, 0, start, heading, goal)) + 8 + 1
        outcome = automaton.simulate(data)
        assert outcome.finished
        assert abs(outcome.ticks - promised) <= 1


def test_weights_of_1_give_the_same_run_and_others_another() -> None:
    busy = {
        "fleet": {"robots": 6, "start": "random"},
        "stop": {"when": "never", "max_duration": 200},
    }
    for row in ("pibt", "epibt"):
        strategy = {"right_of_way": row}
        digests = [
            automaton.simulate(scenario(streets, "......\n" * 5, strategy=strategy, **busy)).digest
            for streets in (None, {"preset": "crisscross", "along": 1}, {"preset": "crisscross"})
        ]
        assert digests[0] == digests[1] != digests[2]


@pytest.mark.parametrize(
    "strategy",
    [
        {"right_of_way": "pibt"},
        {"right_of_way": "epibt"},
        {"right_of_way": "retreat"},
        {"right_of_way": "retreat", "routing": "astar"},
        {"right_of_way": "retreat", "routing": "congestion"},
        {"right_of_way": "retreat", "routing": "traffic-avoidance"},
    ],
)
def test_each_strategy_of_ways_follows_the_streets(strategy: Data) -> None:
    """From [0, 0] to [4, 0] and back the weights lead over the row below."""
    data = scenario([{"row": 0, "east": 9, "west": 9}], ".....\n.....", strategy=strategy)
    data["orders"] = {"tasks": [[[4, 0]]]}
    moves = {
        streets: automaton.simulate({**data, "streets": data["streets"] if streets else None})
        for streets in (False, True)
    }
    assert [moves[which].robots[0]["moves"] for which in (False, True)] == [4, 6]


def test_a_recording_repeats_and_a_branch_changes_weights_alone(tmp_path: Path) -> None:
    (tmp_path / "streets.csv").write_text("x;y;east;wait\n0;0;0.5;\n1;0;closed;2\n")
    data = scenario({"file": str(tmp_path / "streets.csv")}, "......\n" * 3)
    resolved = resolve(data)
    automaton.simulate(data, record=tmp_path / "a.rec")
    assert verify(tmp_path / "a.rec").passed
    recording = read_recording(tmp_path / "a.rec")
    assert resolved_of(recording.header).floor_plan == resolved.floor_plan
    (tmp_path / "streets.csv").unlink()  # the recording needs no file
    assert resolved_of(recording.header).scenario.streets == resolved.scenario.streets
    other = branched(resolved, ("streets=[{at: [1, 0], east: closed}, {row: 1, east: 3}]",))
    assert other.floor_plan.move_weights[other.floor_plan.cell(2, 1), EAST] == 300
    assert (other.floor_plan.exits == resolved.floor_plan.exits).all()
    for other in ("row: 1, east: 3", "at: [1, 0], east: closed, capacity: 2"):
        with pytest.raises(InputError, match="neither closed or open moves nor capacities"):
            branched(resolved, (f"streets=[{{{other}}}]",))


@pytest.mark.parametrize(
    "streets",
    [
        {"preset": "crisscross", "scale": "mean", "then": [{"row": 0, "east": "closed"}]},
        {"preset": "crisscross", "against": "closed", "scale": "mean"},
        {"preset": "crisscross", "then": [{"row": 2, "east": "open", "capacity": 2}]},
        [{"row": 2, "east": 0.5, "west": 3}, {"row": 2, "columns": [1, 3], "east": "open"}],
        [{"row": 4, "columns": [2, 2], "west": "closed"}, {"row": 4, "west": 0.3}],
    ],
)
def test_the_floor_of_a_recording_has_the_same_weights(streets: Any) -> None:
    """It is without its closed moves, and has its opened ones."""
    data = scenario(streets, "......\n......\n.<<<..\n......\n......")
    resolved = resolve(data)
    recorded = resolved.floor_plan.without_weights()
    again = with_limits_and_streets(resolved.scenario, recorded, is_closed=True)
    assert again == resolved.floor_plan


def test_a_branch_reads_a_file_whose_closed_moves_the_floor_lacks(tmp_path: Path) -> None:
    (tmp_path / "streets.csv").write_text("x,y,east,west\n1,0,closed,2\n2,0,3,\n")
    resolved = resolve(scenario([{"at": [1, 0], "east": "closed"}]))
    file = tmp_path / "streets.csv"
    for more in ("", ", scale: 2"):
        other = branched(resolved, (f"streets={{file: {file}{more}}}",))
        weights = other.floor_plan.move_weights[other.floor_plan.cell(2, 0)]
        assert weights[EAST] == (600 if more else 300)
    same = "streets=[{row: 0, columns: [1, 1], east: closed, south: 3}, {row: 4, east: 3}]"
    with pytest.raises(InputError, match="neither closed or open moves"):
        branched(resolved, (same.replace("south: 3", "west: closed"),))
    all_of_row = resolve(scenario([{"row": 4, "east": "closed"}]))  # the last cell has no such move
    branched(all_of_row, ("streets=[{row: 4, columns: [0, 4], east: closed, west: 2}]",))


def test_strategies_of_a_branch_with_other_weights_begin_anew() -> None:
    """The memory of epibt has costs of ways."""
    busy: Data = {
        "strategy": {"right_of_way": "epibt"},
        "stop": {"when": "never", "max_duration": 99},
    }
    busy["fleet"] = {"robots": 4, "start": [[0, 0], [5, 0], [0, 4], [5, 4]]}
    crossing = {"preset": "crisscross"}
    for before, after in ((None, crossing), (crossing, None)):
        whole = automaton.Simulation(scenario(after, **busy))
        branch = automaton.Simulation(scenario(before, **busy)).branch(streets=after)
        digests = {run.step(ticks=40).digest for run in (whole, branch)}
        assert len(digests) == 1
        other = automaton.Simulation(scenario(before, **busy))
        assert other.step(ticks=40).digest not in digests


GGO = ",".join(GGO_COLUMNS)


def guidance_graph(rows: int, columns: int, text: str = "0,.,{y},{x},{e},{n},{w},{s},1.5") -> str:
    lines = []
    for y in range(rows):
        for x in range(columns):
            inside = {"e": x < columns - 1, "n": y > 0, "w": x > 0, "s": y < rows - 1}
            values = {name: value if inside[name] else "inf" for name, value in WEIGHTS.items()}
            lines.append(text.format(x=x, y=y, **values))
    return "\n".join([GGO, *lines])


WEIGHTS = {"e": "0.5", "n": "2", "w": "3", "s": "4"}


def test_a_guidance_graph_has_rows_as_x_and_up_as_north(tmp_path: Path) -> None:
    (tmp_path / "ggo.csv").write_text(guidance_graph(2, 4))
    data = scenario({"file": str(tmp_path / "ggo.csv")}, "....\n....")
    assert [weight(data, 1, 1, way) for way in (EAST, NORTH, WEST)] == [50, 200, 300]
    assert weight(data, 1, 0, SOUTH) == 400
    floor_plan = resolve(data).floor_plan
    assert floor_plan.wait_weights[floor_plan.cell(3, 1)] == 150


@pytest.mark.parametrize(
    ("text", "line", "says"),
    [
        ("x,y,east\n0,0,0\n", 2, "cell [0, 0] has east '0'; a weight is 0.01 to 10,000 or closed"),
        ("x,y,east\n0,0,nan\n", 2, "a weight is 0.01 to 10,000 or closed"),
        ("x,y,east\n0,0,1e5\n", 2, "a weight is 0.01 to 10,000 or closed"),
        ("x,y,wait\n0,0,closed\n", 2, "a weight is 0 to 10,000"),
        ("x,y,wait\n0,0,-1\n", 2, "a weight is 0 to 10,000"),
        ("x,y,north\n0,0,1\n", 2, "cell [0, 0] has a weight to the north, where no robot can move"),
        ("x,y,east\n0,0,1\n\n0,0,2\n", 4, "cell [0, 0] appears twice, first in line 2"),
        ("x,y,east\n1,1,1\n", 2, "cell [1, 1] is a wall, on which no robot drives"),
        ("x,y,east\n7,0,1\n", 2, "cell [7, 0] is off the floor (x 0..5, y 0..4)"),
        ("x,y,eest\n0,0,1\n", 1, "unknown column 'eest' (did you mean 'west'?)"),
        ("x,east\n0,1\n", 1, "needs the columns x, y and some of"),
        ("x,y,east\na,0,1\n", 2, "x is 'a', not a whole number from 0"),
        (guidance_graph(2, 4), 3, "cell [1, 0] has a weight to the south, where no robot can move"),
        (
            GGO + "\n0,.,0,0,1,inf,inf,1,1\n1,.,0,2,1,inf,1,inf,1\n",
            3,
            "of row 0, column 2, where the floor of 6 x 5 cells has row 0, column 1",
        ),
        (GGO + "\n0,.,0,0,1,inf,inf,1,1\n1,.,1,0,1,1,1,1,1\n", 3, "x is the row and y the column"),
        (
            GGO + "\n0,@,0,0,inf,inf,inf,inf,1\n",
            2,
            "is of type '@' in the guidance graph, but floor",
        ),
        ('x,y,east\n0,0,"2\n', 2, "is not CSV: unexpected end of data"),
        ("x,y,east\n0,0," + "1" * 140_000, 2, "is not CSV: field larger than field limit"),
    ],
)
def test_a_wrong_file_is_refused_with_its_line(
    text: str, line: int, says: str, tmp_path: Path
) -> None:
    path = tmp_path / "streets.csv"
    path.write_text(text)
    with pytest.raises(InputError) as refused:
        resolve(scenario({"file": str(path)}))
    assert str(refused.value).startswith(f"{path}:{line}: ")
    assert says in str(refused.value)
    assert "\n" not in str(refused.value)


@pytest.mark.parametrize(
    ("picture", "says"),
    [
        ("..c...\n.####.\n......", "[2, 0] is a charger, which has its capacity from the legend"),
        ("..p...\n.####.\n......", "[2, 0] is a storage, which has room for one robot"),
    ],
)
def test_cells_that_have_their_own_capacity_refuse_another(picture: str, says: str) -> None:
    with pytest.raises(InputError, match="street 1 has a capacity, but") as refused:
        resolve(scenario([{"row": 0, "capacity": 2}], picture))
    assert says in str(refused.value)


def test_an_error_beside_a_file_of_streets_has_its_own_line(tmp_path: Path) -> None:
    (tmp_path / "streets.csv").write_text("x,y,wait\n0,0,2\n")
    (tmp_path / "a.yaml").write_text(
        "name: a\nlayout: {picture: '...\n\n  ...'}\nfleet: {robots: 1, start: [[0, 0]]}\n"
        "streets:\n  file: streets.csv\n  then:\n    - {row: 0, wait: 3}\n    - {row: 7, wait: 3}\n"
    )
    with pytest.raises(InputError, match=r"a\.yaml:10: street 2 has the cell \[0, 7\]"):
        resolve(tmp_path / "a.yaml")


@pytest.mark.parametrize(
    ("streets", "says"),
    [
        ([{"row": 9, "east": 1}], "street 1 has the cell [0, 9], outside the floor of 6 x 5 cells"),
        ([{"column": 0, "rows": [0, 9], "east": 1}], "has the cell [0, 9], outside"),
        ([{"path": [[0, 0], [3, 2]], "there": 1}], "along neither a row nor a column"),
        ([{"path": [[0, 0], [0, 4], [0, 9]], "there": 1}], "has the cell [0, 9], outside"),
        (
            [{"path": [[1, 0], [1, 2]], "there": 1}],
            "goes south from [1, 0], where no robot can move",
        ),
        ([{"area": {"from": [0, 0], "to": [9, 9]}, "wait": 1}], "has the cell [9, 9], outside"),
        ([{"at": [1, 1], "wait": 1}], "street 1 has the cell [1, 1], a wall"),
        ([{"at": [1, 0], "north": 2}], "has north, but no robot can move north from its cells"),
        ([{"row": 0, "column": 1, "east": 1}], "exactly one of at, row, column, path and area"),
        (
            [{"path": [[0, 0]], "there": 1}],
            "a list of at least 2 (each a cell [x, y]), found [[0, 0]]",
        ),
        ([{"row": 0, "east": 0}], "a number from 0.01 to 10000, or closed, or open, found 0"),
        ([{"row": 0}], "has no weight"),
        ([{"row": 0, "capacity": 3}], "1"),
        ([{"at": [1, 1], "capacity": 2}], "street 1 has the cell [1, 1], a wall"),
        ([{"row": 1, "columns": [1, 4], "capacity": 2}], "but no cell on which robots drive"),
        ([{"row": 0, "north": "open"}], "has north, but no robot can move north from its cells"),
        ({"preset": "crisscross", "then": [{"row": 0}]}, "has no weight"),
        ({"preset": "crisscross", "then": [{"row": 9, "wait": 1}]}, "street 1 has the cell [0, 9]"),
        ({"preset": "criscross"}, "crisscross"),
        ({"preset": "crisscross", "file": "a.csv"}, "exactly one of file and preset"),
        ({"file": "nowhere.csv"}, "there is no file of streets 'nowhere.csv'"),
        ([{"row": 0, "east": "closed"}, {"column": 0, "south": "closed"}], "no way from [0, 0] to"),
    ],
)
def test_wrong_streets_are_refused(streets: Any, says: str) -> None:
    busy = {"robots": 2, "start": [[0, 0], [5, 4]]}
    with pytest.raises(InputError) as refused:
        resolve(scenario(streets, fleet=busy))
    assert says in str(refused.value)
    assert "\n" not in str(refused.value)


def test_weights_that_are_too_large_for_the_floor_are_refused() -> None:
    streets = {"preset": "crisscross", "along": 10_000, "against": 10_000}
    resolve(scenario(streets, durations={"move": 40}))
    with pytest.raises(InputError, match="divide them by 2 or more"):
        resolve(scenario(streets, durations={"move": 60}))


def test_check_warns_of_streets_without_effect() -> None:
    waiting = scenario([{"at": [0, 0], "wait": 2}], strategy={"right_of_way": "retreat"})
    assert any("wait" in text and "pibt" in text for text in scenario_warnings(resolve(waiting)))
    dear = scenario({"preset": "crisscross", "along": 40, "against": 50})
    assert any("scale: mean" in text for text in scenario_warnings(resolve(dear)))
    fine = scenario({"preset": "crisscross"})
    assert not any("street" in text for text in scenario_warnings(resolve(fine)))
    both = scenario(
        {"preset": "crisscross"}, strategy={"right_of_way": {"name": "pibt", "guidance": "lattice"}}
    )
    with pytest.raises(InputError, match="leave guidance out"):
        resolve(both)


ALLEY = "......\n.####.\n......\n.#####\n.#####"  # [0, 3] and [0, 4] lie in a dead end


@pytest.mark.parametrize(
    ("streets", "warns"),
    [
        ([{"path": [[0, 2], [0, 4]], "there": 0.5}], True),
        ([{"path": [[0, 2], [0, 4]], "back": 1.25}], True),
        ([{"path": [[0, 2], [0, 4]], "back": "closed"}], True),
        ([{"path": [[0, 2], [0, 4]], "there": 0.5, "back": 0.5}], False),
        ([{"path": [[0, 2], [0, 4]], "back": 0.5}], False),
        ([{"path": [[0, 3], [0, 4]], "there": 0.5}], False),  # within it
        ({"preset": "crisscross"}, False),
    ],
)
def test_check_warns_of_a_street_into_a_dead_end_under_pibt(streets: Any, warns: bool) -> None:
    fleet = {"robots": 2, "start": [[0, 0], [5, 0]]}
    for row in ("pibt", "epibt"):
        data = scenario(streets, ALLEY, fleet=fleet, strategy={"right_of_way": row})
        data["orders"] = {"list": [{"stops": [[3, 2]]}]}
        said = [text for text in scenario_warnings(resolve(data)) if "into dead ends" in text]
        assert bool(said) == (warns and row == "pibt")
        assert all("([0, 2] to [0, 3])" in text for text in said)


def test_everything_runs_on_streets_that_are_opened_and_doubled(tmp_path: Path) -> None:
    """Pods, doors, blocks, batteries, faults, types and delays, in half ticks, recorded and verified."""
    data = {
        "name": "everything",
        "layout": {"picture": "c.....c.\n.pp..pp.\n.>>>>>>.\n..t..t..\n........"},
        "fleet": {
            "robots": 5,
            "kinematics": "differential",
            "start": "random",
            "types": [{"name": "slow", "robots": 2, "move_time_factor": 2}, {"name": "quick"}],
        },
        "floor": {
            "doors": [{"at": [4, 2], "opening_time": 3, "hold_open": 5}],
            "blocks": [{"cells": [[0, 4], [3, 4]], "max_robots": 3}],
        },
        "streets": {
            "preset": "crisscross",
            "then": [
                {"path": [[0, 2], [7, 2]], "back": "open", "capacity": 2},
                {"row": 4, "capacity": 2, "columns": [1, 6]},
                {"row": 4, "columns": [4, 6], "west": "closed"},
            ],
        },
        "durations": {"turn": 2, "pick": 1, "drop": 2, "handling": {"visit": 3}},
        "battery": {"drain": {"move": 0.4}, "charge_rate": 1},
        "orders": {"lines": {"count": 12}},
        "faults": {
            "list": [{"robot": 1, "at": 40}],
            "tow_after": 20,
            "repair_time": 40,
            "delays": {"probability": 0.02, "ticks": {"from": 1, "to": 4}},
        },
        "strategy": {
            "allocation": {"name": "greedy", "idle": "stay"},
            "charging": "opportunity",
            "right_of_way": "pibt",
        },
        "stop": {"when": "delivered", "max_duration": 3000},
        "refine": 2,
    }
    outcome = automaton.simulate(data, record=tmp_path / "a.rec")
    assert outcome.metrics["delivered"] > 0
    assert verify(tmp_path / "a.rec").passed
    resolved = resolve(data)
    assert (
        resolved.streets_in_words
        == "streets: 3 moves closed, 7 moves opened, 14 cells for 2 robots"
    )
    assert resolved_of(read_recording(tmp_path / "a.rec").header).floor_plan == resolved.floor_plan
