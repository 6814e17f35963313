"""Trials of `automaton calibrate` on logs of which the truth is known, run by hand.

    python tests/helpers/calibration_trials.py sites [N]      N drawn sites, a shift each (default: 20)
    python tests/helpers/calibration_trials.py families [N]   N fits of each family and gap
    python tests/helpers/calibration_trials.py thinned [N]    N logs with fewer and fewer messages

`sites`: speeds within 2 %; turn, pick and drop within 5 % or 0.25 s; handling and energy use within 5 %.
`families`: 95 % intervals of the mean hold it in 93 to 97 %. `thinned`: no estimate below its needs.
"""

from __future__ import annotations

import math
import sys
import tempfile
from collections import Counter, defaultdict
from collections.abc import Iterator
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from disturbed_logs import disturb

from automaton.calibration import duration_fits, site_fits
from automaton.calibration.duration_fits import FAMILIES, Censored, fit_family
from automaton.calibration.state_log import StateLog, read_log
from automaton.engine.state import ACTION_SERVE
from automaton.exports.vda5050_export import write_trace
from automaton.recording.recorder import Recorder
from automaton.recording.recording_reader import read_recording
from automaton.runs.headless import run_once
from automaton.runs.simulation import Simulation
from automaton.world.resolve import resolve

TICK_S = 0.5
SHIFT = "8 h"
SPEED, SHARE, SECONDS = 0.02, 0.05, 0.25


class DrawnSite(NamedTuple):
    """A site: its scenario, and the true values of its keys, in the units of estimates."""

    scenario: dict[str, Any]
    truth: dict[str, float]


def drawn_site(seed: int) -> DrawnSite:
    """A random floor with pods, two types of robots, and random durations and energy use."""
    rng = np.random.default_rng(seed)
    many, deep, wide = (int(rng.integers(*ends)) for ends in ((2, 5), (2, 4), (2, 5)))
    aisle = "." * (1 + many * (wide + 1))
    shelves = "." + ("p" * wide + ".") * many
    stations = list("#" * len(aisle))
    places = rng.permutation(len(aisle) // 2)[:5] * 2
    for place, kind in zip(places.tolist(), "kkkzz", strict=False):
        stations[place] = kind
    rows = [aisle, *[shelves, shelves, aisle] * deep, aisle, "".join(stations)]
    cell = float(rng.choice([0.8, 1.0, 1.2, 1.5]))
    robots = int(rng.integers(5, 9))
    truth: dict[str, float] = {}
    types = []
    for name, some in (("a", robots // 2), ("b", robots - robots // 2)):
        empty = int(rng.integers(1, 4))
        ticks = {"empty": empty, "loaded": int(rng.integers(empty, 5))}
        turn = int(rng.integers(3, 9))
        for load, one in ticks.items():
            truth[f"fleet.types.{name}.durations.move.{load}"] = cell / (one * TICK_S)
        truth[f"fleet.types.{name}.durations.turn"] = turn * TICK_S
        types.append({"name": name, "robots": some, "durations": {"move": ticks, "turn": turn}})
    pick, drop = (int(rng.integers(6, 25)) for _ in range(2))
    mean = float(rng.uniform(8, 25))
    family = ("uniform", "lognormal", "exponential")[seed % 3]
    spread = {"uniform": 0.6, "lognormal": 0.5, "exponential": 1.0}[family]
    handling: dict[str, Any] = {
        "uniform": {"from": f"{mean * 0.4:.3f} s", "to": f"{mean * 1.6:.3f} s"},
        "lognormal": {"mean": f"{mean:.3f} s", "sd": f"{mean * spread:.3f} s"},
        "exponential": f"{mean:.3f} s",
    }[family]
    truth |= {
        "durations.pick": pick * TICK_S,
        "durations.drop": drop * TICK_S,
        "durations.handling": mean,
    }
    drains = {name: float(rng.uniform(*ends)) for name, ends in DRAINS.items()}
    truth |= {f"battery.drain.{name}": value for name, value in drains.items()}
    factor = drains.pop("loaded_factor")
    scenario = {
        "name": f"site-{seed}",
        "layout": {
            "picture": "\n".join(rows),
            "legend": {
                "k": {"kind": "station", "opens": ["north"]},
                "z": {"kind": "charger", "opens": ["north"]},
            },
        },
        "fleet": {"robots": robots, "kinematics": "differential", "types": types},
        "units": {"tick": f"{TICK_S} s", "cell": f"{cell} m", "clock": "2026-03-02 06:00"},
        "durations": {"pick": pick, "drop": drop, "handling": {"line": {family: handling}}},
        "pods": {"join": False},
        "orders": {"lines": {"count": 8000, "mean_interarrival_time": "400/h"}},
        "battery": {
            "drain": {name: f"{value:.4f} %/h" for name, value in drains.items()}
            | {"loaded_factor": factor},
            "charge_rate": "80 %/h",
            "initial_charge": {"from": 50, "to": 100},
            "reserve": 15,
        },
        "strategy": {
            "charging": {"name": "opportunity", "start_below": 80},
            "allocation": {"name": "shortest-job", "idle": "stay", "storage": "fixed"},
            "right_of_way": "pibt",
        },
        "stop": {"when": "never", "max_duration": SHIFT},
        "seed": seed,
    }
    return DrawnSite(scenario, truth)


DRAINS = {
    **dict.fromkeys(("move", "turn", "pick", "drop"), (6.0, 14.0)),
    "wait": (1.0, 3.0),
    "loaded_factor": (1.0, 1.6),
}


def log_of(site: DrawnSite, folder: Path) -> StateLog:
    """Run a site, and read the disturbed messages of its robots.

    The true mean of handling times becomes that of the shift.
    """
    resolved = resolve(site.scenario)
    record, trace, noisy = (folder / name for name in ("run.rec", "trace.jsonl", "noisy.jsonl"))

    def on_end(simulation: Simulation) -> None:
        tally = simulation.world.tally
        ticks, visits = (one[:, ACTION_SERVE].sum() for one in (tally.ticks, tally.operations))
        site.truth["durations.handling"] = float(ticks / visits) * TICK_S

    with Recorder(record, resolved, resolved.scenario.seed) as on_record:
        run_once(resolved, on_record, on_end=on_end)
    with trace.open("wb") as file:
        write_trace(read_recording(record), file)
    disturb(trace, noisy, site.scenario["seed"])
    return read_log([noisy])


def error_of(key: str, value: float, true: float) -> tuple[float, bool]:
    """The relative error of an estimate, and whether it is allowed."""
    share = value / true - 1
    if ".move." in key:
        return share, abs(share) <= SPEED
    if key.rpartition(".")[2] in ("turn", "pick", "drop") and "drain" not in key:
        return share, abs(share) <= SHARE or abs(value - true) <= SECONDS
    return share, abs(share) <= SHARE


def try_sites(number: int) -> int:
    """Fit drawn sites; print errors, the worst ones, and the share of intervals that hold the truth;
    return how many errors are too large."""
    wrong, errors, covered = 0, defaultdict[str, list[float]](list), Counter[str]()
    for seed in range(1, number + 1):
        site = drawn_site(seed)
        with tempfile.TemporaryDirectory() as folder:
            log = log_of(site, Path(folder))
        fits = site_fits.fit_site(log, resolve(site.scenario))
        for key, one in fits.estimates.items():
            kind = key.partition("types.")[2][2:] or key
            true = site.truth.get(key, site.truth.get(kind))
            if true is None:
                continue
            share, is_allowed = error_of(key, one.fit.value, true)
            errors[kind].append(abs(share))
            covered[kind] += one.fit.low <= true <= one.fit.high
            if not is_allowed:
                wrong += 1
                print(f"site {seed}: {key} {one.fit.value:.4g}, true {true:.4g}: {share:+.1%}")
        print(f"site {seed}: {len(log.samples.time):,} messages; {fits.unsaid}", flush=True)
    for kind, shares in errors.items():
        print(f"{kind:28} worst {max(shares):.2%}, in {covered[kind]} of {len(shares)} intervals")
    said = sum(map(len, errors.values()))
    print(
        f"{said} estimates, {wrong} beyond their limits; {covered.total() / said:.1%} of intervals hold"
    )
    return wrong


def observed(rng: np.random.Generator, durations: Any, gap: float) -> Censored:
    """Operations that begin at random times, as messages with a period show them."""
    ends = rng.uniform(0, gap, len(durations)) + durations
    observed = np.floor(ends / gap)
    observed = observed[observed > 0]
    pause = np.full(len(observed), gap)
    return Censored(
        pause, (observed - 1) * gap, pause, np.array([gap]), duration_fits.EVENT_ERROR_S
    )


def coverage(number: int) -> Iterator[tuple[str, float, float]]:
    """Yield the family, the gap and the share of intervals that hold the true mean, which is random."""
    for name, spread in (("uniform", 0.5), ("lognormal", 0.5), ("exponential", 0.0)):
        for gap in (1.0, 2.0, 5.0):
            rng = np.random.default_rng(round(gap) + len(name))
            hits = 0
            for mean in rng.uniform(10, 14, number):
                durations = FAMILIES[name].draw(rng, site_fits.MIN_OPERATIONS, mean, spread)
                fit = fit_family(observed(rng, durations, gap), FAMILIES[name])
                hits += fit.low <= mean <= fit.high
            yield name, gap, hits / number


def try_families(number: int) -> int:
    """Print the coverage of each family and gap; return how many lie outside 93 to 97 %."""
    shares = []
    for name, gap, share in coverage(number):
        shares.append(share)
        print(f"{name:12} gap {gap:g} s: {share:.1%} of {number:,}", flush=True)
    print(f"all: {sum(shares) / len(shares):.1%}")
    return sum(not 0.93 <= share <= 0.97 for share in shares)


def try_thinned(number: int) -> int:
    """Fit one log with fewer and fewer robots, hours and messages; return estimates below their needs."""
    site = drawn_site(1)
    with tempfile.TemporaryDirectory() as folder:
        log = log_of(site, Path(folder))
    resolved = resolve(site.scenario)
    rng = np.random.default_rng(1)
    wrong, said = 0, 0
    for _ in range(number):
        fits = site_fits.fit_site(thinned(log, rng), resolved)
        for key, one in fits.estimates.items():
            said += 1
            wrong += not meets_needs(key, one, fits)
    print(f"{number} logs, {said} estimates, {wrong} below their needs")
    return wrong


def thinned(log: StateLog, rng: np.random.Generator) -> StateLog:
    """A part of a log: some robots, some hours, and every k-th message."""
    samples = log.samples
    begin, end = samples.time.min(), samples.time.max()
    length = (end - begin) * 10 ** rng.uniform(-2.5, 0)
    since = begin + rng.uniform(0, 1) * (end - begin - length)
    keep = (samples.time >= since) & (samples.time <= since + length)
    keep &= rng.random(len(log.robots))[samples.robot] < rng.uniform(0.2, 1)
    keep &= np.arange(len(keep)) % int(10 ** rng.uniform(0, 1.2)) == 0
    keep[:2] = True
    kept = type(samples)(*(column[keep] for column in samples))
    elapsed = np.diff(kept.time)
    usable = (kept.robot[1:] == kept.robot[:-1]) & (elapsed > 0) & (elapsed <= 30_000)
    return log._replace(samples=kept, usable=np.append(usable, False))


def meets_needs(key: str, one: site_fits.Estimate, fits: site_fits.SiteFits) -> bool:
    """Whether an estimate has enough observations, and is longer than the gap between messages."""
    observations = int(one.observed.split()[0].replace(",", ""))
    if "drain" in key:
        return math.isfinite(one.fit.value)
    least = {
        "move": site_fits.MIN_SPEED_PAIRS,
        "turn": site_fits.MIN_TURNS,
        "mtbf": site_fits.MIN_BREAKDOWNS,
    }
    need = next((value for name, value in least.items() if name in key), site_fits.MIN_OPERATIONS)
    long = "move" in key or "faults" in key or one.fit.value >= fits.gap_s
    return observations >= need and long


if __name__ == "__main__":
    trials = {
        "sites": (try_sites, 20),
        "families": (try_families, 1000),
        "thinned": (try_thinned, 100),
    }
    function, usual = trials[sys.argv[1]]
    sys.exit(function(int(sys.argv[2]) if len(sys.argv) > 2 else usual) > 0)
