"""What a run is called: scenario, fleet, seed and settings; beside another one the difference first.

tabletop-mini, 3 robots, seed 1, right_of_way=wait, from tick 140 right_of_way=retreat
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Final, NamedTuple

from automaton.evidence.recording.contents import Content
from automaton.evidence.recording.frames import Recording, StoredFrames
from automaton.scenario.orders import plain_data
from automaton.world.resolve import Resolved

MAX_TITLE_LENGTH: Final = 24  # characters of a value; pictures of floors are values too


class Head(NamedTuple):
    """Over one of two maps."""

    own: str  # in what it differs from the run beside it
    common: str  # what both have


def title_of(resolved: Resolved, seed: int, frames: StoredFrames | None = None) -> str:
    """A run in a few words; `frames` say where it was branched off."""
    branches = () if frames is None else branches_of(frames)
    return ", ".join((*_parts(resolved, seed), *branches))


def branches_of(frames: StoredFrames) -> tuple[str, ...]:
    """From which tick on other settings held. Raises InputError."""
    said: list[str] = []
    tick: int | None = 0
    while tick is not None:
        settings = frames.rules_at(tick)["settings"]
        if settings:
            said.append(f"from tick {tick:,} {' '.join(short(one) for one in settings)}")
        tick = frames.next_rules(tick)
    return tuple(said)


def heads_of(
    names: Sequence[str], recordings: Sequence[Recording], resolved: Sequence[Resolved]
) -> tuple[Head, ...]:
    """Of two recordings."""
    seeds = [recording.header["seed"] for recording in recordings]
    branches = [branches_of(recording.stored()) for recording in recordings]
    settings = _differing(recordings)
    parts = [_parts(one, seed) for one, seed in zip(resolved, seeds, strict=True)]
    heads = []
    for side, (name, recording) in enumerate(zip(names, recordings, strict=True)):
        own = list(settings[side])
        own += [f"seed {seeds[side]}"] if len(set(seeds)) > 1 else []
        own += branches[side] if len(set(branches)) > 1 else ()
        own += [] if recording.complete else ["cut short"]
        common = [part for part in parts[side] if part in parts[1 - side]]
        common += branches[side] if len(set(branches)) == 1 else ()
        heads.append(Head(f"{name}: {', '.join(own)}" if own else name, ", ".join(common)))
    return tuple(heads)


def live_heads(one: Resolved, other: Resolved) -> tuple[Head, ...]:
    """Of two live runs."""
    resolved = (one, other)
    scenarios = [_flat("", plain_data(each.scenario)) for each in resolved]
    settings = _different(scenarios, scenarios)
    parts = [_parts(each, each.scenario.seed) for each in resolved]
    common = ", ".join(part for part in parts[0] if part in parts[1])
    seeds = [each.scenario.seed for each in resolved]
    heads = []
    for own, seed in zip(settings, seeds, strict=True):
        own += [f"seed {seed}"] if len(set(seeds)) > 1 else []
        heads.append(Head(", ".join(own) or "the same", common))
    return tuple(heads)


def short(setting: str) -> str:
    """A setting as it is commonly known."""
    return setting.removeprefix("strategy.")


def _parts(resolved: Resolved, seed: int) -> tuple[str, ...]:
    robots = resolved.scenario.fleet.robots
    crew = f"{robots:,} robot{'s' if robots != 1 else ''}"
    overrides = (short(one) for one in resolved.overrides)
    return (resolved.scenario.name, crew, f"seed {seed}", *overrides)


def _differing(recordings: Sequence[Recording]) -> list[list[str]]:
    """The settings at the start that differ then, or did at the end."""
    starts = [_flat("", recording.header["scenario"]) for recording in recordings]
    ends = [_flat("", _last_scenario(recording.stored())) for recording in recordings]
    return _different(starts, ends)


def _different(starts: list[dict[str, str]], ends: list[dict[str, str]]) -> list[list[str]]:
    keys = [
        key
        for key in dict.fromkeys(key for settings in starts for key in settings)
        if key != "seed" and any(len({s.get(key) for s in both}) > 1 for both in (starts, ends))
    ]
    return [[f"{short(key)}={start.get(key, 'none')}" for key in keys] for start in starts]


def _last_scenario(frames: StoredFrames) -> Content:
    scenario: Content = frames.rules_at(frames.last_tick)["scenario"]
    return scenario


def _flat(key: str, value: Any) -> dict[str, str]:
    if isinstance(value, dict):
        prefix = f"{key}." if key else ""
        flat: dict[str, str] = {}
        for name, inner in value.items():
            flat |= _flat(f"{prefix}{name}", inner)
        return flat
    text = " ".join(str(value).split())
    return {key: text if len(text) <= MAX_TITLE_LENGTH else f"{text[: MAX_TITLE_LENGTH - 3]}..."}
