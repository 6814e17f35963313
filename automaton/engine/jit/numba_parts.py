"""The private parts of Numba on which compiled code depends: checked at import.

Without them Numba would fail in the middle of a compilation, or compile something else.
`pyproject.toml` allows the versions with which the tests have passed.
"""

from __future__ import annotations

import inspect
import sys
from collections.abc import Iterator
from types import ModuleType
from typing import Any

import numba

from automaton.engine.jit.compile_progress import UnfitNumbaError

TRIED = "0.63", "0.68"  # the first and the last; pyproject.toml says the same (tested)
BLAS = "scipy.linalg.cython_blas"
NO_BLAS_YET = ModuleType(BLAS)


def unfit(what: str) -> UnfitNumbaError:
    """The error, which names the tested versions."""
    first, last = TRIED
    return UnfitNumbaError(
        f"automaton does not work with Numba {numba.__version__} ({what}); tested with "
        f"{first} to {last}: pip install 'numba=={last}.*'"
    )


try:
    from numba.core import cgutils, config, event
    from numba.core.caching import FunctionCache
    from numba.core.caching import _CacheLocator as CacheLocator
    from numba.core.cpu import CPUTargetOptions
    from numba.core.dispatcher import Dispatcher
    from numba.core.types.functions import BaseFunction
    from numba.core.typing.templates import AttributeTemplate, infer_getattr
    from numba.np.arrayobj import populate_array

    # Numba imports SciPy to look for its BLAS: 0.2 s in each run if SciPy is installed. Kernels
    # that multiply matrices import it when they are compiled.
    sys.modules.setdefault(BLAS, NO_BLAS_YET)
    import numba.np.arraymath

    if sys.modules[BLAS] is NO_BLAS_YET:
        del sys.modules[BLAS]
except ImportError as error:
    raise unfit(str(error)) from error

__all__ = [
    "AttributeTemplate",
    "BaseFunction",
    "CacheLocator",
    "FunctionCache",
    "cgutils",
    "config",
    "event",
    "infer_getattr",
    "populate_array",
]


def changed() -> Iterator[str]:
    """The parts that exist but differ from what compiled code expects."""
    if not {"data", "shape", "strides", "itemsize", "meminfo"} <= parameters(populate_array):
        yield "populate_array takes other arguments"
    if parameters(BaseFunction.get_call_type) != {"self", "context", "args", "kws"}:
        yield "BaseFunction.get_call_type takes other arguments"
    if parameters(getattr(Dispatcher, "get_call_template", None)) != {"self", "args", "kws"}:
        yield "Dispatcher.get_call_template takes other arguments"
    if not hasattr(CPUTargetOptions, "_nrt"):
        yield "there is no option _nrt"
    if not hasattr(AttributeTemplate, "generic_resolve"):
        yield "AttributeTemplate.generic_resolve is gone"
    if not hasattr(config, "CACHE_DIR"):
        yield "config.CACHE_DIR is gone"
    parts = {"save_overload", "load_overload", "_load_overload", "cache_path"}
    if not parts <= set(dir(FunctionCache)):
        yield "FunctionCache saves or loads differently"
    if not hasattr(CacheLocator, "ensure_cache_path"):
        yield "_CacheLocator.ensure_cache_path is gone"
    if not {"on_start", "on_end"} <= set(dir(event.Listener)):
        yield "event.Listener has other events"


def parameters(function: Any) -> set[str]:
    return set(inspect.signature(function).parameters) if callable(function) else set()


def links_otherwise() -> str:
    """Return the part of Numba that differs from what `callees` expects, "" if none. If one
    differs, each kernel gets its own machine code, and a first run takes longer."""
    try:
        from numba.core.caching import CompileResultCacheImpl
        from numba.core.codegen import CodeLibrary, JITCodeLibrary
        from numba.core.compiler import CR_FIELDS, Compiler, compile_result
        from numba.core.environment import lookup_environment
    except ImportError as error:
        return str(error)
    library = {"finalize", "_finalize_specific", "_finalize_dynamic_globals", "_raise_if_finalized"}
    library |= {"_get_module_for_linking", "add_linking_library", "get_pointer_to_function"}
    if not library <= set(dir(JITCodeLibrary)):
        return f"JITCodeLibrary has no {min(library - set(dir(JITCodeLibrary)))}"
    if "_reload_init" not in CodeLibrary.__init__.__code__.co_names:
        return "CodeLibrary has no _reload_init"
    if not {"library", "entry_point", "referenced_envs", "reload_init"} <= set(CR_FIELDS):
        return "the results of compilations have other fields"
    if parameters(Compiler.compile_extra) != {"self", "func"}:
        return "Compiler.compile_extra takes other arguments"
    if not {"reduce", "rebuild"} <= set(dir(CompileResultCacheImpl)):
        return "CompileResultCacheImpl stores results differently"
    return (
        "" if parameters(compile_result) and parameters(lookup_environment) else "other functions"
    )


for _what in changed():
    raise unfit(_what)
LINKS_OTHERWISE = links_otherwise()
