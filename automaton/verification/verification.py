"""Verification: a recording is checked against the rules, then run again and compared tick by tick.

Everything is repeated and compared, except for NOT_COMPARED of the header.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Final, NamedTuple

import msgspec
import numpy as np

from automaton.engine.decision_stream import first_other_tick
from automaton.engine.digest import DIGEST_NAMES
from automaton.engine.record_codes import (
    ACTION_MASK,
    DROPPED_ON_ARRIVAL,
    ENTERED_PARKING_BAY,
    LEFT_PARKING_BAY,
    PICKED_ON_ARRIVAL,
)
from automaton.engine.state import (
    Array,
)
from automaton.errors import InputError
from automaton.recording.contents import (
    FRAME_KIND_CONDITIONS,
    FRAME_KIND_END,
    FRAME_KIND_KEYFRAME,
    FRAME_KIND_TICKS,
    KEYFRAME_ARRAYS,
    Content,
    DecodedFrame,
)
from automaton.recording.frames import (
    Recording,
    changed,
    header_of,
    resolved_of,
    rules_of,
    state_of,
)
from automaton.recording.recording_reader import read_recording
from automaton.runs.illegal_decisions import IllegalDecisions, illegal_decisions
from automaton.runs.metrics import metrics_of
from automaton.runs.provenance import changed_sources, file_hashes, loaded_sources
from automaton.runs.simulation import Simulation
from automaton.scenario.floor_section import floor_of, is_shipped
from automaton.scenario.schema import Scenario
from automaton.scenario.text_files import content_hash
from automaton.strategy.lookup import files_of
from automaton.verification.validator import ACTS, Report, validate_stored
from automaton.world.floor_parts import (
    with_limits_and_streets,
    with_open_places,
    with_shared_chargers,
)
from automaton.world.resolve import Resolved, branched

# Fields of a header that do not affect the run: not compared.
NOT_COMPARED: Final = ("text", "overrides", "sources", "versions", "files", "digest_every")

Show = Callable[[str, int], None]  # reports the current activity, and its last tick

LONG_LIST: Final = 100  # most values in a text


class Difference(NamedTuple):
    """The first difference between the repeated run and the recording."""

    tick: int
    array: str  # of the state, such as robots.cell; or "header", "actions", "changes", "end", ...
    text: str

    def __str__(self) -> str:
        return f"tick {self.tick}: {self.array} differs{': ' if self.text else ''}{self.text}"


@dataclass(frozen=True)
class Verification:
    """The result of a verification."""

    recording: Recording
    report: Report  # of the validator
    difference: Difference | None  # None: the recording agrees
    changed_sources: list[str]  # how the installed code differs from the recorded one
    changed_files: tuple[str, ...]  # read by a strategy, and changed since
    illegal: IllegalDecisions  # of the repeated run

    @property
    def passed(self) -> bool:
        """Whether the recording follows the rules and the repeated run is equal."""
        return self.report.valid and self.difference is None


def verify(path: str | Path) -> Verification:
    """Verify a recording's file up to its last whole frame. Raises InputError."""
    return verify_recording(read_recording(path))


def verify_recording(recording: Recording, show: Show = lambda what, tick: None) -> Verification:
    """Verify a recording that is open or in memory; `show` is called with the progress."""
    header = recording.header
    plugins = tuple(one["name"] for one in header["strategies"].values() if ":" in one["name"])
    files = changed_files(recording)
    try:
        rerun, difference = first_difference(shown(recording, "run again", show))
    except InputError as error:
        if not files:
            raise
        names = ", ".join(files)
        raise InputError(f"{names} changed after the run was recorded: {error}") from error
    return Verification(
        recording=recording,
        report=validate_stored(shown(recording, "rules", show)),
        difference=difference,
        changed_sources=changed_sources(header["sources"], loaded_sources(plugins)),
        changed_files=files,
        illegal=illegal_decisions(rerun.simulation.world, rerun.simulation.resolved.floor_plan),
    )


def shown(recording: Recording, what: str, show: Show) -> Recording:
    """A recording that reports the progress of its iteration."""

    def frames() -> Iterator[DecodedFrame]:
        for frame in recording.frames:
            yield frame
            if frame.kind == FRAME_KIND_TICKS:
                show(what, frame.content["first"] + len(frame.content["executed"]) - 1)

    return replace(recording, frames=frames())


def changed_files(recording: Recording) -> tuple[str, ...]:
    """The files read by its strategies that are missing or have changed."""
    parts = [recording.header]
    parts += [frame.content for frame in recording.frames if frame.kind == FRAME_KIND_CONDITIONS]
    recorded = {file: found for part in parts for file, found in part.get("files", {}).items()}
    return tuple(file for file, found in recorded.items() if content_hash(Path(file)) != found)


def first_difference(recording: Recording) -> tuple[Rerun, Difference | None]:
    """Run the scenario again and compare each tick; returns the run and its first difference."""
    rerun = Rerun(recording.header)
    compare = {
        FRAME_KIND_TICKS: rerun.compare,
        FRAME_KIND_KEYFRAME: rerun.compare_state,
        FRAME_KIND_CONDITIONS: rerun.change,
        FRAME_KIND_END: rerun.compare_end,
    }
    found = rerun.compare_header()
    for kind, content in recording.frames:
        found = found or compare[kind](content)
        if found is not None:
            break
    return rerun, found


class Rerun:
    """The repeated run, one frame of the recording at a time."""

    def __init__(self, header: Content) -> None:
        self.header = header
        self._parts: list[tuple[Array, Array, Array, Array]] = []
        self.simulation = Simulation(resolved_of(header), header["seed"], on_record=self._take)
        self._due = int(header["digest_every"])
        self.simulation.world.clock.digest_every = self._due

    def _take(self, simulation: Simulation) -> None:
        clock, record = simulation.world.clock, simulation.record
        rows, changed = int(clock.recorded_ticks), int(clock.change_rows)
        decided = int(clock.decision_words)
        self._parts.append(
            (
                record.executed[:rows].copy(),
                record.decisions[:decided].copy(),
                record.changes[:changed].copy(),
                record.digests[:rows].copy(),
            )
        )
        simulation.empty_record()

    def compare_header(self) -> Difference | None:
        """Compare the state at tick 0, which follows from the scenario and the seed."""
        resolved, world = self.simulation.resolved, self.simulation.world
        now = header_of(resolved, self.simulation.seed, world, DIGEST_NAMES)
        found = _unequal(self.header, now, NOT_COMPARED)
        if found is None and not _has_files(self.header, resolved):
            found = "files"
        if found is None and drawn_otherwise(resolved):
            found = "floor"
        text = f"{found} does not follow from scenario and seed"
        return None if found is None else Difference(0, "header", text)

    def change(self, rules: Content) -> Difference | None:
        """Branch off like the recorded run."""
        tick = self.simulation.tick
        if tick or rules["settings"]:
            before = self.simulation.resolved
            resolved = resolved_of(changed(self.header, rules))
            if resolved.scenario != as_branched(before, resolved, tuple(rules["settings"])):
                return Difference(tick, "conditions", "they do not match the settings")
            self.simulation = self.simulation.continue_with(resolved)
            self.simulation.world.clock.digest_every = self._due
        now = rules_of(self.simulation, rules["settings"])
        found = _unequal(rules, now, ("files",))
        if found is None and not _has_files(rules, self.simulation.resolved):
            found = "files"
        return None if found is None else Difference(tick, "conditions", found)

    def compare_state(self, content: Content) -> Difference | None:
        """Compare the state after a tick."""
        now = state_of(self.simulation.world, KEYFRAME_ARRAYS)
        found = _unequal(content, {"tick": self.simulation.tick, **now})
        return Difference(self.simulation.tick, "state", found) if found else None

    def compare(self, content: Content) -> Difference | None:
        """Run through the ticks of a frame and compare them."""
        first, ticks = content["first"], len(content["executed"])
        self.simulation.run(until=first + ticks - 1)
        parts = zip(*self._parts, strict=True)
        did, decisions, changes, digests = (np.concatenate(part) for part in parts)
        self._parts.clear()
        if self.simulation.tick < first + ticks - 1:
            return Difference(self.simulation.tick, "end", "the repeated run ends here")
        if did.shape != content["executed"].shape:
            return Difference(first, "record", "ticks are missing or repeated")
        found = (
            self._digests(first, content["digests"], digests),
            _actions(first, content["executed"], did),
            _decisions(first, content["decisions"], decisions),
            _changes(content["changes"], changes),
        )
        return min(filter(None, found), key=lambda difference: difference.tick, default=None)

    def _digests(self, first: int, recorded: Array, ours: Array) -> Difference | None:
        due = (first + np.arange(len(ours))) % self._due == 0
        differs = recorded != np.where(due[:, None], ours, np.uint64(0))
        rows = np.flatnonzero(differs.any(axis=1))
        if not len(rows):
            return None
        if not recorded[rows[0]].any():
            return Difference(first + int(rows[0]), "digests", "they are missing")
        arrays = [DIGEST_NAMES[column] for column in np.flatnonzero(differs[rows[0]])]
        others = f"also {', '.join(arrays[1:])}" if len(arrays) > 1 else ""
        return Difference(first + int(rows[0]), arrays[0], others)

    def compare_end(self, content: Content) -> Difference | None:
        """Compare the end of the run."""
        simulation = self.simulation
        ended = {
            "ticks": simulation.tick,
            "finished": simulation.finished,
            "digest": simulation.digest,
        }
        for name, value in ended.items():
            if content[name] != value:
                text = f"{name} was {content[name]}, in the repeated run {value}"
                return Difference(simulation.tick, "end", text)
        figures, again = content["metrics"], metrics_of(simulation)
        for name in dict.fromkeys((*again, *figures)):
            was, now = (_number(part.get(name)) for part in (figures, again))
            if repr(was) != repr(now):
                text = f"{name} was {was}, in the repeated run {now}"
                return Difference(simulation.tick, "figures", text)
        return None


def _number(value: Any) -> Any:
    return value.item() if isinstance(value, np.generic) else value


def as_branched(before: Resolved, resolved: Resolved, settings: tuple[str, ...]) -> Scenario:
    """The scenario after a change of settings; file names may be relative to another folder."""
    scenario = branched(before, settings).scenario
    if any(files_of(choice.parameters) for _, choice in resolved.choices):
        named = resolved.scenario
        return msgspec.structs.replace(scenario, strategy=named.strategy, fleet=named.fleet)
    return scenario


def drawn_otherwise(resolved: Resolved) -> bool:
    """Whether the layout gives another floor; its file or generator may be missing here."""
    layout = resolved.scenario.layout
    if "picture" not in layout and not is_shipped(layout):
        return False
    try:
        _, opened = with_open_places(resolved.scenario, floor_of(layout, Path()).floor_plan)
    except InputError:  # more places than the floor has
        return True
    drawn = with_shared_chargers(opened)
    return with_limits_and_streets(resolved.scenario, drawn) != resolved.floor_plan


def _has_files(recorded: Content, resolved: Resolved) -> bool:
    """Whether the files of strategies are recorded, so changes can be reported."""
    return set(file_hashes(resolved).get("files", {})) <= set(recorded.get("files", {}))


def _unequal(recorded: Content, again: Content, labels: tuple[str, ...] = ()) -> str | None:
    """The dotted name of the first part that differs, or None."""
    for name in dict.fromkeys((*recorded, *again)):
        if name in labels:
            continue
        one, other = recorded.get(name), again.get(name)
        if isinstance(one, dict) and isinstance(other, dict):
            inner = _unequal(one, other)
            if inner is not None:
                return f"{name}.{inner}"
        elif not _equal(one, other):
            return name
    return None


def _equal(one: Any, other: Any) -> bool:
    if isinstance(one, np.ndarray) and isinstance(other, np.ndarray):
        return one.dtype == other.dtype and np.array_equal(one, other)
    if isinstance(one, tuple | list) and isinstance(other, tuple | list):
        long = min(len(one), len(other)) >= LONG_LIST
        if long and _are_stored_alike(one, other):
            return True
        return len(one) == len(other) and all(map(_equal, one, other))
    if isinstance(one, dict) and isinstance(other, dict):
        return _unequal(one, other) is None
    return type(one) is type(other) and bool(one == other)


def _are_stored_alike(one: Any, other: Any) -> bool:
    """Whether data are stored as the same bytes: this compares a million orders in a second."""
    try:
        return msgspec.msgpack.encode(one) == msgspec.msgpack.encode(other)
    except (TypeError, OverflowError):  # it contains arrays
        return False


def _actions(first: int, recorded: Array, ours: Array) -> Difference | None:
    rows, robots = np.nonzero(recorded != ours)
    if not len(rows):
        return None
    row, robot = int(rows[0]), int(robots[0])
    was, now = action_text(int(recorded[row, robot])), action_text(int(ours[row, robot]))
    return Difference(first + row, "actions", f"robot {robot}: recorded {was}, repeated {now}")


def _decisions(first: int, recorded: Array, ours: Array) -> Difference | None:
    if np.array_equal(recorded, ours):
        return None
    tick = max(first, first_other_tick(recorded, ours))
    return Difference(tick, "decisions", "a strategy decided differently")


def _changes(recorded: Array, ours: Array) -> Difference | None:
    if np.array_equal(recorded, ours):
        return None
    both = min(len(recorded), len(ours))
    differ = (recorded[:both] != ours[:both]).any(axis=1)
    equal = int(differ.argmax()) if differ.any() else both
    tick = min(int(rows[equal, 0]) for rows in (recorded, ours) if equal < len(rows))
    return Difference(tick, "changes", "change of an order, a reservation or a duration")


def action_text(did: int) -> str:
    """A recorded action in words."""
    words = [ACTS[did & ACTION_MASK].replace("_", " ")]
    words += ["out of its parking bay"] if did & LEFT_PARKING_BAY else []
    words += ["parked"] if did & ENTERED_PARKING_BAY else []
    words += ["picked up on arrival"] if did & PICKED_ON_ARRIVAL else []
    words += ["dropped on arrival"] if did & DROPPED_ON_ARRIVAL else []
    return ", ".join(words)
