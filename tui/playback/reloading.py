"""Load a scenario again whenever one of its files is written, while its floor is being drawn.

The files are looked at some times a second, by path: editors that put another file in place of the
old one are noticed as well as those that write into it.
"""

from __future__ import annotations

import os
import threading
from collections.abc import Callable, Iterable
from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING, Final

from automaton.errors import InputError
from automaton.scenario.document import named_files
from tui.playback.run_source import Opening

if TYPE_CHECKING:  # it needs Numba
    from tui.playback.player import Player

POLL_S: Final = 0.2  # between two looks at the files
Signature = tuple[tuple[int, int, int] | None, ...]  # of each file: time, size, number on its disk


class ScenarioFiles:
    """Whether the files of a scenario are what they were when it was loaded last."""

    def __init__(self, scenario: str) -> None:
        """Raises InputError if there is no such scenario."""
        self._scenario = scenario
        self.paths = named_files(scenario)
        self._loaded = self._seen = signature_of(self.paths)

    def settled_change(self) -> bool:
        """Whether they have changed, and were the same at the look before."""
        before, self._seen = self._seen, signature_of(self.paths)
        return self._seen == before != self._loaded

    def note_loading(self) -> None:
        """The scenario is read now, and may name other files; one that has gone may come back."""
        with suppress(InputError):
            gone = (path for path in self.paths if not path.exists())
            self.paths = tuple(dict.fromkeys((*named_files(self._scenario), *gone)))
        self._loaded = self._seen = signature_of(self.paths)


def signature_of(paths: Iterable[Path]) -> Signature:
    """What changes when one of these files is written, replaced or removed."""
    return tuple(map(_signature, paths))


def _signature(path: Path) -> tuple[int, int, int] | None:
    try:
        stat = os.stat(path)
    except OSError:
        return None
    return stat.st_mtime_ns, stat.st_size, stat.st_ino


class Reloader:
    """A thread that opens the scenario again after each change, with a player at tick 0."""

    def __init__(
        self,
        scenario: str,
        load: Callable[[], Opening],
        on_loaded: Callable[[Opening, Player], None],
        on_error: Callable[[str], None],
    ) -> None:
        """`load` raises InputError. The others are called in the thread. Raises InputError."""
        self._files = ScenarioFiles(scenario)
        self._load, self._on_loaded, self._on_error = load, on_loaded, on_error
        self._closing = threading.Event()
        self._thread = threading.Thread(target=self._watch, name="reloading", daemon=True)

    def start(self) -> None:
        """Begin to look at the files."""
        self._thread.start()

    def close(self) -> None:
        """Look at them no more; a load under way is left to itself."""
        self._closing.set()

    def _watch(self) -> None:
        while not self._closing.wait(POLL_S):
            if self._files.settled_change():
                self._files.note_loading()
                self._reload()

    def _reload(self) -> None:
        from tui.playback.player import Player, sentence

        try:
            opening = self._load()
            player = Player(opening.begin())
        except Exception as error:  # the scenario's, or a strategy's
            if not self._closing.is_set():
                self._on_error(sentence(error))
            return
        if self._closing.is_set():
            player.close()
        else:
            self._on_loaded(opening, player)
