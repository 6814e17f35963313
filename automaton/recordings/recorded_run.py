"""A recorded run: it is played again from its decisions, and tables, pictures and films come of it."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from automaton.drawings.looks import THEMES, Theme
from automaton.errors import InputError, alternatives
from automaton.floor.cells import NIL
from automaton.recording.frames import Recording
from automaton.recording.recording_reader import read_recording

if TYPE_CHECKING:
    from automaton.drawings.floor_svg import FloorPicture
    from automaton.films.film_page import NotebookFilm
    from automaton.history.playback import Playback
    from automaton.runs.headless import Sampling
    from automaton.tables.table_files import Tables


class RecordedRun:
    """A recording, whole or cut short."""

    def __init__(self, path: str | Path, recording: Recording) -> None:
        self.path, self._recording = Path(path), recording

    @property
    def ticks(self) -> int:
        """How many are recorded."""
        return self._recording.ticks

    @property
    def is_complete(self) -> bool:
        """Whether the recording has its end."""
        return self._recording.complete

    def tables(
        self,
        states: str | int | None = None,
        events: bool = False,
        robots: Sequence[int] | None = None,
        folder: str | Path | None = None,
    ) -> Tables:
        """The tables of the run, as `simulate(tables=True)` has them.

        `states`: a period such as "1 s", or ticks; `robots`: events and states of these alone;
        `folder`: a new folder to which they are written as Parquet. Raises InputError.
        """
        from automaton.history.playback import Playback
        from automaton.recording.header import resolved_of
        from automaton.tables.table_run import TableOptions, table_run

        recording = self._recording
        where = None if folder is None else Path(folder)
        options = TableOptions(states, events, robots, where)
        try:
            resolved = resolved_of(recording.header, with_strategies=False)
            with table_run(resolved, options, self.ticks) as run:
                sampling = run.sampling
                frames = recording.stored()
                playback = Playback(recording.header, frames, on_observe=sampling.on_observe)
                _play(playback, sampling, self.ticks)
                run.finish(playback.simulation)
        except InputError as error:
            raise error.at(str(self.path)) from None
        return run.tables()

    def picture(
        self, at: int | None = None, theme: Theme = "light", follow: int = NIL
    ) -> FloorPicture:
        """The floor and its robots after a tick, the last one unless said; `follow`: a robot to mark.

        Raises InputError.
        """
        from automaton.history.playback import Playback

        tick = self.ticks if at is None else at
        if not 0 <= tick <= self.ticks:
            raise InputError(
                f"there is no tick {tick:,}: the recording ends at tick {self.ticks:,}"
            )
        try:
            playback = Playback(self._recording.header, self._recording.stored())
            playback.go_to(tick)
            return playback.simulation.picture(theme, follow)
        except InputError as error:
            raise error.at(str(self.path)) from None

    def film(
        self,
        first: int | None = None,
        last: int | None = None,
        *,
        speed: float = 1,
        follow: int = NIL,
        theme: Theme = "light",
        height: int = 600,
    ) -> NotebookFilm:
        """The ticks from `first` (0) to `last` (the last one) as a film that plays in a notebook.

        `speed`: 1 is ten ticks a second; `follow`: a robot; `height`: pixels. Raises InputError.
        """
        from automaton.films.film_page import NotebookFilm, film_page
        from automaton.films.recorded_stretch import play_stretch

        if theme not in THEMES:
            raise InputError(f"unknown theme {theme!r}: allowed are {alternatives(THEMES)}")
        stretch = play_stretch(self._recording, first, last, follow)
        page = film_page(stretch, speed=speed, follow=follow, theme=theme)
        return NotebookFilm(page, stretch.title, height)

    def _repr_html_(self) -> str:
        """Show the last tick in a notebook."""
        return self.picture()._repr_html_()


def _play(playback: Playback, sampling: Sampling, until: int) -> None:
    """Play a recording to a tick, with samples on the way."""
    period = sampling.period or until or 1
    if sampling.period:
        sampling.on_sample(playback.simulation)
    while playback.tick < until:
        playback.go_to(min((playback.tick // period + 1) * period, until))
        if sampling.period and playback.tick % period == 0:
            sampling.on_sample(playback.simulation)


def read(path: str | Path) -> RecordedRun:
    """Open a recording. Raises InputError for a file that is not one, or is damaged."""
    return RecordedRun(path, read_recording(path))
