"""The types of operators, remembered: for each `a + b` in each kernel Numba would infer it once more.

For two numbers it tries dozens of templates, which look at all options of the compiler each time: a fifth
of a first run.
"""

from __future__ import annotations

import operator
from typing import Any

from numba import types
from numba.core.types.functions import BaseFunction

OPERATORS = frozenset(getattr(operator, name) for name in operator.__all__) - {operator.contains}
KNOWN = types.Number, types.Boolean, types.Array, types.BaseTuple


def remember() -> None:
    """Have the type of each operator with such operands inferred once: no option changes it."""
    infer = BaseFunction.get_call_type

    def get_call_type(self: Any, context: Any, args: Any, kws: Any) -> Any:
        if self.typing_key not in OPERATORS or not all(isinstance(one, KNOWN) for one in args):
            return infer(self, context, args, kws)
        inferred = vars(self).setdefault("_inferred", {})
        if args not in inferred:
            inferred[args] = infer(self, context, args, kws)
        return inferred[args]

    BaseFunction.get_call_type = get_call_type  # type: ignore[method-assign]
