"""A strategy's kernel becomes a function of the one signature that the loop calls."""

from __future__ import annotations

import inspect
from collections.abc import Callable
from typing import Any

from automaton.engine.jit.kernel import COMPILING, first_class, jit_is_on
from automaton.errors import InputError

ARGUMENTS = ("view", "batch", "decisions", "memory", "workspace")
_COMPILED: dict[Any, Any] = {}


def compiled_decide(function: Callable[..., None], signature: Any) -> Any:
    """Compile `function` alone for the loop's signature, once per process.

    Raises InputError, one sentence with the place, when it does not fit or does not compile.
    """
    if not jit_is_on():
        return function
    if function not in _COMPILED:
        _COMPILED[function] = _compile(function, signature)
        COMPILING.finish(function)
    return _COMPILED[function]


def _compile(function: Any, signature: Any) -> Any:
    from numba.core.errors import NumbaError

    plain = getattr(function, "py_func", None)
    if plain is None:
        raise InputError(
            f"strategy kernel {function!r} is not decorated with automaton.engine.jit.kernel.kernel"
        )
    place = f"{inspect.getsourcefile(plain)}:{plain.__code__.co_firstlineno}"
    if len(inspect.signature(plain).parameters) != len(ARGUMENTS):
        raise InputError(f"{place}: a compiled decide takes ({', '.join(ARGUMENTS)})")
    try:
        return first_class(function, signature)
    except NumbaError as error:
        lines = [line.strip() for line in str(error).splitlines() if line.strip()]
        told = next(
            (line for line in lines if "Error" not in line and "pipeline" not in line), lines[0]
        )
        where = next((line for line in lines if line.startswith("File ")), "")
        raise InputError(
            f"{place}: the strategy does not compile: {told} {where}".strip()
        ) from error
