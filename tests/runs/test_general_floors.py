"""Table-top strategies on floors that are not a table-top: everything is delivered, nothing hangs."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from automaton.errors import InputError
from automaton.runs.metrics import metrics_of
from automaton.runs.simulation import Simulation
from automaton.world.resolve import Resolved, resolve

ALLOCATIONS = ["independent", "cooperative", "adaptive"]

TWO_BLOCKS = """
b..........d
b.sss..sss.#
b.sss..sss.#
b====..====.
b.sss..sss.#
b.sss..sss.#
b..........d
"""
ONE_SHELF = "b....d\nb..s##"
CUT_OFF_STAND = "b..d#\nb.s.#\n #####"  # the cell right of the shelf leads nowhere
SERPENTINE = "\n".join(
    ("." * 80 if y % 2 == 0 else ("#" * 79 + "." if y % 4 == 1 else "." + "#" * 79))
    for y in range(31)
)


def floor(tmp_path: Path, picture: str, *settings: str, robots: int = 1) -> Resolved:
    rows = "\n".join(f"    {row}" for row in picture.strip("\n").split("\n"))
    path = tmp_path / "floor.yaml"
    path.write_text(
        f"name: floor\nlayout:\n  picture: |\n{rows}\n"
        f"fleet: {{robots: {robots}, kinematics: differential}}\n"
        "durations: {move: 1, turn: 2, pick: 6, drop: 6}\nstop: {max_duration: 20000}\n"
    )
    return resolve(str(path), settings)


def finishes(resolved: Resolved, seed: int = 1) -> Simulation:
    simulation = Simulation(resolved, seed=seed)
    simulation.run()
    assert simulation.finished
    assert metrics_of(simulation)["illegal_answers"] == 0
    return simulation


@pytest.mark.parametrize("allocation", ALLOCATIONS)
@pytest.mark.parametrize("robots", [1, 4, 6])
def test_two_blocks_with_passing_aisles(tmp_path: Path, allocation: str, robots: int) -> None:
    setting = f"strategy.allocation={allocation}"
    resolved = floor(tmp_path, TWO_BLOCKS, setting, robots=robots)
    for seed in (1, 2, 3):  # robots meet and turn in the lanes of the passing aisle
        finishes(resolved, seed)


@pytest.mark.parametrize("allocation", ALLOCATIONS)
def test_a_load_is_never_passed_back_to_where_it_lay(tmp_path: Path, allocation: str) -> None:
    simulation = finishes(floor(tmp_path, ONE_SHELF, f"strategy.allocation={allocation}"))
    assert simulation.world.orders.legs[0] == 1


@pytest.mark.parametrize("allocation", [*ALLOCATIONS, "independent-python"])
def test_a_stand_that_no_robot_reaches_is_not_used(tmp_path: Path, allocation: str) -> None:
    finishes(floor(tmp_path, CUT_OFF_STAND, f"strategy.allocation={allocation}"))


@pytest.mark.parametrize("allocation", ALLOCATIONS)
@pytest.mark.parametrize("robots", [1, 2, 3, 4])
def test_the_crossing(allocation: str, robots: int) -> None:
    settings = [f"strategy.allocation={allocation}", f"fleet.robots={robots}"]
    finishes(resolve("crossing", settings))


def test_the_digest_does_not_depend_on_storage_where_cells_hold_several(tmp_path: Path) -> None:
    resolved = floor(tmp_path, TWO_BLOCKS, "durations.move=2", robots=6)
    for seed in range(1, 9):
        digests = set()
        for storage in (np.arange(6), np.arange(6)[::-1], np.array([3, 0, 5, 1, 4, 2])):
            simulation = Simulation(resolved, seed=seed, storage=storage)
            simulation.run(until=3000)
            digests.add(simulation.digest)
        assert len(digests) == 1


def test_a_way_longer_than_a_route_is_driven_in_parts(tmp_path: Path) -> None:
    rows = SERPENTINE.split("\n")
    rows[0] = "s" + rows[0][1:]
    rows[-1] = rows[-1][:-1] + "d" if len(rows) % 4 == 1 else "d" + rows[-1][1:]
    rows[0] = rows[0][:1] + "A" + rows[0][2:]
    simulation = finishes(floor(tmp_path, "\n".join(rows)))
    assert simulation.tick > 2 * simulation.world.robots.route.shape[1]


def test_loads_that_are_drawn_are_the_orders(tmp_path: Path) -> None:
    picture = "b....\nb.$s$d\nb....."
    simulation = finishes(floor(tmp_path, picture, "orders.generator=picture-loads"))
    assert len(simulation.world.orders.state) == 2


@pytest.mark.parametrize(
    ("picture", "sentence"),
    [
        ("b...>..s\nd....#.#", "the shelf at .* cannot be served"),
        ("A.s#B.d", "cannot be served"),
        (
            "A...<d\ns#####",
            r"there leads east from \(3, 0\) into \(4, 0\), which is closed: .* at \(4, 0\)",
        ),
        (
            "A...>d\ns#####",
            r"back leads west from \(4, 0\) into \(3, 0\), which is closed: .* at \(4, 0\)",
        ),
        ("A.sd#B\n....#.", "not connected both ways"),
    ],
)
def test_floors_without_a_way_home_are_refused(tmp_path: Path, picture: str, sentence: str) -> None:
    with pytest.raises(InputError, match=sentence):
        floor(tmp_path, picture, robots=1 + ("B" in picture))
