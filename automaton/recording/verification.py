"""Verification: a recording is checked by the rules, then run again and compared tick by tick."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import takewhile
from pathlib import Path
from typing import NamedTuple

import numpy as np

from automaton.errors import InputError
from automaton.kernels.decisions import first_other_tick
from automaton.kernels.digest import DIGEST_NAMES
from automaton.recording.codes import (
    ACTION_MASK,
    DROPPED_AT_ONCE,
    INTO_BAY,
    LEFT_BAY,
    PICKED_AT_ONCE,
)
from automaton.recording.frames import CONDITIONS, END, TICKS, Content, Recording, read_recording
from automaton.recording.header import changed, resolved_of, source_hash
from automaton.recording.validator import ACTS, Report, validate_stored
from automaton.scenario.reading import content_hash
from automaton.simulation import Simulation
from automaton.world.state import CHANGED, DECIDED, RECORDED, Array


class Difference(NamedTuple):
    """The first place where the run, made again, is not what was recorded."""

    tick: int
    array: str  # of the state, such as robots.cell; or "actions", "changes", "end"
    text: str

    def __str__(self) -> str:
        return f"tick {self.tick}: {self.array} differs{': ' if self.text else ''}{self.text}"


@dataclass(frozen=True)
class Verification:
    """What was found about a recording."""

    recording: Recording
    report: Report  # of the validator
    difference: Difference | None  # None: what is there agrees
    same_sources: bool  # recorded by the sources that are installed here
    changed_files: tuple[str, ...]  # read by a strategy, and not as they were

    @property
    def passed(self) -> bool:
        """Whether all that is there is undamaged, keeps the rules, and comes out equal again."""
        return self.report.valid and self.difference is None and not self.recording.damage


def verify(path: str | Path) -> Verification:
    """Verify a recording's file up to its last whole frame. Raises InputError."""
    return verify_recording(read_recording(path))


def verify_recording(recording: Recording) -> Verification:
    """Verify a recording that is open or in memory."""
    header = recording.header
    plugins = tuple(pick["name"] for pick in header["picks"].values() if ":" in pick["name"])
    files = changed_files(recording)
    try:
        difference = first_difference(recording)
    except InputError as error:
        if not files:
            raise
        names = ", ".join(files)
        raise InputError(f"{names} changed after the run was recorded: {error}") from error
    return Verification(
        recording=recording,
        report=validate_stored(recording),
        difference=difference,
        same_sources=header["sources"] == source_hash(plugins),
        changed_files=files,
    )


def changed_files(recording: Recording) -> tuple[str, ...]:
    """The files read by its strategies that are gone, or hold something else than then."""
    parts = [recording.header]
    parts += [frame.content for frame in recording.frames if frame.kind == CONDITIONS]
    recorded = {file: found for part in parts for file, found in part.get("files", {}).items()}
    return tuple(file for file, found in recorded.items() if content_hash(Path(file)) != found)


def first_difference(recording: Recording) -> Difference | None:
    """Run the scenario again and compare each tick; the first that differs, or None."""
    rerun = Rerun(recording.header)
    for frame in recording.frames:
        found = None
        if frame.kind == TICKS:
            found = rerun.compare(frame.content)
        elif frame.kind == CONDITIONS and (frame.content["tick"] or frame.content["settings"]):
            rerun.change(frame.content)
        elif frame.kind == END:
            found = rerun.compare_end(frame.content)
        if found is not None:
            return found
    return None


class Rerun:
    """The run made again, one frame of the recording at a time."""

    def __init__(self, header: Content) -> None:
        self.header = header
        self.names = list(header["digest_names"])
        self._parts: list[tuple[Array, Array, Array, Array]] = []
        self.simulation = Simulation(resolved_of(header), header["seed"], on_record=self._take)
        # Arrays that only one version digests cannot be compared.
        self._common = [name for name in self.names if name in DIGEST_NAMES]
        self._theirs = [self.names.index(name) for name in self._common]
        self._ours = [DIGEST_NAMES.index(name) for name in self._common]

    def _take(self, simulation: Simulation) -> None:
        clock, record = simulation.world.clock, simulation.record
        rows, changed, decided = (int(clock[k]) for k in (RECORDED, CHANGED, DECIDED))
        self._parts.append(
            (
                record.did[:rows].copy(),
                record.decisions[:decided].copy(),
                record.changes[:changed].copy(),
                record.digests[:rows].copy(),
            )
        )
        simulation.empty_record()

    def change(self, rules: Content) -> None:
        """Branch off as the recorded run did."""
        resolved = resolved_of(changed(self.header, rules))
        self.simulation = self.simulation.continued(resolved)

    def compare(self, content: Content) -> Difference | None:
        """Run through the ticks of a frame and compare them."""
        first, ticks = content["first"], len(content["did"])
        self.simulation.run(until=first + ticks - 1)
        parts = zip(*self._parts, strict=True)
        did, decisions, changes, digests = (np.concatenate(part) for part in parts)
        self._parts.clear()
        if self.simulation.tick < first + ticks - 1:
            return Difference(self.simulation.tick, "end", "made again, the run ends here")
        if did.shape != content["did"].shape:
            return Difference(first, "record", "ticks are missing or doubled")
        found = (
            self._digests(first, content["digests"][:, self._theirs], digests[:, self._ours]),
            _actions(first, content["did"], did),
            _decisions(first, content["decisions"], decisions),
            _changes(content["changes"], changes),
        )
        return min(filter(None, found), key=lambda difference: difference.tick, default=None)

    def _digests(self, first: int, recorded: Array, ours: Array) -> Difference | None:
        differs = (recorded != ours) & recorded.any(axis=1, keepdims=True)  # those that are due
        rows = np.flatnonzero(differs.any(axis=1))
        if not len(rows):
            return None
        arrays = [self._common[column] for column in np.flatnonzero(differs[rows[0]])]
        others = f"also {', '.join(arrays[1:])}" if len(arrays) > 1 else ""
        return Difference(first + int(rows[0]), arrays[0], others)

    def compare_end(self, content: Content) -> Difference | None:
        """Compare how the run ended."""
        simulation = self.simulation
        now = {
            "ticks": simulation.tick,
            "finished": simulation.finished,
            "digest": simulation.digest,
        }
        if self.names != list(DIGEST_NAMES):
            del now["digest"]
        for name, value in now.items():
            if content[name] != value:
                text = f"{name} was {content[name]}, made again it is {value}"
                return Difference(simulation.tick, "end", text)
        return None


def _actions(first: int, recorded: Array, ours: Array) -> Difference | None:
    rows, robots = np.nonzero(recorded != ours)
    if not len(rows):
        return None
    row, robot = int(rows[0]), int(robots[0])
    was, now = action_text(int(recorded[row, robot])), action_text(int(ours[row, robot]))
    return Difference(first + row, "actions", f"robot {robot}: {was} recorded, {now} made again")


def _decisions(first: int, recorded: Array, ours: Array) -> Difference | None:
    if np.array_equal(recorded, ours):
        return None
    tick = max(first, first_other_tick(recorded, ours))
    return Difference(tick, "decisions", "a strategy answered something else")


def _changes(recorded: Array, ours: Array) -> Difference | None:
    theirs, mine = recorded.tolist(), ours.tolist()
    if theirs == mine:
        return None
    pairs = zip(theirs, mine, strict=False)
    equal = sum(1 for _ in takewhile(lambda pair: pair[0] == pair[1], pairs))
    tick = min(rows[equal][0] for rows in (theirs, mine) if equal < len(rows))
    return Difference(tick, "changes", "of an order, a reservation or a duration")


def action_text(did: int) -> str:
    """A recorded action in words."""
    words = [ACTS[did & ACTION_MASK].replace("_", " ")]
    words += ["out of its bay"] if did & LEFT_BAY else []
    words += ["parked"] if did & INTO_BAY else []
    words += ["picked up on arrival"] if did & PICKED_AT_ONCE else []
    words += ["set down on arrival"] if did & DROPPED_AT_ONCE else []
    return ", ".join(words)
