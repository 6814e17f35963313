"""Fleets of mobile robots in warehouses and factories, simulated as a compiled cellular automaton.

The contents of this package are imported at first use: see docs/reference/python.md.
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from automaton.python_api import Simulation as Simulation
    from automaton.python_api import check as check
    from automaton.python_api import load as load
    from automaton.python_api import read as read
    from automaton.python_api import simulate as simulate
    from automaton.python_api import size as size
    from automaton.python_api import sweep as sweep
    from automaton.strategy.contract import Strategy as Strategy
    from automaton.strategy.per_robot import per_robot as per_robot

    __version__: str

OFFERED = {
    "simulate": "automaton.python_api",
    "Simulation": "automaton.python_api",
    "load": "automaton.python_api",
    "check": "automaton.python_api",
    "sweep": "automaton.python_api",
    "size": "automaton.python_api",
    "read": "automaton.python_api",
    "Strategy": "automaton.strategy.contract",
    "per_robot": "automaton.strategy.per_robot",
}
__all__ = [*OFFERED, "__version__"]


def __getattr__(name: str) -> Any:
    if name == "__version__":
        from automaton.commands import version

        value: Any = version()
    elif name in OFFERED:
        value = getattr(import_module(OFFERED[name]), name)
    else:
        raise AttributeError(f"module 'automaton' has no attribute {name!r}")
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})
