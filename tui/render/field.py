"""Numbers on a floor as nine levels, on a scale that stays put while the numbers grow.

Traffic is uneven: main aisles carry many times what side aisles do. The levels therefore grow with
the square of their number: level n of a scale that ends at 1000 begins at 1000 ((n - 1) / 8)^2.
"""

from __future__ import annotations

from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

HEAT_LEVELS: Final = 9  # level 0 is nothing at all
SCALE_ENDS: Final = (10, 12, 15, 20, 25, 30, 40, 50, 60, 80)  # times a power of ten


class Scale(NamedTuple):
    """The numbers at which levels 1 to 8 begin, and where the scale ends."""

    begins: tuple[int, ...]
    end: int

    def words(self, first: int, last: int) -> str:
        """The numbers of levels 1 to 8 from the first to the last, for a legend."""
        low = self.begins[first - 1]
        high = self.end if last == HEAT_LEVELS - 1 else self.begins[last] - 1
        return f"{low}" if high <= low else f"{low} to {high}"


def scale_for(largest: int) -> Scale:
    """The scale up to the next of SCALE_ENDS: the largest number is of the last level."""
    power = 1
    while SCALE_ENDS[-1] * power < largest and 10 * SCALE_ENDS[0] * power < largest:
        power *= 10
    end = next(
        (end * power for end in SCALE_ENDS if end * power >= largest), 10 * SCALE_ENDS[0] * power
    )
    begins = [
        max(n, _rounded(end * ((n - 1) / (HEAT_LEVELS - 1)) ** 2)) for n in range(1, HEAT_LEVELS)
    ]
    return Scale(tuple(begins), end)


def levels_of(values: NDArray[np.int32], scale: Scale) -> NDArray[np.uint8]:
    """The level of each value."""
    begins = np.array(scale.begins, values.dtype)
    return (
        np.searchsorted(begins, values.reshape(-1), "right").astype(np.uint8).reshape(values.shape)
    )


def _rounded(number: float) -> int:
    """To two digits, which a reader can remember."""
    digits = len(str(int(number)))
    unit: int = 10 ** max(digits - 2, 0)
    return round(number / unit) * unit
