"""Suspend the garbage collector while a command starts: importing creates objects, but no garbage."""

from __future__ import annotations

import gc

STARTING = (300_000, 50, 1000)  # more objects than a start creates
_usual = gc.get_threshold()


def suspend_while_starting() -> None:
    """Suspend the garbage collector until `resume`."""
    gc.set_threshold(*STARTING)


def resume() -> None:
    """Resume the garbage collector if it was suspended, without the objects loaded so far."""
    if gc.get_threshold() == STARTING:
        gc.freeze()
        gc.set_threshold(*_usual)
