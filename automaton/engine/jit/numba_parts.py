"""The parts of Numba that are not public, and on which compiled code leans: checked at import.

A Numba without them would fail somewhere in the middle of a compilation, or compile something else.
`pyproject.toml` allows the versions with which the tests have passed.
"""

from __future__ import annotations

import inspect
import sys
from collections.abc import Iterator
from types import ModuleType
from typing import Any

import numba

from automaton.engine.jit.unfit_numba import UnfitNumbaError

TRIED = "0.61", "0.68"  # the first and the last; pyproject.toml says the same (tested)
BLAS = "scipy.linalg.cython_blas"
NOT_YET = ModuleType(BLAS)


def unfit(what: str) -> UnfitNumbaError:
    """The error that names the versions with which compiled code here works."""
    first, last = TRIED
    return UnfitNumbaError(
        f"compiled code here does not work with Numba {numba.__version__} ({what}); it was tried with "
        f"{first} to {last}: pip install 'numba=={last}.*'"
    )


try:
    from numba.core import cgutils, config, event
    from numba.core.caching import FunctionCache
    from numba.core.caching import _CacheLocator as CacheLocator
    from numba.core.cpu import CPUTargetOptions
    from numba.core.dispatcher import Dispatcher
    from numba.core.typing.templates import AttributeTemplate, infer_getattr
    from numba.np.arrayobj import populate_array

    # Numba looks whether SciPy has a BLAS by importing it: 0.2 s of each run, where SciPy is installed.
    # A kernel that multiplies matrices has it imported when it is compiled.
    sys.modules.setdefault(BLAS, NOT_YET)
    import numba.np.arraymath

    if sys.modules[BLAS] is NOT_YET:
        del sys.modules[BLAS]
except ImportError as error:
    raise unfit(str(error)) from error

__all__ = [
    "AttributeTemplate",
    "CacheLocator",
    "FunctionCache",
    "cgutils",
    "config",
    "event",
    "infer_getattr",
    "populate_array",
]


def changed() -> Iterator[str]:
    """The parts that are there, and not what compiled code takes them for."""
    if not {"data", "shape", "strides", "itemsize", "meminfo"} <= parameters(populate_array):
        yield "populate_array takes other arguments"
    if parameters(getattr(Dispatcher, "get_call_template", None)) != {"self", "args", "kws"}:
        yield "Dispatcher.get_call_template takes other arguments"
    if not hasattr(CPUTargetOptions, "_nrt"):
        yield "there is no option _nrt"
    if not hasattr(AttributeTemplate, "generic_resolve"):
        yield "AttributeTemplate.generic_resolve is gone"
    if not hasattr(config, "CACHE_DIR"):
        yield "config.CACHE_DIR is gone"
    if not {"save_overload", "load_overload", "cache_path"} <= set(dir(FunctionCache)):
        yield "FunctionCache saves otherwise"
    if not hasattr(CacheLocator, "ensure_cache_path"):
        yield "_CacheLocator.ensure_cache_path is gone"
    if not {"on_start", "on_end"} <= set(dir(event.Listener)):
        yield "event.Listener hears other events"


def parameters(function: Any) -> set[str]:
    return set(inspect.signature(function).parameters) if callable(function) else set()


for _what in changed():
    raise unfit(_what)
