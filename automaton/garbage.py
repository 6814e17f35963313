"""The garbage collector while a command starts: importing makes objects that stay, none is garbage."""

from __future__ import annotations

import gc

STARTING = (300_000, 50, 1000)  # more objects than a start makes
_usual = gc.get_threshold()


def suspend_while_starting() -> None:
    """Look for no garbage until `resume`."""
    gc.set_threshold(*STARTING)


def resume() -> None:
    """Look for garbage as usual, but not in what a command has loaded, if that was suspended."""
    if gc.get_threshold() == STARTING:
        gc.freeze()
        gc.set_threshold(*_usual)
