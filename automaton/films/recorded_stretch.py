"""A stretch of a recording, played once and kept as columns: what every film is made of."""

from __future__ import annotations

from dataclasses import dataclass

from automaton.drawings.moment import DrawnFloor, drawn_floor
from automaton.engine.state import NIL
from automaton.errors import InputError
from automaton.films.film_columns import FilmColumns
from automaton.history.playback import Playback
from automaton.recording.frames import Recording
from automaton.recording.header import resolved_of
from automaton.recording.recording_reader import title_of
from automaton.units import Unit, number, unit
from automaton.world.resolve import Resolved


@dataclass(frozen=True)
class RecordedStretch:
    """The ticks from `first` to `last` of a run."""

    resolved: Resolved
    floor: DrawnFloor
    columns: FilmColumns
    title: str
    first: int
    last: int
    recorded: int  # the last tick of the recording

    @property
    def unit(self) -> Unit:
        """What a tick stands for."""
        return unit(self.resolved.scenario.units.tick)

    def time_words(self, tick: int) -> str:
        """A tick, and what it is in the reader's unit."""
        words = f"tick {tick:,} of {self.recorded:,}"
        if self.unit.size == 1:
            return words
        return f"{words}, {number(self.unit.of(tick))} {self.unit.plural}"

    def fleet_words(self, tick: int) -> str:
        """How many robots work and wait, and what is done."""
        working, waiting, circling, done, orders = (
            self.columns.figure(name, tick)
            for name in ("working", "waiting", "circling", "delivered", "orders")
        )
        words = f"{working:,} work, {waiting:,} wait, {done:,} of {orders:,} orders done"
        return f"{words}, {circling:,} in a wait cycle" if circling else words


def checked_range(recording: Recording, first: int | None, last: int | None) -> tuple[int, int]:
    """The first tick and the last one; None: those of the recording. Raises InputError."""
    begin, end = first or 0, recording.ticks if last is None else last
    if max(begin, end) > recording.ticks:
        raise InputError(
            f"there is no tick {max(begin, end):,}: the recording ends at tick {recording.ticks:,}"
        )
    if begin > end:
        raise InputError(f"there is nothing from tick {begin:,} to tick {end:,}")
    return begin, end


def play_stretch(
    recording: Recording, first: int | None, last: int | None, follow: int = NIL
) -> RecordedStretch:
    """Play the ticks from `first` (0) to `last` (the last one). Raises InputError."""
    begin, end = checked_range(recording, first, last)
    resolved = resolved_of(recording.header, with_strategies=False)
    robots = resolved.scenario.fleet.robots
    if follow >= robots:
        raise InputError(f"there is no robot {follow}: the last one is robot {robots - 1}")
    floor = drawn_floor(resolved)
    columns = FilmColumns(floor, robots, begin, end)
    frames = recording.stored()
    playback = Playback(recording.header, frames)
    for tick in range(begin, end + 1):
        playback.go_to(tick)
        columns.take(playback.simulation)
    title = title_of(resolved, recording.header["seed"], frames)
    return RecordedStretch(resolved, floor, columns, title, begin, end, recording.ticks)
