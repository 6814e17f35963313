"""Whatever number a strategy writes into its answers, it is legal or counted as illegal."""

from __future__ import annotations

import re
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

from automaton.engine.state import LAYER_NAMES
from automaton.runs.simulation import Simulation
from automaton.strategy.api import NIL, Strategy
from automaton.world.resolve import resolve

TRIALS = Path(__file__).parents[1] / "helpers" / "answer_trials.py"


class Says(Strategy):
    """Zoning that answers as below, once."""

    layer = "zoning"
    period = 1

    def decide(self, view: Any, batch: Any, decisions: Any, memory: Any, workspace: Any) -> None:
        if view.clock.tick == 2:
            self.say(view, decisions.zoning)

    def say(self, view: Any, out: Any) -> None:
        raise NotImplementedError


class QueuesTooMany(Says):
    def say(self, view: Any, given: Any) -> None:
        given.queued = 10**8


class QueuesOneTooMany(Says):
    def say(self, view: Any, given: Any) -> None:
        given.queued = len(given.order) + 1


class QueuesLessThanNone(Says):
    def say(self, view: Any, given: Any) -> None:
        given.queued = -5


class ServesNoZone(Says):
    def say(self, view: Any, given: Any) -> None:
        given.service_zone[0] = len(given.server)


class WakesInThePast(Says):
    def say(self, view: Any, given: Any) -> None:
        given.again[0] = -2


class EndlessDesign(Says):
    def say(self, view: Any, given: Any) -> None:
        given.redesigned, given.design.segments = 1, 10**8


class EndlessSegment(Says):
    def say(self, view: Any, given: Any) -> None:
        given.redesigned, given.design.segments = 1, 1
        given.design.points[0] = 10**8


@pytest.mark.parametrize(
    "wrong",
    [
        QueuesTooMany,
        QueuesOneTooMany,
        QueuesLessThanNone,
        ServesNoZone,
        WakesInThePast,
        EndlessDesign,
        EndlessSegment,
    ],
)
@pytest.mark.parametrize("floor", ["factory", "factory-ddz"])
def test_a_number_out_of_bounds_is_an_illegal_answer(wrong: type, floor: str) -> None:
    setting = f"strategy.zoning={__name__}:{wrong.__name__}"
    run = Simulation(resolve(floor, [setting]))
    run.run(until=4)
    asked = 1 if floor == "factory" else 3  # there robots see 131 cells, and are asked one by one
    assert run.world.tally.illegal.tolist() == [asked, 0, 0, 0, 0]
    assert (run.world.robots.service_zone == NIL).all()
    assert (run.world.service_zones.wake < 0).all()


# Rules that wild answers rarely reach: test_refusals.py breaks them on purpose.
BROKEN_ELSEWHERE = {
    *(f"allocation: {rule}" for rule in (
        "assigned order", "cell of a drop-off", "full slot", "open stops", "order begun",
        "order waits", "order with a load", "parking with work", "payload", "place of a pod",
        "reserved order", "reserved slot", "slot", "target", "way to a slot", "way to an order",
    )),
    *(f"charging: {rule}" for rule in (
        "charge target", "charging with a load", "charging with an order", "way to a charger",
    )),
    *(f"right_of_way: {rule}" for rule in ("place of a turn", "retreat", "turn", "turn of a step")),
    "routing: turn of a route",
    "zoning: overlap",
    "zoning: zoning",
}  # fmt: skip


def test_wild_answers_are_legal_or_counted() -> None:
    """In a process of its own, which may crash: 20,000 answers of all layers, a million by hand."""
    done = subprocess.run(
        [sys.executable, str(TRIALS), "20000"], capture_output=True, text=True, timeout=600
    )
    assert done.returncode == 0, done.stdout[-2000:] + done.stderr[-2000:]
    last = done.stdout.splitlines()[-len(LAYER_NAMES) :]
    (unbroken,) = re.findall(r"^rules that none broke: (.*)$", done.stdout, re.MULTILINE)
    assert set(unbroken.split(", ")) <= BROKEN_ELSEWHERE
    assert [line.partition(":")[0] for line in last] == list(LAYER_NAMES)
    assert all(int(line.split()[1].replace(",", "")) > 100 for line in last), last
    assert not any(line.endswith(" 0 counted as illegal") for line in last), last
