"""Which right of way a scenario has that names none, and how it is told."""

from __future__ import annotations

from pathlib import Path

import pytest

from automaton.commands import main
from automaton.errors import InputError
from automaton.world.resolve import branched, resolve

RING = """
    .....
    .#.#.
    ....."""
TREE = """
    .....
    ##.##
    ....."""
RING_AND_TREE = """
    ...#.
    .#.#.
    ...#."""
FLOOR = """name: yard
layout:
  picture: |{picture}
fleet: {{robots: 1, start: [[1, 0]]}}
orders: {{tasks: [[[2, 0]]]}}
strategy: {{allocation: greedy}}
"""
ROUTES = "robots follow the routes of routing congestion"
SIGHT = "robots do not see all other robots"
AMONG_TREES = "fleet.start=[[4, 0]];orders={tasks: [[[4, 1]]]}"
SLOW = "turns or moves take several ticks, and most connections are open in both directions"
LIMIT = "units={tick: 1 s, cell: 1 m};floor.speed_limits=[{cells: [[1, 0], [2, 0]], max_speed: 0.5 m/s}]"
ONE_WAY = """
    >>>>v
    ^#^#v
    ^<<<<"""
NO_RING = "the floor has no ring on which robots can pass each other"


def yard(folder: Path, picture: str) -> Path:
    path = folder / "yard.yaml"
    path.write_text(FLOOR.format(picture=picture))
    return path


@pytest.mark.parametrize(
    ("picture", "setting", "name", "why"),
    [
        (RING, "seed=1", "pibt", ""),
        (RING, "strategy.routing=shortest", "pibt", ""),
        (RING, "strategy.right_of_way=null", "pibt", ""),
        (RING, "strategy.routing=congestion", "retreat", ROUTES),
        (RING, "strategy.routing={name: congestion}", "retreat", ROUTES),
        (RING, "information={radius: 3}", "retreat", SIGHT),
        (RING, "information=orders", "retreat", SIGHT),
        (TREE, "seed=1", "retreat", NO_RING),
        (RING_AND_TREE, "seed=1", "pibt", ""),
        (RING, "durations.turn=2", "epibt", SLOW),
        (RING, "durations.move={empty: 1, loaded: 2}", "epibt", SLOW),
        (RING, LIMIT, "epibt", SLOW),
        (ONE_WAY, "durations.turn=2", "pibt", ""),
        (RING, "durations.turn=2;floor.closed=[{cells: [[1, 0]], from: 5, for: 5}]", "pibt", ""),
        (RING, "durations={pick: 2, drop: 2}", "pibt", ""),
        (RING, "durations.turn=65", "pibt", ""),
        (RING_AND_TREE, AMONG_TREES, "retreat", NO_RING),
    ],
)
def test_robots_are_steered_where_they_can_be(
    picture: str,
    setting: str,
    name: str,
    why: str,
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
) -> None:
    path, settings = yard(tmp_path, picture), setting.split(";")
    resolved = resolve(path, settings)
    assert resolved.strategies["right_of_way"].name == name
    assert resolved.scenario.strategy.right_of_way == name, "recordings and studies name it"
    assert main(["check", str(path), *(f"--set={one}" for one in settings)]) == 0
    told = f"right of way {name} by default" + (f" ({why})" if why else "")
    assert f"1 robot, {told}, ok" in capsys.readouterr().out.replace("\n  ", " ")


def test_what_is_named_is_taken_and_not_told(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = yard(tmp_path, TREE)
    assert main(["check", str(path), "--set=strategy.right_of_way=wait"]) == 0
    assert "by default" not in capsys.readouterr().out


def test_the_right_of_way_of_a_run_stays_when_its_routing_changes(tmp_path: Path) -> None:
    resolved = resolve(yard(tmp_path, RING))
    with pytest.raises(InputError, match="retreat \\(the default with such a routing\\) or wait"):
        branched(resolved, ("strategy.routing=congestion",))
    both = ("strategy.routing=congestion", "strategy.right_of_way=retreat")
    assert branched(resolved, both).strategies["right_of_way"].name == "retreat"
