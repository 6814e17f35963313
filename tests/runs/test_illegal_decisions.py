"""Illegal decisions in words: in a run, in its recording, and where a robot waits for one."""

from __future__ import annotations

import json
import re
from pathlib import Path
from typing import Any

import pytest

from automaton.commands import main
from automaton.engine.refusals import DECISION_RULES, RULE_BITS
from automaton.engine.state import LAYER_NAMES
from automaton.history.explanation import explain
from automaton.history.snapshot import take_snapshot
from automaton.history.watched_run import ReplayedRun
from automaton.recording.recorder import MemoryRecorder
from automaton.runs.illegal_decisions import explainer, illegal_decisions
from automaton.runs.simulation import Simulation
from automaton.strategy.api import CMD_GO, CMD_WAIT, NIL, Strategy
from automaton.verification.verification import verify
from automaton.world.resolve import resolve

NOWHERE = "strategy.routing=example_strategies:Nowhere"


def recorded(*settings: str, until: int = 40) -> tuple[Simulation, MemoryRecorder]:
    resolved = resolve("tabletop-mini", settings)
    recorder = MemoryRecorder(resolved)
    run = Simulation(resolved, on_record=recorder)
    run.run(until)
    return run, recorder


class Wild(Strategy):
    """A right of way that steers wrongly."""

    layer = "right_of_way"
    steers = True
    period = 1

    def decide(self, view: Any, batch: Any, decisions: Any, memory: Any, workspace: Any) -> None:
        out = decisions.right_of_way
        out.command[: batch.count], out.value[: batch.count] = CMD_GO, 4


class Sleepy(Strategy):
    """A right of way that lets robots wait for too long."""

    layer = "right_of_way"
    period = 1

    def decide(self, view: Any, batch: Any, decisions: Any, memory: Any, workspace: Any) -> None:
        out = decisions.right_of_way
        out.command[: batch.count], out.value[: batch.count] = CMD_WAIT, 20_000


@pytest.mark.parametrize(
    ("setting", "sentence"),
    [
        (
            f"strategy.right_of_way={__name__}:Wild",
            "right_of_way: robot 0, tick 1: CMD_GO 4: a direction is 0 to 3",
        ),
        (
            f"strategy.right_of_way={__name__}:Sleepy",
            "right_of_way: robot 0, tick 1: command 2: a parked robot gets only CMD_STEP (1)",
        ),
        (
            "strategy.allocation=example_strategies:Greedy",
            "allocation: robot 0, tick 1: CMD_DROP_AT -5: only a robot with a load drops one",
        ),
        (NOWHERE, "routing: robot 0, tick 1: step 2 goes 5: a direction is 0 to 3"),
    ],
)
def test_a_decision_is_named_with_layer_command_value_and_what_is_allowed(
    setting: str, sentence: str
) -> None:
    run, _ = recorded(setting, until=3)
    found = illegal_decisions(run.world, run.resolved.floor_plan)
    assert str(found.first[0]) == sentence
    assert found.total == sum(many for *_, many in found.by_rule) == run.world.tally.illegal.sum()


def test_every_rule_has_a_sentence_and_each_belongs_to_its_layer() -> None:
    run, _ = recorded(until=0)
    words = explainer(run.world, run.resolved.floor_plan)
    for rule in DECISION_RULES:
        for value in (NIL, 0, 3, 300, 2**31 - 1):
            one = words(7, NIL if value else 0, rule, value)
            assert "{" not in str(one) and one.layer == LAYER_NAMES[rule >> RULE_BITS]
    assert len({one.name for one in DECISION_RULES.values()}) == len(DECISION_RULES)


def test_a_recording_names_the_same_decisions_as_the_run() -> None:
    run, recorder = recorded(NOWHERE)
    replayed = ReplayedRun(recorder.recording())
    replayed.show(run.tick, 60.0)
    ours, again = (
        illegal_decisions(one.world, one.resolved.floor_plan) for one in (run, replayed.shown)
    )
    assert ours == again and ours.total > 3
    snapshot = take_snapshot(replayed.shown)
    text = explain(snapshot, replayed.floor_plan, 0).lines[0]
    assert text.endswith("illegal decision of routing: step 2 goes 5: a direction is 0 to 3")


def test_a_run_lists_the_first_three_and_the_count_by_rule(
    capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    def printed(*arguments: str) -> str:
        main(list(arguments))
        return " ".join(capsys.readouterr().out.split())

    record = str(tmp_path / "wrong.rec")
    text = printed("run", "tabletop-mini", "--until", "40", "--set", NOWHERE, "--record", record)
    counts = (
        "120 illegal decisions: routing (exit of a route) 80, routing (direction of a route) 40"
    )
    assert counts in text
    assert len(re.findall(r"routing: robot \d, tick \d+: step \d goes", text)) == 3
    assert "and 117 more" in text
    assert verify(record).illegal.total == 120
    assert counts in printed("verify", record)
    decision = "illegal decision of routing: step 2 goes 5: a direction is 0 to 3"
    assert decision in printed("explain", record, "--robot", "0", "--at", "14")
    assert f"tick 1, robot 0: {decision}" in printed(
        "replay", record, "--describe", "--only", "illegal"
    )


def test_events_are_printed_with_the_rule(capsys: pytest.CaptureFixture[str]) -> None:
    run = ["run", "tabletop-mini", "--until", "2", "--set", NOWHERE, "--events"]
    main(run)
    line = next(x for x in capsys.readouterr().out.splitlines() if "illegal decision  " in x)
    assert line.endswith("robot 0  routing: step 2 goes 5: a direction is 0 to 3")
    main([*run, "--json"])
    whole = json.loads(capsys.readouterr().out)
    first = next(one for one in whole["events"] if one["event"] == "illegal decision")
    assert (first["rule"], first["order"]) == ("routing: direction of a route", None)
    assert whole["illegal_decisions"]["total"] == 6
    assert whole["illegal_decisions"]["first"][0]["sentence"].startswith(
        "routing: robot 0, tick 1:"
    )


def test_a_legal_run_says_nothing_of_illegal_decisions(capsys: pytest.CaptureFixture[str]) -> None:
    main(["run", "tabletop-mini"])
    assert "illegal decisions:" not in capsys.readouterr().out
