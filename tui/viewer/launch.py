"""Run the viewer for a command, or print plain text where there is no terminal."""

from __future__ import annotations

import os
import signal
import sys
import threading
from collections.abc import Callable, Iterator, MutableMapping
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from types import FrameType
from typing import Final

from automaton.errors import InputError
from tui.playback.run_source import Opening, comparing_command
from tui.terminal.options import (
    Options,
    read_settings,
    settings_path,
    with_settings,
    write_settings,
)
from tui.terminal.themes import asked_background, theme_of

ENDING_SIGNALS: Final = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)
CLOSE_TIMEOUT_S: Final = 3.0

BAD_INPUT = 2  # also for a failing strategy


def pick_command(folder: Path) -> list[str] | None:
    """Let the user choose what to open; returns the command line, or None."""
    options = fitting_terminal(with_settings(Options(theme="auto"), read_settings(settings_path())))
    os.environ.update(options.for_textual(os.environ))
    forget_size(os.environ)
    draw_on_terminal()
    from tui.viewer.picker import pick

    return pick(folder, options)


def fitting_terminal(options: Options) -> Options:
    """The options with the theme that fits the terminal, unless the user has chosen one."""
    if options.theme != "auto":
        return options
    answer = b"" if _in_browser() else asked_background()
    return replace(options, theme=theme_of(os.environ, answer))


def show(opening: Opening, options: Options) -> int:
    """Show the runs until the user leaves; returns the exit code."""
    plain = options.plain or os.environ.get("TERM") == "dumb"
    plain = plain or not (_in_browser() or _has_terminal())
    if opening.reload is not None and (plain or options.describe):
        raise InputError("--reload shows a floor while it is drawn, which needs a terminal")
    if options.describe:
        from tui.viewer.text_mode import run_described

        return run_described(opening, options)
    if plain:
        from tui.viewer.text_mode import run_in_text_mode

        return run_in_text_mode(opening)
    path, settings = settings_path(), {}
    if not _in_browser():
        settings = read_settings(path)
    options = fitting_terminal(with_settings(options, settings))
    options = replace(options, pixels=options.shown_pixels(os.environ))
    os.environ.update(options.for_textual(os.environ))
    if not _in_browser():
        forget_size(os.environ)
        draw_on_terminal()
    from tui.viewer.app import Viewer

    viewer = Viewer(opening, options)
    try:
        with handled(viewer.leave, viewer.session.close):
            viewer.run()
    finally:
        viewer.session.close()
    if (chosen := viewer.chosen_settings()) and not _in_browser():
        write_settings(path, {**settings, **chosen})
    session = viewer.session
    failed, error = session.error or session.broken, ""
    if session.playback is not None:
        failed, error = failed or session.playback.failed, session.playback.error
    if failed or error:
        _say(failed or error)
    kept = [path for path in session.recordings if path.exists()]
    for path in kept:
        _say(f"recorded in {path}")
    runs = [*opening.files, *kept]
    if kept and len(runs) > 1:
        _say(f"to compare: {comparing_command(*runs[-2:])}")
    # A full disk stops the recording only; the live run was shown.
    bad = failed or (error and not session.live)
    return viewer.return_code or (BAD_INPUT if bad else 0)


def _say(sentence: str) -> None:
    """Print a line; a lost terminal must not change the exit code."""
    try:
        print(f"automaton: {sentence}", file=sys.stderr, flush=True)
    except OSError:
        os.dup2(os.open(os.devnull, os.O_WRONLY), 2)


def forget_size(environ: MutableMapping[str, str]) -> None:
    """Ask the terminal itself: exported COLUMNS and LINES do not follow a resize."""
    for name in ("LINES", "COLUMNS"):
        environ.pop(name, None)


def _in_browser() -> bool:
    """Whether the viewer runs in a browser session, with a driver instead of a terminal."""
    return bool(os.environ.get("TEXTUAL_DRIVER"))


def _has_terminal() -> bool:
    return sys.stdin.isatty() and sys.stdout.isatty()


def draw_on_terminal() -> None:
    """Let Textual draw on stdout where stderr, its usual stream, goes to a file."""
    if not sys.stderr.isatty():
        vars(sys)["__stderr__"] = sys.__stdout__


# Signals: the viewer closes orderly, or by force if that fails.
#
# After a lost connection (SIGHUP), Textual's terminal accepts no output: its writer thread dies and
# the program would hang. The run is then closed here, so that its recording is complete.


@contextmanager
def handled(leave: Callable[[int], None], close: Callable[[], None]) -> Iterator[None]:
    """Inside the context, a signal calls `leave(exit code)`, and `close` if that takes too long."""

    def on_signal(number: int, _: FrameType | None) -> None:
        code = 128 + number
        guard = threading.Timer(CLOSE_TIMEOUT_S, _leave_by_force, (code, close))
        guard.daemon = True
        guard.start()
        leave(code)

    before = {number: signal.signal(number, on_signal) for number in ENDING_SIGNALS}
    try:
        yield
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)


def _leave_by_force(code: int, close: Callable[[], None]) -> None:
    closing = threading.Thread(target=close, daemon=True)
    closing.start()
    closing.join(CLOSE_TIMEOUT_S)  # do not wait for a hanging strategy
    os._exit(code)
