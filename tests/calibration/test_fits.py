"""Estimates from logs whose truth is known: a robot that drives to and fro, and censored operations."""

from __future__ import annotations

import itertools
import math
from typing import Any

import numpy as np
import pytest
from calibration_trials import coverage, observed

from automaton.calibration import duration_fits, motion_fits, site_fits
from automaton.calibration.battery_fits import fit_charging
from automaton.calibration.duration_fits import FAMILIES, DurationFit, fit_durations, fit_family
from automaton.calibration.fitted_settings import arguments_of, largest_tick, settings_of
from automaton.calibration.log_on_floor import placed
from automaton.calibration.motion_fits import core, median_fit
from automaton.calibration.site_fits import SiteFits, fit_site
from automaton.calibration.state_log import LogCounts, Samples, StateLog, numbers_of_robots
from automaton.world.resolve import resolve

LENGTH = 20  # cells of the lane
SCENARIO: dict[str, Any] = {
    "name": "lane",
    "layout": {"picture": "." * LENGTH + "\n" + "." * LENGTH + "\n" + "." * LENGTH},
    "fleet": {"robots": 2, "kinematics": "differential"},
    "units": {"tick": "0.5 s", "cell": "1 m"},
    "durations": {"move": "1 m/s", "turn": "2 s", "pick": "4 s", "drop": "4 s"},
    "battery": {"drain": {"move": "5 %/h"}, "charge_rate": "60 %/h"},
    "orders": {"generator": "tours", "count": 1},
}
SPEEDS = (0.8, 0.5)  # m/s, without and with a load
TURN, PICK, IDLE, MOVE_DRAIN, WAIT_DRAIN = 3.0, 7.0, 60.0, 12.0, 2.0
SLOW = (8.0, 12.0)  # metres from the left within which robots drive at half of the speed


def lane_log(
    hours: float, gap: float, slow: bool = False, noise: float = 0.0, pick: float = PICK
) -> StateLog:
    """Robot 0 drives to and fro on the upper row; it picks at the left end and drops at the right one."""
    legs: list[
        tuple[float, float, float, int, int, int]
    ] = []  # begin, x, speed, heading, load, action
    clock, load = 0.0, 0
    draws = np.random.default_rng(1)
    while clock < hours * 3600:
        for heading in (0, 2):
            ends = [0.5, *(SLOW if slow else ()), LENGTH - 0.5]
            ends = ends if heading == 0 else ends[::-1]
            for number, (begin, end) in enumerate(itertools.pairwise(ends)):
                speed = SPEEDS[load] / (2 if number == 1 else 1) * (1 if heading == 0 else -1)
                legs.append((clock, begin, speed, heading, load, 0))
                clock += (end - begin) / speed
            legs.append((clock, ends[-1], 0.0, heading, load, 1 + load))
            clock += pick
            load = 1 - load
            legs.append((clock, ends[-1], 0.0, heading, load, 0))
            clock += draws.uniform(0, IDLE)
            for turned in (1, 2):  # a turn shows at its end
                legs.append((clock, ends[-1], 0.0, (heading + turned - 1) % 4, load, 0))
                clock += TURN
    begins = np.array([leg[0] for leg in legs])
    times = np.arange(0, clock - 1, gap) + draws.uniform(0, 0.01)
    at = np.searchsorted(begins, times, side="right") - 1
    _, x, speed, heading, loads, action = (
        np.array(column)[at] for column in zip(*legs, strict=True)
    )
    place = x + speed * (times - begins[at]) + noise * draws.normal(size=len(times))
    drain = np.where(speed != 0, MOVE_DRAIN, WAIT_DRAIN) / 3600
    charge = 100 - np.cumsum(np.append(0.0, (drain * gap)[:-1]))
    ids = np.where(action > 0, at, 0)
    return log_of(times, place, heading, loads, charge, speed != 0, action, ids)


def log_of(
    times: np.ndarray,
    x: np.ndarray,
    heading: np.ndarray,
    load: np.ndarray,
    charge: np.ndarray,
    driving: np.ndarray,
    action: np.ndarray,
    ids: np.ndarray,
) -> StateLog:
    n = len(times)
    samples = Samples(
        robot=np.zeros(n, np.int32),
        time=np.round(times * 1000).astype(np.int64),
        x=x,
        y=np.full(n, 2.5),
        theta=-heading * math.pi / 2,
        load=load.astype(np.int32),
        charge=charge,
        charging=np.zeros(n, np.int8),
        driving=driving.astype(np.int8),
        action=action.astype(np.int32),
        action_id=ids.astype(np.int64),
        order=np.ones(n, np.int32),
        down=np.zeros(n, bool),
    )
    counts = LogCounts(n, n, {}, 0, 0, 0, 0, 0, {})
    usable = np.append(np.diff(samples.time) <= 30_000, False)
    return StateLog(samples, ("0",), ("1",), ("pick", "drop"), ("1",), usable, counts)


def fits_of(log: StateLog) -> SiteFits:
    return fit_site(log, resolve(SCENARIO))


def test_a_turn_counts_where_a_log_calls_it_driving() -> None:
    """Ten cells east at 1 m/s, a turn of 2.5 s that shows at half of it, two cells south; 60 times."""
    lap = np.arange(0, 14.5, 0.5)
    x = 0.5 + np.minimum(lap, 10)
    y = 2.5 - np.clip(lap - 12.5, 0, 2)
    times = np.concatenate([lap + 60 * k for k in range(60)])
    heading, rest = np.where(lap < 11.25, 0, 1), np.zeros(len(times))
    log = log_of(times, np.tile(x, 60), np.tile(heading, 60), rest, rest, rest == 0, rest, rest)
    log = log._replace(samples=log.samples._replace(y=np.tile(y, 60)))
    assert fits_of(log).estimates["durations.turn"].fit.value == pytest.approx(2.5, abs=0.1)


def test_a_robot_is_not_ahead_of_itself() -> None:
    log = lane_log(0.1, 1.0)
    shift = np.random.default_rng(3).integers(-450, 450, len(log.samples.time))
    one = log._replace(samples=log.samples._replace(time=log.samples.time + shift))
    scenario = resolve(SCENARIO)
    assert not placed(one, scenario.floor_plan, scenario.scenario.units).near.any()
    # Another robot does the same three seconds earlier.
    other = one.samples._replace(robot=one.samples.robot + 1, time=one.samples.time - 3000)
    both = Samples(*map(np.concatenate, zip(one.samples, other, strict=True)))
    two = one._replace(samples=both, robots=("0", "1"), usable=np.tile(one.usable, 2))
    near = placed(two, scenario.floor_plan, scenario.scenario.units).near
    assert near[: len(shift)].mean() > 0.2


@pytest.fixture(scope="module")
def shift() -> SiteFits:
    """A shift with a message a second, positions with an error of 2 cm."""
    return fits_of(lane_log(17, 1.0, noise=0.02))


def test_a_shift_gives_speeds_by_load_turns_picks_and_energy_use(shift: SiteFits) -> None:
    truth = {
        "durations.move.empty": (SPEEDS[0], 0.02),
        "durations.move.loaded": (SPEEDS[1], 0.02),
        "durations.pick": (PICK, 0.03),
        "durations.drop": (PICK, 0.03),
        "battery.drain.move": (MOVE_DRAIN, 0.05),
        "battery.drain.wait": (WAIT_DRAIN, 0.05),
    }
    for key, (value, tolerance) in truth.items():
        assert shift.estimates[key].fit.value == pytest.approx(value, rel=tolerance), key
    assert shift.operations["pick"].family == "constant"
    assert any("handling: the log has no action serve" in line for line in shift.unsaid)


def test_settings_run_in_the_scenario_and_their_tick_fits_the_times(shift: SiteFits) -> None:
    settings = settings_of(shift, SCENARIO)
    fitted = resolve(SCENARIO, arguments_of(settings))
    moves = fitted.scenario.durations.moves
    assert (moves.empty, moves.loaded) == (3, 4), "0.8 m/s in ticks of 0.5 s is 2.5 of them"
    tick = largest_tick(fitted)
    assert tick is not None and tick <= 0.25
    assert largest_tick(resolve(SCENARIO)) is None


def test_picks_of_a_type_are_fitted_if_they_differ_from_those_of_the_others() -> None:
    one, other = lane_log(17, 2.0), lane_log(17, 2.0, pick=9.0)
    both = Samples(*map(np.concatenate, zip(one.samples, other.samples, strict=True)))
    rows = np.arange(len(both.x)) >= len(one.samples.x)
    both = both._replace(robot=rows.astype(np.int32), y=np.where(rows, 0.5, 2.5))
    both = both._replace(charge=both.charge * np.nan)
    usable = np.append(one.usable, other.usable)
    types = [{"name": "a", "robots": 1}, {"name": "b", "robots": 1}]
    scenario = {**SCENARIO, "fleet": {**SCENARIO["fleet"], "types": types}}
    log = one._replace(samples=both, usable=usable, robots=("0", "1"))
    fits = fit_site(log, resolve(scenario))
    for name, seconds in (("a", PICK), ("b", 9.0)):
        fit = fits.estimates[f"fleet.types.{name}.durations.pick"].fit
        assert fit.value == pytest.approx(seconds, rel=0.02)
    settings = settings_of(fits, scenario)
    pick = settings["fleet"]["types"][1]["durations"]["pick"]
    assert float(pick.removesuffix(" s")) == pytest.approx(9, rel=0.02)
    assert "durations" not in settings, "the mixture of both looks uniform"


def test_charges_in_whole_percent_say_what_motion_uses_but_not_what_picks_use() -> None:
    log = lane_log(17, 4.0)
    charge = np.round(log.samples.charge)
    fits = fits_of(log._replace(samples=log.samples._replace(charge=charge)))
    drain = fits.estimates["battery.drain.move"].fit
    assert drain.low <= MOVE_DRAIN <= drain.high and drain.high - drain.low < MOVE_DRAIN / 2
    for name in ("pick", "drop"):  # one of each in every lap
        assert f"battery.drain.{name}" not in fits.estimates
        assert any(f"{name}: " in line and "not separable" in line for line in fits.unsaid)


def test_too_few_observations_are_named_and_not_fitted() -> None:
    short = fits_of(lane_log(0.5, 1.0))
    assert "durations.pick" not in short.estimates and "battery.drain.move" not in short.estimates
    named = "\n".join(short.unsaid)
    assert "durations.pick: " in named and "of at least 384 operations" in named
    assert "h of at least 2 h a robot" in named


def test_what_is_shorter_than_the_gap_between_messages_is_refused_by_name() -> None:
    rare = fits_of(lane_log(23, 9.0))
    assert "durations.pick" not in rare.estimates
    assert "durations.pick: shorter than the median gap between messages, 9 s" in rare.unsaid
    assert rare.estimates["durations.move.empty"].fit.value == pytest.approx(SPEEDS[0], rel=0.02)


def test_a_slow_stretch_is_listed_with_its_cells_and_speed() -> None:
    log = lane_log(6, 1.0, slow=True)
    (slow,) = fits_of(log).slow
    assert slow.first[1] == slow.last[1] == 0
    assert abs(slow.first[0] - 8) <= 1 and abs(slow.last[0] - 11) <= 1
    assert slow.speed.value == pytest.approx(SPEEDS[0] / 2, rel=0.1)
    half = site_fits.Thresholds(slow_share=0.55)
    assert fit_site(log, resolve(SCENARIO), thresholds=half).slow == []


def test_intervals_of_each_family_hold_the_mean_at_gaps_of_1_2_and_5_seconds() -> None:
    shares = [share for _, _, share in coverage(2)]
    assert len(shares) == 9 and np.mean(shares) >= 0.75


def test_operations_that_no_message_sees_do_not_bias_the_mean() -> None:
    rng = np.random.default_rng(2)
    data = observed(rng, rng.exponential(6.0, 2000), 5.0)
    assert data.n < 1400 and data.middles.mean() > 8
    fit = fit_family(data, FAMILIES["exponential"])
    assert fit.low <= 6.0 <= fit.high


def test_the_family_is_chosen_by_aic_and_its_observed_times_are_a_list() -> None:
    rng = np.random.default_rng(3)
    data = observed(rng, rng.uniform(4, 16, 400), 1.0)
    fit = fit_durations(data)._replace(empirical=duration_fits.empirical_quantiles(data))
    assert fit.family == "uniform" and fit.p > duration_fits.REJECTED
    assert np.mean(fit.empirical) == pytest.approx(10, rel=0.05)
    settings = settings_of(with_handling(fit), {})
    assert set(settings["durations"]["handling"]["line"]["uniform"]) == {"from", "to"}
    listed = settings_of(with_handling(fit), {}, is_empirical=True)
    assert len(listed["durations"]["handling"]["line"]["empirical"]) == duration_fits.QUANTILES


def with_handling(fit: DurationFit) -> SiteFits:
    return SiteFits(1.0, 1, 1.0, {}, [], [], {"handling": fit}, None, None, False, (), [])


def test_obstructed_drives_do_not_lower_the_speed() -> None:
    rng = np.random.default_rng(4)
    speeds = np.concatenate((rng.normal(1.0, 0.02, 700), rng.uniform(0.2, 1.0, 300)))
    assert median_fit(core(speeds)).value == pytest.approx(1.0, rel=0.01)
    assert np.median(speeds) < 0.99


def test_breakdowns_have_an_exact_poisson_interval() -> None:
    fit = motion_fits.poisson_fit(10, 1000.0)
    assert (fit.low * 1000, fit.high * 1000) == pytest.approx((4.795, 18.39), rel=1e-3)
    assert motion_fits.poisson_fit(0, 100.0).low == 0


def test_charging_slows_down_where_the_log_shows_it() -> None:
    seconds = np.arange(0.0, 9000, 2)
    charge = np.minimum(20 + seconds / 100, 80 + (seconds - 6000) / 300)
    none = seconds * 0
    log = log_of(seconds, none + 0.5, none, none, charge, none > 0, none, none)
    log = log._replace(samples=log.samples._replace(charging=np.ones(len(seconds), np.int8)))
    lane = resolve(SCENARIO)
    track = placed(log, lane.floor_plan, lane.scenario.units)
    (_, fast), (start, slow) = fit_charging(track)
    assert (fast.value, slow.value, start) == pytest.approx((0.01, 1 / 300, 80), rel=0.02)
    assert fast.low <= 0.01 <= fast.high < 0.0102


def test_names_of_robots_that_are_numbers_tell_their_types() -> None:
    assert numbers_of_robots(("3", "0"), 4).tolist() == [3, 0]
    assert numbers_of_robots(("agv-10", "agv-9", "agv-1"), 4).tolist() == [2, 1, 0]


def test_operations_are_those_of_vda_5050_by_default() -> None:
    assert site_fits.OPERATIONS == {"pick": "pick", "drop": "drop", "handling": "serve"}
