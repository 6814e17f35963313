"""Orders without a load in scenarios: lists, the generator tours, tasks; and what is wrong with them."""

from __future__ import annotations

from pathlib import Path

import pytest

from automaton.errors import InputError
from automaton.world.resolve import resolve
from automaton.world.task_lists import MAX_TASK_ORDERS, order_count

SCENARIO = """\
name: tours
layout:
  picture: |
    >>>>.#.
    ^##v.#.
    ^<<<s..
fleet: {robots: 1, kinematics: omni, start: [[0, 0]]}
orders: ORDERS
strategy: {allocation: greedy}
"""


def written(folder: Path, orders: str, tasks: str = "") -> Path:
    path = folder / "tours.yaml"
    path.write_text(SCENARIO.replace("ORDERS", orders), encoding="utf-8")
    (folder / "tasks.txt").write_text(tasks, encoding="utf-8")
    return path


def complaint(folder: Path, orders: str, tasks: str = "") -> str:
    with pytest.raises(InputError) as found:
        resolve(written(folder, orders, tasks))
    return str(found.value).replace(f"{folder}/", "")


WRONG = (
    ("{list: [{stops: [[1, 1]]}]}", "orders.list[0].stops[0]: the stop [1, 1] is a wall"),
    ("{list: [{stops: [[4, 2]]}]}", "the stop [4, 2] is a shelf: robots do not drive there"),
    ("{list: [{stops: [[7, 0]]}]}", "the stop [7, 0] lies outside the floor (x 0..6, y 0..2)"),
    (
        "{list: [{stops: [[0, 0], [6, 0]]}]}",
        "orders.list[0].stops[1]: no robot that can do the order can reach",
    ),
    ("{list: [{stops: [[0, 0]], from: [4, 2]}]}", "the key 'to' is missing"),
    ("{list: [{stops: []}]}", "orders.list[0].stops"),
    ("{list: [{}]}", "an order needs from and to, or stops"),
    ("{list: [{stop: [[0, 0]]}]}", "did you mean 'stops'?"),
    ("{list: [{stops: [[0, 0]], weight: 2000000000}]}", "orders.list[0].weight must be"),
    ("{generator: tours}", "the generator tours needs a count of orders"),
    ("{generator: tour, count: 3}", "did you mean 'tours'?"),
    ("{generator: tours, count: 3, stops: {from: 3, to: 1}}", "from (3) must not be above to (1)"),
    ("{generator: tours, count: 3, stops: 65}", "orders.stops must be a whole number from 1 to 64"),
    ("{generator: stations, count: 3, stops: 2}", "stops belong to the generator tours"),
    ("{tasks: [[[0, 0]]], repeat: true}", "repeat needs revealed"),
    ("{tasks: [[[0, 0]]], assign: round-robin, revealed: 2}", "revealed belongs to assign: pool"),
    ("{tasks: [[[0, 0]]], skip_reached: true}", "skip_reached needs assign: round-robin"),
    ("{generator: tours, count: 3, repeat: true}", "repeat belongs to tasks"),
    ("{tasks: [[[0, 0]], [[0, 0], [5, 0]]]}", "orders.tasks[1][1]: the stop [5, 0] is a wall"),
    ("{generator: stations, count: 3, cells: no-dead-ends}", "cells belong to the generator tours"),
    ("{generator: stations, count: 3, assign: round-robin}", "assign belongs to tasks and to the"),
    (
        "{generator: tours, count: 3, assign: round-robin, mean_interarrival_time: 9}",
        "reveals one order per robot; leave out mean_interarrival_time",
    ),
    (
        "{generator: tours, count: 3, cells: [stations, racks]}",
        "two groups of cells need assign: round-robin",
    ),
    (
        "{generator: tours, count: 3, assign: round-robin, cells: [stations, racks]}",
        "tours need a station, but robots reach none",
    ),
    (
        "{generator: tours, count: 3, assign: round-robin, cells: [racks, racks], stops: {from: 1, "
        "to: 2}}",
        "two groups of cells need a fixed number of stops",
    ),
    ("{tasks: []}", "tasks must hold at least one task"),
    ("{tasks: task.txt}", "there is no file of tasks 'task.txt'"),
    ("{tasks: [[[0, 0]]], assign: robin}", "did you mean 'round-robin'?"),
)


@pytest.mark.parametrize(("orders", "words"), WRONG, ids=[words for _, words in WRONG])
def test_bad_orders_are_one_sentence_with_the_line(tmp_path: Path, orders: str, words: str) -> None:
    said = complaint(tmp_path, orders)
    assert said.startswith("tours.yaml:8: ") and words in said


FILES = (
    ("", 0, "is empty; its first line must be the number of tasks"),
    ("# x\ntasks\n1\n", 2, "the number of tasks must be a whole number, found 'tasks'"),
    ("2\n0,1\n", 1, "line 1 says 2 tasks, the file has 1"),
    ("1\n0\n\n1\n", 4, "line 1 says 1 task, the file has 2"),
    ("2\n0\n0,x\n", 3, "column 3: a cell of a task must be a whole number, found 'x'"),
    ("1\n21\n", 2, "cell 21 lies outside the floor (cells 0 to 20)"),
    ("1\n-1\n", 2, "cell -1 lies outside the floor (cells 0 to 20)"),
    ("1\n0,\n", 2, "column 3: a cell of a task must be a whole number, found nothing"),
    ("2\n# walls\n0\n3,8\n", 4, "the stop [1, 1] is a wall"),
    ("1\n6\n", 2, "can reach its stop [6, 0] from its start and return"),
)


@pytest.mark.parametrize(("text", "line", "words"), FILES, ids=[words for *_, words in FILES])
def test_a_bad_file_of_tasks_is_one_sentence_with_its_line(
    tmp_path: Path, text: str, line: int, words: str
) -> None:
    said = complaint(tmp_path, "{tasks: tasks.txt}", text)
    assert said.startswith(f"tasks.txt:{line}: " if line else "tasks.txt: ") and words in said


def test_a_file_of_tasks_becomes_a_list_of_cells(tmp_path: Path) -> None:
    path = written(tmp_path, "{tasks: tasks.txt}", "# two tasks\r\n2\r\n\r\n0,14\r\n3\r\n")
    resolved = resolve(path)
    assert resolved.scenario.orders.tasks == (((0, 0), (0, 2)), ((3, 0),))
    assert [file for file, _ in resolved.files] == [str(tmp_path / "tasks.txt")]


def test_a_run_that_never_ends_says_how_it_could(tmp_path: Path) -> None:
    orders = "{tasks: [[[0, 0]]], repeat: true, assign: round-robin}"
    with pytest.raises(InputError, match=r"more than a run holds .* set a lower stop.max_duration"):
        resolve(written(tmp_path, orders), ["stop.max_duration=20000000"])
    pool = "{tasks: [[[0, 0]]], repeat: true, revealed: 1.5}"
    long = resolve(written(tmp_path, pool), ["stop.max_duration=20000000"])
    assert order_count(long.scenario, long.floor_plan) == MAX_TASK_ORDERS


@pytest.mark.parametrize("name", ["first-come", "shortest-job"])
def test_who_gives_any_order_to_any_robot_says_so(tmp_path: Path, name: str) -> None:
    path = written(tmp_path, "{tasks: [[[0, 0]]], assign: round-robin}")
    resolve(path)
    with pytest.raises(InputError, match=r"orders\.assign is round-robin; use greedy"):
        resolve(path, [f"strategy.allocation={name}"])


@pytest.mark.parametrize(
    ("layer", "name"),
    [
        ("allocation", "auction"),
        ("allocation", "adaptive"),
        ("zoning", "static"),
    ],
)
def test_who_knows_only_loads_says_so(tmp_path: Path, layer: str, name: str) -> None:
    path = written(tmp_path, "{generator: tours, count: 3}")
    with pytest.raises(InputError, match=r"only orders with a load, .* use greedy or first-come"):
        resolve(path, [f"strategy.{layer}={name}"])
