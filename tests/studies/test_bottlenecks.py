"""Bottlenecks: which changes are tried, which are confirmed, and how they are ranked."""

from __future__ import annotations

import json
import shlex
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from streets_trials import (
    Planted,
    closed_chargers,
    finds_an_effect,
    is_planted,
    ranked,
    single_lane,
    slow_robot,
    slow_station,
)
from synthetic_results import synthetic_store

from automaton.commands.bottlenecks_command import settings_text
from automaton.scenario.document import Override, keys_of
from automaton.studies.bottlenecks import (
    CHANGES_NOTHING,
    FINALISTS,
    JAMS,
    KINDS,
    MAX_FINALISTS,
    OWN,
    SCREENED,
    CandidateChange,
    CandidateList,
    ScreenedChange,
    candidates_of,
    finalists,
    jam_text,
    jams_more,
    lost_near,
    ranking,
    screened,
    statuses,
)
from automaton.studies.reports.study_results import Results
from automaton.studies.sweeps.run_keys import fingerprint
from automaton.studies.sweeps.study import Study
from automaton.world.resolve import resolve

EVERYTHING: dict[str, Any] = {
    "name": "everything",
    "layout": {"picture": "\n".join(["c..c.....", ".pp..pp..", ".........", "..t...t..", "........."])},
    "fleet": {
        "robots": 5,
        "kinematics": "differential",
        "start": "random",
        "types": [
            {"name": "slow", "robots": 2, "move_time_factor": 3, "battery": {"charge_rate": 2}},
            {"name": "quick", "durations": {"turn": 4}},
        ],
    },
    "floor": {
        "open_stations": 1,
        "open_chargers": 1,
        "doors": [{"at": [4, 2], "opening_time": 6, "hold_open": 9}],
        "blocks": [{"cells": [[0, 4], [3, 4]], "max_robots": 2}],
        "speed_limits": [{"cells": [[5, 4], [8, 4]], "max_speed": 5}],
    },
    "durations": {"move": {"empty": 1, "loaded": 3}, "turn": 2, "pick": 1, "drop": 5,
                  "handling": {"visit": 2, "line": {"uniform": {"from": 4, "to": 8}}}},
    "battery": {"drain": {"move": 0.3, "loaded_factor": 1.5}, "charge_rate": [[0, 1], [80, 0.5]]},
    "stations": {"A": {"at": [2, 3], "max_trips": 2}, "B": {"at": [6, 3]}},
    "orders": {"lines": {"count": 10}},
    "strategy": {"allocation": {"name": "greedy", "idle": "stay", "active": 20},
                 "charging": "opportunity"},
    "stop": {"when": "delivered", "max_duration": 5000},
}  # fmt: skip


def listed(path: Path, content: dict[str, Any], **more: Any) -> CandidateList:
    """The changes of a scenario; no time is lost anywhere."""
    path.write_text(json.dumps(content))
    return candidates(path, **more)


def candidates(scenario: str | Path, **more: Any) -> CandidateList:
    base = resolve(scenario).unrefined
    none = np.zeros(base.floor_plan.kind.size)
    usual = {"own": (), "kinds": KINDS, "most": 150, "lost": none, "flow": none} | more
    return candidates_of(base, lambda texts: resolve(scenario, texts).unrefined, **usual)


def settings_of(changes: CandidateList, streets: bool = False) -> dict[str, Any]:
    """The settings of all changes but those of streets, or of streets alone."""
    return {one.name: one.settings for one in changes.tried if one.of_street == streets}


def test_each_kind_of_change_is_tried_as_a_setting(tmp_path: Path) -> None:
    changes = listed(tmp_path / "all.yaml", EVERYTHING)
    assert settings_of(changes) == {
        "one more station": {"floor.open_stations": 2},
        "charging rate x 2": {"battery.charge_rate": [[0.0, 2], [80.0, 1]],
                              "fleet.types.0.battery.charge_rate": 4},
        "one more charger": {"floor.open_chargers": 2},
        "battery capacity x 2": {"battery.drain.move": 0.15,
                                 "battery.charge_rate": [[0.0, 0.5], [80.0, 0.25]],
                                 "fleet.types.0.battery.charge_rate": 1},
        "one robot of type slow fewer": {"fleet.robots": 4, "fleet.types.0.robots": 1},
        "one robot of type slow more": {"fleet.robots": 6, "fleet.types.0.robots": 3},
        "type slow: move time factor 2": {"fleet.types.0.move_time_factor": 2},
        "one robot of type quick fewer": {"fleet.robots": 4},
        "one robot of type quick more": {"fleet.robots": 6},
        "moves of type quick x 0.5": {"fleet.types.1.durations.move": {"empty": 1, "loaded": 2}},
        "turns x 0.5": {"durations.turn": 1, "fleet.types.1.durations.turn": 2},
        "drops x 0.5": {"durations.drop": 3},
        "18 active robots": {"strategy.allocation.active": 18},
        "22 active robots": {"strategy.allocation.active": 22},
        "door [4, 2] stays open": {"floor.doors.0.opening_time": 1, "floor.doors.0.hold_open": 5000},
        "block 1: 3 robots": {"floor.blocks.0.max_robots": 3},
        "speed limit 1 lifted": {"floor.speed_limits.0.max_speed": 1},
        "station A: handling x 0.5": {
            "stations.A.handling": {"visit": 1, "line": {"uniform": {"from": 2, "to": 4}}}},
        "station A: 3 trips": {"stations.A.max_trips": 3},
    }  # fmt: skip
    assert (changes.refused, changes.left_out) == ((), 0)
    assert list(changes.tried[19:])[:1] and all(one.of_street for one in changes.tried[19:])


STREETS: dict[str, Any] = {
    "name": "streets",
    "layout": {"picture": ">>>>>v\n^=##.v\n^<<<<v\n......"},
    "fleet": {"robots": 2, "kinematics": "omni", "start": [[0, 0], [1, 0]]},
    "orders": {"generator": "tours", "count": 9},
    "strategy": {"right_of_way": "pibt"},
    "stop": {"when": "delivered"},
}


def test_streets_are_doubled_opened_and_made_one_way(tmp_path: Path) -> None:
    changes = listed(tmp_path / "a.yaml", STREETS, kinds=("place",))
    streets = {name: one["streets"] for name, one in settings_of(changes, streets=True).items()}
    assert streets["row 3, columns 0 to 5: capacity 2"] == [
        {"row": 3, "columns": [0, 5], "capacity": 2}
    ]
    assert streets["row 3, columns 0 to 5: one-way west"] == [
        {"path": [[0, 3], [5, 3]], "there": "closed"}
    ]
    assert streets["row 0, columns 0 to 5: open both ways"] == [
        {"path": [[0, 0], [5, 0]], "there": "open", "back": "open"}
    ]
    assert streets["row 2, columns 2 to 3: open to the south, both ways"] == [
        {"row": 2, "columns": [2, 3], "south": "open"},
        {"row": 3, "columns": [2, 3], "north": "open"},
    ]
    assert changes.refused == ()


@pytest.mark.parametrize(
    ("own", "key"),
    [
        ([{"row": 0, "wait": 2}], "streets"),
        ({"preset": "crisscross"}, "streets.then"),
        ({"file": "streets.csv", "then": [{"row": 3, "wait": 4}]}, "streets.then"),
    ],
)
def test_a_change_of_streets_keeps_those_of_the_scenario(
    own: Any, key: str, tmp_path: Path
) -> None:
    (tmp_path / "streets.csv").write_text("x,y,wait\n0,0,3\n")
    path = tmp_path / "a.yaml"
    changes = listed(path, {**STREETS, "streets": own}, kinds=("place",), most=3)
    for one in changes.tried:
        assert list(one.settings) == [key]
        floor_plan, base = resolve(path, one.texts).floor_plan, resolve(path).floor_plan
        assert (floor_plan.wait_weights == base.wait_weights).all()
        assert (floor_plan.exits != base.exits).any() or (floor_plan.capacity != 1).any()


def test_a_street_that_would_cut_off_a_place_is_not_tried(tmp_path: Path) -> None:
    content = {**STREETS, "layout": {"picture": "....\n.##.\n...."}}
    content["fleet"] = {"robots": 2, "kinematics": "omni", "start": [[0, 0], [3, 2]]}
    content["streets"] = [{"row": 0, "west": "closed"}]
    changes = listed(tmp_path / "a.yaml", content, kinds=("place",))
    names = set(settings_of(changes, streets=True))
    assert "row 2, columns 0 to 3: one-way west" in names
    assert "row 2, columns 0 to 3: one-way east" not in names and changes.refused == ()


def test_streets_are_tried_by_the_flow_beside_them(tmp_path: Path) -> None:
    path = tmp_path / "a.yaml"
    path.write_text(json.dumps(STREETS))
    floor_plan = resolve(path).floor_plan
    flow = np.zeros(floor_plan.kind.size)
    flow[[floor_plan.cell(x, 3) for x in range(6)]] = 9.0
    changes = listed(path, STREETS, kinds=("place",), flow=flow, most=2)
    first, opened = changes.tried
    assert first.name == "row 3, columns 0 to 5: capacity 2"
    assert opened.opens and opened.name.endswith("both ways")  # in turn, as nobody drives there yet


def test_parts_and_stops_are_processed_in_half_the_time(tmp_path: Path) -> None:
    parts: dict[str, Any] = {
        "name": "parts", "layout": {"picture": "t...t\n.....\n..t.."},
        "fleet": {"robots": 1, "kinematics": "omni", "start": "random"},
        "orders": {"parts": [{"route": [1, 3]}], "processing_time": 9},
    }  # fmt: skip
    times = settings_of(listed(tmp_path / "parts.yaml", parts, kinds=("station",)))
    assert times == {
        "station 1: processing x 0.5": {"orders.processing_time": [5, 9, 9]},
        "station 3: processing x 0.5": {"orders.processing_time": [9, 9, 5]},
    }
    parts["orders"]["processing_time"] = [8, 8, {"mean": 5}]
    times = settings_of(listed(tmp_path / "parts.yaml", parts, kinds=("station",)))
    assert times == {
        "station 1: processing x 0.5": {"orders.processing_time.0": 4},
        "station 3: processing x 0.5": {
            "orders.processing_time.2": {"mean": 2.5, "distribution": "exponential"}
        },
    }
    stops = [{"stops": [{"at": [1, 1], "for": 20}, [2, 1]]}, {"stops": [{"at": [1, 1], "for": 8}]}]
    parts["orders"] = {"list": stops}
    changes = listed(tmp_path / "parts.yaml", parts, kinds=("station",))
    assert settings_of(changes) == {
        "stops at [1, 1] x 0.5": {
            "orders.list.0.stops.0.for": 10,
            "orders.list.1.stops.0.for": 4,
        }
    }


def test_a_place_is_what_changes_on_the_floor(tmp_path: Path) -> None:
    changes = listed(tmp_path / "all.yaml", EVERYTHING)
    floor_plan = resolve(tmp_path / "all.yaml").floor_plan
    places = {one.name: [floor_plan.xy(cell) for cell in one.cells] for one in changes.tried}
    assert places["one more charger"] == [(3, 0)]
    assert places["one more station"] == [(6, 3)]
    assert places["block 1: 3 robots"] == [(0, 4), (1, 4), (2, 4), (3, 4)]
    assert places["charging rate x 2"] == []


def test_most_tries_changes_near_lost_time_first(tmp_path: Path) -> None:
    path = tmp_path / "all.yaml"
    path.write_text(json.dumps(EVERYTHING))
    resolved = resolve(path)
    floor_plan = resolved.floor_plan
    lost = np.zeros(floor_plan.kind.size)
    lost[floor_plan.cell(8, 4)] = 10.0
    changes = listed(path, EVERYTHING, kinds=("place",), most=1, lost=lost)
    assert [one.name for one in changes.tried] == ["speed limit 1 lifted"]
    assert changes.left_out > 2
    assert lost_near(resolved, lost, [floor_plan.cell(5, 1)]) == 10.0
    assert lost_near(resolved, lost, [floor_plan.cell(4, 4)]) == 0.0


def test_a_change_that_the_scenario_cannot_take_has_a_reason(tmp_path: Path) -> None:
    starts = {"robots": 2, "kinematics": "omni", "start": [[0, 0], [1, 0]]}
    changed = {**EVERYTHING, "fleet": starts}
    changed["stations"] = {"A.1": {"at": [2, 3], "handling": {"visit": 4}}}
    changed["floor"] = {"open_chargers": 2}
    changes = listed(tmp_path / "all.yaml", changed)
    reasons = {change.name: reason for change, reason in changes.refused}
    assert reasons == {
        "one robot fewer": "fleet.robots is 1 but fleet.start lists 2 cells",
        "one robot more": "fleet.robots is 3 but fleet.start lists 2 cells",
        "one more charger": "floor.open_chargers is 3, but the floor has 2 chargers",
        "station A.1: handling x 0.5": "--set cannot name a station whose name has a dot or '='",
        "station A.1: 2 trips": "--set cannot name a station whose name has a dot or '='",
    }


def test_a_change_keeps_the_right_of_way_that_is_used_by_default(tmp_path: Path) -> None:
    """Fast turns would replace epibt by pibt, so that two things would change at once."""
    content = {
        "name": "open", "layout": {"picture": "......\n......\n......"},
        "fleet": {"robots": 3, "kinematics": "differential", "start": "random"},
        "durations": {"turn": 2}, "orders": {"generator": "tours", "count": 9},
        "stop": {"when": "delivered"},
    }  # fmt: skip
    turns = settings_of(listed(tmp_path / "open.yaml", content, kinds=("fleet",)))["turns x 0.5"]
    assert turns == {"durations.turn": 1, "strategy.right_of_way": "epibt"}


@pytest.mark.parametrize("scenario", ["depots", "bad-day", "factory-types", "goods-60x40"])
def test_a_pasted_setting_gives_the_same_scenario(scenario: str) -> None:
    changes = candidates(scenario, most=24).tried
    lines = settings_text(changes).text.splitlines()[1::2]
    assert changes and len(lines) == len(changes)
    for change, line in list(zip(changes, lines, strict=True))[::3]:
        typed = [word for word in shlex.split(line) if word != "--set"]
        values = [Override(key, keys_of(key), value) for key, value in change.settings.items()]
        assert fingerprint(resolve(scenario, typed)) == fingerprint(resolve(scenario, values))


def test_own_changes_come_first_and_replace_equal_ones(tmp_path: Path) -> None:
    own = CandidateChange(OWN, "three", {"durations.drop": 3})
    changes = listed(tmp_path / "all.yaml", EVERYTHING, own=[own], most=1)
    assert changes.tried == (own,) and changes.left_out > 19
    changes = listed(tmp_path / "all.yaml", EVERYTHING, own=[own])
    assert "drops x 0.5" not in settings_of(changes)


def test_every_kind_of_change_can_be_run_with_all_else_on() -> None:
    """Types, pods, gates, batteries, breakdowns and delays, in half ticks."""
    faults = {"list": [{"robot": 1, "at": 50}], "tow_after": 20, "repair_time": 40,
              "delays": {"probability": 0.01, "ticks": {"from": 1, "to": 4}}}  # fmt: skip
    stop = {"when": "never", "max_duration": 400}
    everything = Planted({**EVERYTHING, "faults": faults, "stop": stop}, ())
    answer = ranked(everything, (2, 2), "--refine", "2", "--most", "24")
    assert (answer["metric"], answer["failed"]) == ("throughput", 0)
    assert len(answer["changes"]) == 24 and answer["set"] == {"refine": 2}
    assert {one["kind"] for one in answer["changes"]} == set(KINDS)


# Statistics, on made-up runs.


def results_of(values: dict[str, list[float]], **columns: Any) -> Results:
    """Runs of named points, by replication; makespan is the metric."""
    names = tuple({"name": name} for name in values)
    runs = list(values.values())
    study = Study(name="n", scenario="n", listed=names, replications=len(runs[0]))
    return synthetic_store(study, lambda point, r: runs[point][r], **columns)


def test_screening_says_how_much_each_change_gains() -> None:
    results = results_of(
        {"base": [10.0, 12.0], "faster": [9.0, 10.0], "slower": [11.0, 13.5], "same": [10.0, 12.0]},
        digest=lambda point, r: f"{point % 3}-{r}",
    )
    faster, slower, same = screened(results, "makespan", is_higher_better=False)
    assert (faster.number, faster.status, faster.gain) == (1, SCREENED, 1.5)
    assert slower.gain == -1.25 and faster.high > faster.gain
    assert (same.number, same.status) == (3, CHANGES_NOTHING)
    assert screened(results, "makespan", is_higher_better=True)[1].gain == 1.25


@pytest.mark.parametrize(
    ("jammed", "base", "runs", "jams"),
    [
        (1, 0, 100, 0),
        (1, 0, 20, 0),
        (5, 0, 20, 1),
        (2, 0, 3, 1),
        (16, 10, 100, 0),
        (26, 10, 100, 1),
    ],
)
def test_a_change_jams_if_that_is_no_chance(jammed: int, base: int, runs: int, jams: bool) -> None:
    assert jams_more(jammed, base, runs) == jams


def test_a_change_with_more_jammed_runs_is_not_compared() -> None:
    runs = [100.0 + r for r in range(10)]
    ends = {"finished": lambda point, r: not (point == 1 and r < 5)}
    jams, other = screened(results_of({"b": runs, "x": runs, "y": runs}, **ends), "makespan", False)
    assert jams.status == JAMS and other.status == SCREENED
    starved = {
        "starved_robots": lambda point, r: 5.0 if point == 2 and r < 6 else 0.0,
        "deadlocks": lambda point, r: 1.0,
    }
    shifted = {"b": runs, "x": [r + 1 for r in runs], "y": runs}
    assert [one.status for one in screened(results_of(shifted, **starved), "makespan", False)] == [
        SCREENED,
        JAMS,
    ]


def test_the_best_and_those_that_may_be_as_good_are_confirmed() -> None:
    gains = [ScreenedChange(n, SCREENED, 20.0 - n, 20.5 - n) for n in range(1, 31)]
    assert finalists(gains) == list(range(1, FINALISTS + 1))
    gains[19] = gains[19]._replace(high=30.0)
    assert finalists(gains) == [*range(1, FINALISTS + 1), 20]
    assert finalists([one._replace(high=30.0) for one in gains]) == list(
        range(1, MAX_FINALISTS + 1)
    )
    assert finalists([ScreenedChange(1, JAMS), ScreenedChange(2, SCREENED, 1.0, 2.0)]) == [2]
    assert finalists([ScreenedChange(1, CHANGES_NOTHING)]) == []


def test_changes_are_ranked_by_effect_with_those_as_good_as_the_first() -> None:
    rng = np.random.default_rng(1)
    base = 100 + rng.normal(size=60)
    runs = {
        "base": base,
        "little": base - 2 + rng.normal(size=60),
        "most": base - 10 + rng.normal(size=60),
        "worse": base + 5 + rng.normal(size=60),
        "as good": base - 9.9 + rng.normal(size=60),
        "nothing": base + 0.1 * rng.normal(size=60),
    }
    found = ranking(results_of({k: list(v) for k, v in runs.items()}), "makespan", False)
    names = list(runs)
    assert [names[one.number] for one in found[:3]] == ["most", "as good", "little"]
    assert names[found[-1].number] == "worse"
    by_name = {names[one.number]: one for one in found}
    assert [name for name, one in by_name.items() if one.equals_first] == ["as good"]
    assert not by_name["nothing"].is_effect and by_name["nothing"].adjusted > 0.05
    assert by_name["worse"].is_effect and not by_name["worse"].helps
    assert by_name["most"].effect.difference.level == 1 - 0.05 / 5


def test_a_change_that_jams_only_in_the_confirmation_is_not_ranked() -> None:
    runs = [100.0 + r for r in range(20)]
    results = results_of(
        {"b": runs, "x": [r - 1 for r in runs], "y": [r - 2 for r in runs]},
        finished=lambda point, r: point == 0 or r not in ((7,), range(7))[point - 1],
    )
    (found,) = ranking(results, "makespan", False)
    assert (found.number, found.pairs) == (1, 19)
    assert statuses(results, "makespan") == {1: SCREENED, 2: JAMS}
    assert jam_text(results, 1) == "jams in 1 of 20 runs (as it is: 0)"


def test_changes_without_effect_are_seldom_called_an_effect() -> None:
    """The whole trial: python tests/helpers/streets_trials.py nothing."""
    assert sum(finds_an_effect(number, 12) for number in range(40)) <= 5


@pytest.mark.parametrize("plant", [slow_station, slow_robot, closed_chargers, single_lane])
def test_a_planted_bottleneck_comes_first(plant: Any) -> None:
    """The whole trial: python tests/helpers/streets_trials.py planted."""
    planted = plant(np.random.default_rng(4))
    options = ("--most", "12") if planted.change else ("--only", "station,energy,fleet")
    answer = ranked(planted, (6, 12), *options)
    first = next(one for one in answer["changes"] if one["rank"] == 1)
    assert is_planted(planted, first) and first["is_effect"]
