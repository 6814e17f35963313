"""What to say when a strategy raises: which one, what, and where in its file."""

from __future__ import annotations

import dis
import sys
import traceback
from types import FrameType
from typing import Any

from automaton.errors import InputError
from automaton.printable import one_line
from automaton.runs import interruption
from automaton.runs.simulation import Simulation
from automaton.world.resolve import Resolved, StrategyChoice

MAX_ERROR_LENGTH = 300  # characters of what was raised

# Where a simulation calls a strategy's own code; their locals name its choice or the strategy.
CALLS = {
    function.__code__
    for function in (
        Simulation._decide,
        Simulation._state,
        Simulation._load_strategy,
        Simulation._validate_strategy,
    )
}


def strategy_failure(error: BaseException, resolved: Resolved) -> InputError | None:
    """The sentence about an exception from inside a strategy; None if it came from elsewhere."""
    frames = list(traceback.walk_tb(error.__traceback__))
    for depth, (frame, _) in enumerate(frames):
        if frame.f_code in CALLS:
            layer, choice = _choice(frame.f_locals, resolved)
            inner = frames[depth + 1 :]
            return _sentence(error, choice.name, layer, _place(frame, inner))
    return None


def is_from_outside(error: BaseException) -> bool:
    """Whether an error is a signal to this process, and not what a strategy raised by itself.

    A signal comes between two instructions, a strategy's own KeyboardInterrupt from its `raise`.
    """
    place = error.__traceback__
    if type(error) is not KeyboardInterrupt or place is None:
        return isinstance(error, KeyboardInterrupt)
    while place.tb_next is not None:
        place = place.tb_next
    if place.tb_frame.f_globals.get("__name__") == interruption.__name__:
        return True  # a handler raises it
    return dis.opname[place.tb_frame.f_code.co_code[place.tb_lasti]] != "RAISE_VARARGS"


def _choice(names: dict[str, Any], resolved: Resolved) -> tuple[str, StrategyChoice]:
    """The layer and the choice of the strategy that is called where these are the locals."""
    if "choice" in names:
        return names["layer"], names["choice"]
    strategy = names["strategy"]
    for layer, choice in resolved.choices:
        if layer == strategy.layer and choice.parameters is strategy.parameters:
            return layer, choice
    return strategy.layer, resolved.strategies[strategy.layer]


def _place(called_from: FrameType, inner: list[tuple[FrameType, int]]) -> str:
    """file:line of the deepest frame in the strategy's own file, else of the deepest of all."""
    if not inner:
        return ""
    strategy = called_from.f_locals.get("strategy")
    module = sys.modules.get(type(strategy).__module__)
    file = getattr(module, "__file__", "")
    own = [place for place in inner if place[0].f_code.co_filename == file]
    frame, line = (own or inner)[-1]
    return f" ({frame.f_code.co_filename}:{line})"


def _sentence(error: BaseException, name: str, layer: str, place: str) -> InputError:
    try:
        what = one_line(" ".join(str(error).split()), MAX_ERROR_LENGTH)
    except Exception:  # of the strategy's own __str__
        what = ""
    raised = f"{type(error).__name__}: {what}" if what else type(error).__name__
    title = layer.replace("_", "-")
    return InputError(f"the {title} strategy '{name}' raised {raised}{place}; --debug shows where")
