"""Figures of the stations to which pods are carried."""

from __future__ import annotations

import json

import pytest
from pod_scenes import played, pod_scene

from automaton.commands import main
from automaton.runs.task_metrics import metrics_by_station
from automaton.world.resolve import resolve


def test_goods_mini_by_hand() -> None:
    """Robots come into the queue in the ticks 13 and 86; lines are open in 1 to 58 and from 60 on."""
    (found,) = metrics_by_station(played(resolve("goods-mini")))
    assert found == {
        "station": "P1",
        "visits": 3,
        "lines_done": 3,
        "service_share": 60 / 122,
        "starved_share": (12 + 26) / 122,
        "mean_queue": 20 / 122,
        "longest_queue": 1,
    }


def test_a_station_is_not_starved_in_its_break() -> None:
    stations = {
        "P1": {"at": [5, 3], "queue": [[6, 3], [9, 3]], "breaks": [{"from": 5, "for": 100}]}
    }
    run = played(pod_scene([{"pod": 1}], stations=stations))
    (found,) = metrics_by_station(run)
    assert found["starved_share"] == 4 / run.tick


def test_runs_without_pods_have_no_stations(capsys: pytest.CaptureFixture[str]) -> None:
    main(["run", "tabletop-mini", "--json"])
    assert "stations" not in json.loads(capsys.readouterr().out)
    main(["run", "goods-mini", "--json"])
    (station,) = json.loads(capsys.readouterr().out)["stations"]
    assert station["station"] == "P1" and station["visits"] == 3
    main(["run", "goods-mini"])
    found = [line.split() for line in capsys.readouterr().out.splitlines()]
    assert ["P1", "3", "3", "49.2", "%", "31.1", "%", "0.16", "1"] in found
