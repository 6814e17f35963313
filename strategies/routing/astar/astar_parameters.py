"""The parameters of A*. Imports no Numba."""

from __future__ import annotations

from typing import Annotated, Literal

import msgspec
from msgspec import Meta


class TieBreaking(msgspec.Struct, forbid_unknown_fields=True, frozen=True, kw_only=True):
    """Which of several paths of equal cost A* returns."""

    tie_break: Annotated[
        Literal["fifo", "larger_g", "random"],
        Meta(
            description="Of cells with the same estimate it expands first the one found first "
            "(fifo), the one "
            "farthest from the start (larger_g), or a random one, by seed and leg (random)."
        ),
    ] = "larger_g"
