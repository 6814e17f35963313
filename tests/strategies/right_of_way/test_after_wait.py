"""Grzejszczak and Nocon's `go to 1`: after a wait in vain, a robot chooses and plans again."""

from __future__ import annotations

from collections.abc import Sequence

import pytest
from drawn_scenes import recorded_run, scene

from automaton.engine.state import ACTION_MOVE
from automaton.errors import InputError
from automaton.runs.simulation import Simulation
from automaton.world.resolve import resolve

DETOUR = """
.......
.#####.
......."""
BROKEN = {"list": [{"robot": 1, "at": 1}]}


def run_of(rule: str, stops: Sequence[tuple[int, int]], picture: str = DETOUR) -> Simulation:
    """Robot 0 goes from the left to cells; robot 1 stands broken in the middle of the short way."""
    strategy = {
        "allocation": "independent",
        "routing": "shortest",
        "right_of_way": {"name": "retreat", "after_wait": rule, "max_retries": 254},
    }
    resolved = scene(
        picture,
        [(0, 2), (3, 2)],
        orders={"list": [{"stops": [stop]} for stop in stops]},
        faults=BROKEN,
        strategy=strategy,
        stop={"when": "delivered", "max_duration": 300},
    )
    run, _ = recorded_run(resolved)
    assert not run.world.tally.illegal.any()
    return run


def test_a_kept_plan_waits_before_a_broken_robot_for_ever() -> None:
    assert not run_of("keep", [(6, 2)]).finished


def test_a_plan_that_is_made_again_leads_around_it() -> None:
    run = run_of("replan", [(6, 2)])
    assert run.finished
    moves = int(run.world.tally.operations[0, ACTION_MOVE].sum())
    assert moves == 2 + 2 + 2 + 6 + 2, "two moves there and back, then around"


def test_a_robot_without_load_chooses_again() -> None:
    """The near order lies behind the broken robot: around it, another one is nearer."""
    run = run_of("replan", [(5, 2), (4, 0)])
    near, other = run.world.orders.delivered.tolist()
    assert run.finished and other < near
    kept = run_of("keep", [(5, 2), (4, 0)])
    assert not kept.finished and kept.world.orders.legs.tolist()[1] == 0


@pytest.mark.parametrize("allocation", ["independent", "cooperative"])
@pytest.mark.parametrize("configuration", [1, 2])
def test_the_printed_rule_finishes_the_published_floors(
    allocation: str, configuration: int
) -> None:
    """With the retreats that the paper adds in its text."""
    settings = (
        "strategy.right_of_way.after_wait=replan",
        f"strategy.allocation={allocation}",
        "information=orders",
        "fleet.robots=5",
    )
    resolved = resolve(f"tabletop-{configuration}", settings)
    for seed in range(1, 6):
        run = Simulation(resolved, seed)
        run.run()
        assert run.finished and not run.world.tally.illegal.any()


def test_an_unknown_rule_is_one_sentence() -> None:
    with pytest.raises(InputError, match="after_wait must be keep or replan"):
        resolve("tabletop-1", ["strategy.right_of_way.after_wait=go"])
