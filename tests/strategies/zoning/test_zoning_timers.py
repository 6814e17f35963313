"""When central zoning looks, shares, and designs again: told in seconds, a tick being one."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import pytest

from automaton.runs.simulation import Simulation
from automaton.world.resolve import resolve
from strategies.zoning import monitored

GOOD, BAD = 0.1, 0.5
FIRST = 31  # zoning is begun in tick 1, and looks 30 s later
ZONING = "strategy.zoning={name: annealing, design: factory-logged, adjacency: 243.6437908496732"
SECONDS = "units={tick: 1 s, cell: 2.5 ft}"


class Log:
    """The ticks of looks, of times of sharing, of redesigns, and of the flows that these are made of."""

    def __init__(self) -> None:
        self.looks: list[int] = []
        self.shares: list[int] = []
        self.redesigns: list[int] = []
        self.flows: list[int] = []


def watched(
    monkeypatch: pytest.MonkeyPatch, until: int, value: Callable[[int], float], more: str = ""
) -> Log:
    """Run the factory while its zones are as balanced as `value` says of a tick."""
    log = Log()
    now = 0

    def look(self: Any, view: Any, *rest: Any) -> None:
        nonlocal now
        now = int(view.clock.tick)
        log.looks.append(now)
        usual_look(self, view, *rest)

    def share(view: Any, *_: Any) -> int:
        log.shares.append(int(view.clock.tick))
        return 0

    def flow(view: Any, window: int, tick: int, found: Any) -> int:
        if tick not in log.looks:
            log.flows.append(tick)
        return usual_flow(view, window, tick, found)

    usual_look, usual_flow = monitored.MonitoredZones._check_balance, monitored.record_flow
    monkeypatch.setattr(monitored.MonitoredZones, "_check_balance", look)
    monkeypatch.setattr(monitored, "share", share)
    monkeypatch.setattr(monitored, "balance", lambda _: value(now))
    monkeypatch.setattr(monitored, "record_flow", flow)
    run = Simulation(
        resolve("factory", [f"{ZONING}{more}}}", SECONDS, "orders.processing_time=10"])
    )
    while run.tick < until:
        run.run(until=run.tick + 1)
        if run.tick > 1 and run.world.clock.zones_redesigned == run.tick:
            log.redesigns.append(run.tick)
    return log


def test_out_of_balance_it_looks_and_shares_every_minute(monkeypatch: pytest.MonkeyPatch) -> None:
    log = watched(monkeypatch, 300, lambda _: BAD)
    assert log.looks == log.shares == [FIRST, FIRST + 60, FIRST + 120, FIRST + 180, FIRST + 240]


def test_balanced_for_five_minutes_it_looks_every_third_one(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    log = watched(monkeypatch, 900, lambda tick: BAD if tick > 600 else GOOD)
    calm = FIRST + 300
    assert log.looks[:6] == list(range(FIRST, calm + 1, 60))
    assert log.looks[6:] == [calm + 180, calm + 360, calm + 420, calm + 480, calm + 540]
    assert log.shares == log.looks[7:]


def test_after_more_than_a_quarter_of_an_hour_new_zones_are_made(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    log = watched(monkeypatch, 2500, lambda _: BAD)
    begun = FIRST + 901  # more than 15 minutes after the look that found it out of balance
    effect = begun + 200
    again = effect + 60  # the next look: the timer starts again
    assert log.flows == [begun, again + 901]
    assert log.redesigns == [effect, again + 901 + 200]
    assert [look for look in log.looks if effect < look < effect + 130] == [again, again + 60]
    # Sharing goes on while new zones are made, and stops when they take effect.
    assert [share for share in log.shares if begun <= share <= again] == [
        *range(begun + 59, effect, 60),
        again,
    ]


def test_while_new_zones_are_made_nothing_is_shared_if_the_scenario_says_so(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    log = watched(monkeypatch, FIRST + 1200, lambda _: BAD, ", share_while_computing: false")
    begun, again = FIRST + 901, FIRST + 901 + 200 + 60
    assert log.redesigns == [begun + 200]
    assert log.shares == [*range(FIRST, begun, 60), again]


def test_one_look_in_balance_starts_the_timer_anew(monkeypatch: pytest.MonkeyPatch) -> None:
    good = FIRST + 600
    log = watched(monkeypatch, 1800, lambda tick: GOOD if tick == good else BAD)
    assert good not in log.shares
    assert log.redesigns == [good + 60 + 901 + 200]


def test_times_are_parameters(monkeypatch: pytest.MonkeyPatch) -> None:
    times = ", patience: 2, compute: 30, often: 20, share_every: 40"
    log = watched(monkeypatch, 250, lambda _: BAD, times)
    assert log.looks[:7] == list(range(FIRST, FIRST + 121, 20))
    assert log.redesigns == [FIRST + 121 + 30]
    assert log.shares[:4] == list(range(FIRST, FIRST + 121, 40))
