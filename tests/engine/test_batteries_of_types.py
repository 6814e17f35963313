"""Batteries by type of robot: what they take and give, and who charges when."""

from __future__ import annotations

from typing import Any

import msgspec
import pytest

from automaton.engine.state import BATTERY_PERCENT
from automaton.errors import InputError
from automaton.recording.recorder import MemoryRecorder
from automaton.runs.simulation import Simulation
from automaton.scenario.schema import Scenario
from automaton.scenario.validation import validated
from automaton.verification.validator import validate_stored
from automaton.world.bounds import bounds
from automaton.world.resolve import Resolved, resolve

PICTURE = """\
c.......t
.########
t.......c"""
SMALL = {
    "drain": {"move": 2, "loaded_factor": 3},
    "charge_rate": [[0, 8], [50, 2]],
    "initial_charge": 60,
    "reserve": 10,
}
USUAL = {"drain": {"move": 1, "wait": 0.5}, "charge_rate": 5, "initial_charge": 70}


def scene(**parts: Any) -> dict[str, Any]:
    """Two robots, the first with small batteries, each with a tour of three cells."""
    scenario: dict[str, Any] = {
        "name": "batteries",
        "layout": {"picture": PICTURE.replace("#", ".")},
        "fleet": {
            "robots": 2,
            "kinematics": "omni",
            "start": [[1, 0], [1, 2]],
            "types": [{"name": "small", "robots": 1, "battery": SMALL}, {"name": "large"}],
        },
        "battery": USUAL,
        "orders": {"list": [{"stops": [[4, 0]]}, {"stops": [[4, 2]]}]},
        "strategy": {"allocation": "first-come", "routing": "shortest", "right_of_way": "wait"},
        "stop": {"when": "delivered", "max_duration": 600},
    }
    return scenario | parts


def resolved(**parts: Any) -> Resolved:
    return resolve(msgspec.convert(scene(**parts), Scenario))


def run(made: Resolved) -> Simulation:
    recorder = MemoryRecorder(made)
    simulation = Simulation(made, on_record=recorder)
    simulation.run()
    assert validate_stored(recorder.recording()).violations == []
    return simulation


def test_each_type_pays_its_own_and_what_it_leaves_out_is_the_fleets() -> None:
    made = run(resolved())
    assert made.tick == 3
    percent = made.world.robots.charge / BATTERY_PERCENT
    assert percent.tolist() == [60 - 3 * 2, 70 - 3 * 1]
    rules = made.world.rules
    assert (rules.reserve // BATTERY_PERCENT).tolist() == [10, 0]
    assert (rules.drain[0] != rules.drain[1]).any(), "standing costs both the same"
    assert rules.drain[0, 6].tolist() == [BATTERY_PERCENT // 2, 3 * BATTERY_PERCENT // 2]


@pytest.mark.parametrize("allocation", ["independent", "auction"])
def test_robots_with_their_own_batteries_charge_and_deliver(allocation: str) -> None:
    """The validator pays and charges once more; both charge, the small one by its curve."""
    lines = [{"from": [8, 0], "to": [0, 2]} for _ in range(6)]
    small = SMALL | {"drain": {"move": 2, "loaded_factor": 1.5}}
    types = [{"name": "small", "robots": 1, "battery": small}, {"name": "large"}]
    made = run(
        resolved(
            fleet={**scene()["fleet"], "types": types},
            battery=USUAL | {"drain": {"move": 1}},
            orders={"list": lines},
            strategy={
                "allocation": allocation,
                "charging": "insertion",
                "right_of_way": "retreat",
            },
        )
    )
    assert made.finished
    assert (made.world.tally.charged > 0).all()
    assert int(made.world.tally.illegal.sum()) == 0


def test_bounds_count_the_batteries_that_serve_best() -> None:
    found = bounds(resolved())
    assert (found.held, found.given) == (70, 2 * 8)


@pytest.mark.parametrize(
    ("parts", "sentence"),
    [
        (
            {"battery": None},
            "fleet has robots of the type small with batteries, but the scenario has none; set battery, "
            "which says the rest of them",
        ),
        (
            {"fleet": {**scene()["fleet"], "types": [{"name": "a", "battery": {"size": 3}}]}},
            "unknown key 'size'",
        ),
        (
            {
                "fleet": {
                    **scene()["fleet"],
                    "types": [{"name": "a", "battery": {"charge_rate": [[5, 1]]}}],
                }
            },
            "fleet has robots of the type a, but charge_rate must rise from 0",
        ),
        (
            {"fleet": {**scene()["fleet"], "types": [{"name": "a", "size": 2}]}},
            "fleet.types[0].size: a robot takes one cell: choose units.cell at least as large as the "
            "largest robot",
        ),
        (
            {"fleet": {**scene()["fleet"], "types": [{"name": "a", "durations": {"lift": 2}}]}},
            "unknown key 'lift'",
        ),
    ],
)
def test_what_types_cannot_say(parts: dict[str, Any], sentence: str) -> None:
    with pytest.raises(InputError) as caught:
        validated(scene(**parts), Scenario)
    assert sentence in caught.value.message
