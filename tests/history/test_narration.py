"""A run described in sentences: which kinds there are, in which words, and how many at most."""

from __future__ import annotations

from typing import Any

import pytest
from gate_scenes import gate_scene
from pod_scenes import pod_scene

from automaton.errors import InputError
from automaton.history.event_history import EVENT_GROUPS
from automaton.history.live_run import LiveRun
from automaton.history.narration import KINDS, Scope, kinds_named, narrate
from automaton.world.resolve import Resolved, resolve

AISLE = ".........."


def described(scene: Resolved, *kinds: str, sentences: int = 100, first: int = 0) -> list[str]:
    run = LiveRun(scene, scene.scenario.seed)
    scope = Scope(kinds_named(kinds), sentences, first)
    return [line for stretch in narrate(run, scope) for line in stretch.lines]


def mini(*settings: str) -> Resolved:
    return resolve("tabletop-mini", ("stop.max_duration=300", *settings))


def test_every_event_has_a_kind_that_can_be_asked_for() -> None:
    assert set(EVENT_GROUPS) <= set(KINDS) and len(KINDS) == len(set(KINDS))
    assert kinds_named(["parking-bays", "waits over"]) == {"parking bays", "waits over"}
    with pytest.raises(
        InputError, match=r"'fault' is not a kind of sentence \(did you mean 'faults'\?\)"
    ):
        kinds_named(["fault"])


def test_a_wait_is_reported_once_it_has_lasted_and_again_when_it_is_over() -> None:
    lines = described(mini(), "waits", "waits-over")
    assert lines[:2] == [
        "tick 10, robot 1: has been waiting for 10 ticks: robot 0 holds (0, 0) while it works there",
        "tick 13, robot 1: is no longer waiting, after 13 ticks",
    ]


def test_orders_and_deliveries_are_reported_in_the_sequence_of_their_ticks() -> None:
    lines = described(mini(), "orders", "picks", "deliveries")
    assert "tick 71, robot 0: delivers load 20" in lines
    ticks = [int(line[5 : line.index(",")]) for line in lines]
    assert ticks == sorted(ticks) and len(lines) > 30


def test_a_stretch_has_so_many_sentences_and_says_what_it_leaves_out() -> None:
    every, few = described(mini(), sentences=100), described(mini(), sentences=4)
    left = [line for line in few if "left out" in line]
    assert left[0].startswith("ticks 1 to 100, left out: ") and len(left) == 3
    counted = sum(
        int(part.rpartition(" ")[2]) for line in left for part in line.split(": ")[1].split(", ")
    )
    assert len(few) - len(left) == 3 * 4
    # waits are over only for those whose beginning was reported
    assert counted + 3 * 4 <= len(every)
    assert "tick 10, robot 1: has been waiting for 10 ticks" in "\n".join(few), "kinds take turns"


def test_the_limit_counts_the_sentences_that_are_asked_for() -> None:
    every, few = (described(mini(), "deliveries", sentences=many) for many in (100, 3))
    assert "tick 122, robot 0: delivers load 22" in few and every[:2] == few[:2]
    assert few[-1] == "ticks 101 to 200, left out: deliveries 1" and len(every) == len(few) == 6


def test_the_ends_of_waits_can_be_asked_for_alone() -> None:
    both, ends = described(mini(), "waits", "waits-over"), described(mini(), "waits-over")
    assert ends == [line for line in both if "is no longer waiting" in line] != []


def test_what_came_before_the_first_tick_is_not_described() -> None:
    lines = described(mini(), "deliveries", first=150)
    assert (
        lines
        == [line for line in described(mini(), "deliveries") if "tick 1, " not in line][
            -len(lines) :
        ]
    )
    assert all(int(line[5 : line.index(",")]) > 150 for line in lines) and lines


def test_a_deadlock_names_its_robots() -> None:
    scene = mini("strategy.right_of_way=wait", "stop.max_duration=230")
    lines = [line for line in described(scene, "deadlocks") if "deadlock of" in line]
    who = "robot 1 -> robot 2 -> robot 1"
    assert lines == [
        f"tick 221, robot 1: deadlock of 2 robots, a wait cycle: {who}; none moves until one makes way"
    ]


def test_batteries_faults_and_towing_are_described() -> None:
    faults = ("faults.list=[{robot: 1, at: 20}]", "faults.tow_after=30", "faults.repair_time=50")
    assert described(mini(*faults), "faults") == [
        "tick 20, robot 1: breaks down",
        "tick 50, robot 1: is towed",
        "tick 100, robot 1: is back",
    ]


@pytest.mark.parametrize(
    ("floor", "expected"),
    [
        (
            {"closed": [{"cells": [[3, 0]], "from": 1, "for": 40}]},
            [
                "tick 1: (3, 0) is closed until tick 41, for 40 more ticks",
                "tick 41: (3, 0) is open now, and closed at other times",
            ],
        ),
        (
            {"doors": [{"at": [3, 0], "opening_time": 6, "hold_open": 1}]},
            [
                "tick 3: (3, 0) is a door that opens in tick 9",
                "tick 12: (3, 0) is a door that is shut",
            ],
        ),
    ],
)
def test_gates_are_reported_when_they_change(floor: dict[str, Any], expected: list[str]) -> None:
    scene = gate_scene(floor, (9, 0), (8, 0), picture=AISLE, start=[[0, 0]])
    assert described(scene, "gates") == expected


def test_pods_stations_and_breaks_are_described() -> None:
    stations = {"P1": {"at": [5, 3], "breaks": [{"from": 10, "for": 40}]}}
    lines = described(
        pod_scene([{"pod": 1, "station": "P1"}], stations=stations), *EVENT_GROUPS, "breaks"
    )
    assert "tick 10: station P1 has a break for 40 more ticks" in lines
    assert [line.partition(": ")[2] for line in lines if "trip 0" in line] == [
        "takes trip 0",
        "picks up the pod of trip 0",
        "was served for trip 0",
        "stores the pod of trip 0",
    ]
