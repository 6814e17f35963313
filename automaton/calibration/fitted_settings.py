"""Estimates as settings of a scenario: a file for `--set @FILE`, with intervals as comments.

The scenario itself is never changed. Where a section of it can only be replaced completely, as a list of
types, the rest of the section is copied.
"""

from __future__ import annotations

import copy
from collections.abc import Iterator, Mapping
from typing import Any, Final

import numpy as np
import yaml

from automaton.calibration.duration_fits import DurationFit
from automaton.calibration.site_fits import HOUR, Estimate, SiteFits
from automaton.world.conversion_table import TICKS_TO_CHOOSE_FROM, TOLERANCE, roundings, tick_values
from automaton.world.resolve import Resolved, resolve

Settings = dict[str, Any]
SAME_WIDTH: Final = 0.2  # relative difference of two uniform distributions with one jitter
SETTING_DIGITS: Final = 4
WIDTH: Final = 100


def settings_of(fits: SiteFits, data: Mapping[str, Any], is_empirical: bool = False) -> Settings:
    """The settings of all estimates; `data`: the scenario as written, `is_empirical`: handling times as
    a list instead of a family."""
    sections = {
        "fleet": _types(fits, data.get("fleet", {})),
        "durations": _durations(fits, data, is_empirical),
        "battery": _battery(fits, data.get("battery")),
        "faults": _faults(fits, data.get("faults", {})),
        "floor": _floor(fits, data.get("floor", {})),
    }
    return {name: section for name, section in sections.items() if section}


def arguments_of(settings: Settings) -> list[str]:
    """The settings as KEY=VALUE, as `--set @FILE` reads them."""
    return [
        f"{section}.{key}={yaml.safe_dump(value, default_flow_style=True, width=10**9).strip()}"
        for section, part in settings.items()
        for key, value in part.items()
    ]


def rounded(value: float) -> float:
    """A value with four significant digits."""
    return float(f"{value:.{SETTING_DIGITS}g}")


def with_unit(value: float, unit: str) -> str:
    """A value as a scenario writes it: 1.197 m/s."""
    digits = rounded(value)
    text = f"{int(digits)}" if digits == int(digits) else np.format_float_positional(digits)
    return f"{text} {unit}"


def _drive(fits: SiteFits, prefix: str) -> Settings:
    """The speeds and the turn of the fleet, or of the type that `prefix` names."""
    speeds = {
        load: with_unit(fit.fit.value, "m/s")
        for load in ("empty", "loaded")
        if (fit := fits.estimates.get(f"{prefix}durations.move.{load}"))
    }
    turn = _seconds(fits, prefix, "turn")
    if not speeds:
        return turn
    # A single one: the log knows no loads, or no robot drove with one.
    return {"move": speeds if len(speeds) > 1 else next(iter(speeds.values())), **turn}


def _seconds(fits: SiteFits, prefix: str, *names: str, less: float = 0.0) -> Settings:
    """Fitted durations, `less` some seconds."""
    keys = {name: f"{prefix}durations.{name}" for name in names}
    return {
        name: with_unit(fits.estimates[key].fit.value - less, "s")
        for name, key in keys.items()
        if key in fits.estimates
    }


def _jitter(fits: SiteFits) -> float:
    """Seconds of handling_jitter: the width of picks and drops, if all are uniform and equally wide."""
    of_types = [fit for key, fit in fits.operations.items() if key.startswith("fleet.types.")]
    of_fleet = [fits.operations[name] for name in ("pick", "drop") if name in fits.operations]
    operations = of_types or of_fleet  # those of types that differ are a mixture for the fleet
    widths = [2 * fit.mean * fit.spread for fit in operations if fit.family == "uniform"]
    if len(widths) < max(2, len(operations)) or np.ptp(widths) >= SAME_WIDTH * max(widths):
        return 0.0
    return sum(widths) / len(widths)


def _types(fits: SiteFits, fleet: Mapping[str, Any]) -> Settings:
    types = copy.deepcopy(fleet.get("types") or [])
    fitted: list[Settings] = []
    for entry in types:
        prefix, less = f"fleet.types.{entry.get('name')}.", _jitter(fits) / 2
        fitted.append(_drive(fits, prefix) | _seconds(fits, prefix, "pick", "drop", less=less))
        if fitted[-1]:
            entry["durations"] = entry.get("durations", {}) | fitted[-1]
        if "move" in fitted[-1]:
            entry.pop("move_time_factor", None)
    return {"types": types} if any(fitted) else {}


def _durations(fits: SiteFits, data: Mapping[str, Any], is_empirical: bool) -> Settings:
    jitter = _jitter(fits)
    out = _drive(fits, "") | _seconds(fits, "", "pick", "drop", less=jitter / 2)
    if jitter:
        out["handling_jitter"] = with_unit(jitter, "s")
    if handling := fits.operations.get("handling"):
        out["handling"] = _handling(handling, is_empirical)
    return out


def _handling(fit: DurationFit, is_empirical: bool) -> Settings:
    """The handling of a visit: its duration is that of a single line."""
    if is_empirical:
        return {"line": {"empirical": [f"{one:g} s" for one in fit.empirical]}}
    if fit.family == "constant":
        return {"visit": with_unit(fit.mean, "s")}
    return {"line": distribution(fit)}


def distribution(fit: DurationFit) -> Settings:
    """A fitted family as scenarios write it."""
    if fit.family == "uniform":
        ends = (fit.mean * (1 - fit.spread), fit.mean * (1 + fit.spread))
        return {"uniform": {"from": with_unit(ends[0], "s"), "to": with_unit(ends[1], "s")}}
    if fit.family == "lognormal":
        sd = fit.mean * fit.spread
        return {"lognormal": {"mean": with_unit(fit.mean, "s"), "sd": with_unit(sd, "s")}}
    return {"exponential": with_unit(fit.mean, "s")}


def _battery(fits: SiteFits, battery: Mapping[str, Any] | None) -> Settings:
    prefix = "battery.drain."
    drains: Settings = {
        key.removeprefix(prefix): with_unit(one.fit.value, "%/h")
        if one.unit
        else rounded(one.fit.value)
        for key, one in fits.estimates.items()
        if key.startswith(prefix)
    }
    steps = [[start, with_unit(rate.value * HOUR, "%/h")] for start, rate in fits.charging]
    rate = steps[0][1] if len(steps) == 1 else steps
    if battery is None and not ("move" in drains and steps):
        return {}
    out: Settings = {}
    if drains:
        out["drain"] = {**(battery or {}).get("drain", {}), **drains}
    if steps:
        out["charge_rate"] = rate
    return out


def _faults(fits: SiteFits, faults: Mapping[str, Any]) -> Settings:
    out: Settings = {}
    if mtbf := fits.estimates.get("faults.mtbf"):
        out["mtbf"] = with_unit(mtbf.fit.value, "h")
        if faults.get("failure_probability"):
            out["failure_probability"] = 0
        if fits.repair and fits.towed:
            out["repair_time"] = with_unit(fits.repair.mean, "s")
        elif fits.repair:
            is_constant = fits.repair.family == "constant"
            out["repair_in_place"] = (
                with_unit(fits.repair.mean, "s") if is_constant else distribution(fits.repair)
            )
    if fits.delays and fits.delays.length:
        mean, half = fits.delays.length.value, 3**0.5 * float(fits.delays.lengths.std())
        ends = max(mean - half, float(fits.delays.lengths.min())), mean + half
        out["delays"] = {
            "probability": with_unit(fits.delays.rate.value * HOUR, "/h").replace(" ", ""),
            "ticks": {"from": with_unit(ends[0], "s"), "to": with_unit(ends[1], "s")},
        }
    return out


def _floor(fits: SiteFits, floor: Mapping[str, Any]) -> Settings:
    if not fits.slow:
        return {}
    limits = [
        {"cells": [list(one.first), list(one.last)], "max_speed": with_unit(one.speed.value, "m/s")}
        for one in fits.slow
    ]
    fitted = [limit["cells"] for limit in limits]
    others = [
        limit for limit in floor.get("speed_limits") or [] if limit.get("cells") not in fitted
    ]
    return {"speed_limits": [*copy.deepcopy(others), *limits]}


def largest_tick(fitted: Resolved) -> float | None:
    """The largest tick that converts all times within 2 %, in seconds; None: that of the scenario does,
    or no tick does."""
    scale = fitted.scenario.units.scale
    times = [
        one for one in roundings(fitted) if not one.conversion.is_moment and one.counted != "cell"
    ]
    if all(abs(one.error) <= TOLERANCE for one in times):
        return None
    for tick in TICKS_TO_CHOOSE_FROM:
        if all(one.error_with(tick, scale.tick_seconds) <= TOLERANCE for one in times):
            return float(tick)
    return None


def plain_numbers(
    scenario: Any, arguments: list[str], data: Mapping[str, Any], tick: float
) -> list[str]:
    """The keys of a scenario that are in ticks, so that another tick would change what they mean."""
    values, others = (
        tick_values(resolve(scenario, [*arguments, *more]).scenario)
        for more in ([], [f"units.tick={tick:g} s"])
    )
    return [
        key
        for key, value in values.items()
        if value > 1 and others.get(key) == value and _is_written(data, key)
    ]


def _is_written(data: Any, key: str) -> bool:
    for part in key.replace("[", ".").replace("]", "").split("."):
        if isinstance(data, list) and part.isdecimal() and int(part) < len(data):
            data = data[int(part)]
        elif isinstance(data, Mapping) and part in data:
            data = data[part]
        else:
            return False
    return True


def settings_text(settings: Settings, fits: SiteFits, source: str) -> str:
    """The file of settings."""
    lines = [f"# Fitted to {source}. Apply with --set @FILE. Values with 95 % intervals:"]
    lines += [f"#   {line}" for line in interval_lines(fits)]
    if fits.unsaid:
        lines += ["# Not fitted, so the scenario keeps its values:"]
        lines += [f"#   {line}" for line in fits.unsaid]
    body = yaml.safe_dump(settings, sort_keys=False, default_flow_style=None, width=WIDTH)
    return "\n".join([*lines, body if settings else "{}\n"])


def interval_lines(fits: SiteFits) -> Iterator[str]:
    """Each estimate with its interval."""
    for one in fits.estimates.values():
        yield f"{one.key}: {interval_words(one)}; {one.observed}"
    for start, fit in fits.charging:
        value, low, high = (one * HOUR for one in fit[:3])
        yield f"battery.charge_rate from {start:g} %: {value:.4g} %/h ({low:.4g} to {high:.4g})"
    for slow in fits.slow:
        ends = f"{slow.first[0]},{slow.first[1]} to {slow.last[0]},{slow.last[1]}"
        speed = slow.speed
        yield f"floor.speed_limits {ends}: {speed.value:.4g} m/s ({speed.low:.4g} to {speed.high:.4g})"


def interval_words(one: Estimate) -> str:
    """An estimate with its unit and its interval."""
    low, high = (f"{end:.4g}" for end in one.fit[1:3])
    return f"{one.fit.value:.4g} {one.unit}".strip() + f" ({low} to {high})"
