"""A metric over time, drawn in braille: two points of time and four levels in each character.

A curve is filled, or a line where two of them have to differ by more than their colours.

24 ⡀   ⢀⣀⡀        The label of the greatest value is above, 0 below; the last column but the
 0 ⣷⣶⣶⣿⣿⣷         labels is the last tick. Without braille one point in each character.
"""

from __future__ import annotations

from typing import Final

import numpy as np
from numpy.typing import NDArray

from automaton.engine.observation import DELIVERED_ORDERS, WAITING_ROBOTS
from automaton.history.event_history import Curve
from automaton.units import number

Values = NDArray[np.float64]
LABEL_WIDTH: Final = 7  # columns for labels, the blank behind them included
SAMPLES: Final = 64  # of the rows between two points, at most so many are looked at
NOW_TICKS: Final = 500  # "now" in throughput: the deliveries of the last so many ticks
# Bits of a braille pattern, from the lowest dot up, of the left and the right column.
RISING: Final = np.array([[0x40, 0x44, 0x46, 0x47], [0x80, 0xA0, 0xB0, 0xB8]])
STEPS_OF_TEN: Final = (1, 1.5, 2, 3, 4, 5, 6, 8, 10)  # where an axis may end
CURVE_CHARACTERS: Final = " .:|"  # the filling of a character in ASCII
LINE_CHARACTERS: Final = " .-'"  # the height of a line in it


def edges(ticks: int, points: int) -> NDArray[np.int64]:
    """(points + 1,) ticks at which the points of a curve begin and end."""
    return np.linspace(0, ticks, points + 1).astype(np.int64)


def throughput(curve: Curve, points: int) -> Values:
    """(points,) deliveries per 1,000 ticks, each over the last NOW_TICKS or longer."""
    bounds = edges(curve.ticks, points)
    return _rate(curve, np.minimum(bounds[:-1], bounds[1:] - NOW_TICKS), bounds[1:])


def _rate(curve: Curve, begin: NDArray[np.int64], end: NDArray[np.int64]) -> Values:
    """Deliveries per 1,000 ticks, between ticks of which the curve has rows."""
    end = end - end % curve.every
    begin = np.clip(begin - begin % curve.every, 0, np.maximum(0, end - curve.every))
    made = curve.at(end, DELIVERED_ORDERS) - curve.at(begin, DELIVERED_ORDERS)
    rate: Values = 1000.0 * made / np.maximum(1, end - begin)
    return rate


def waiting(curve: Curve, points: int) -> Values:
    """(points,) mean number of robots that wait."""
    bounds = edges(curve.ticks, points)
    width = np.maximum(1, np.diff(bounds))
    steps = np.arange(SAMPLES) / SAMPLES
    ticks = (bounds[:-1, None] + (width[:, None] * steps)).astype(np.int64) + 1
    mean: Values = curve.at(ticks, WAITING_ROBOTS).mean(axis=1)
    return mean


def now_throughput(curve: Curve) -> float:
    """Deliveries per 1,000 ticks over the last NOW_TICKS."""
    last = np.array([curve.ticks])
    return float(_rate(curve, last - NOW_TICKS, last)[0])


def points_for(width: int, dots: bool) -> int:
    """How many points a curve of so many columns has."""
    return max(1, (width - LABEL_WIDTH) * (2 if dots else 1))


def drawn(values: Values, rows: int, dots: bool, filled: bool = True) -> list[str]:
    """Rows of characters, labels included; the greatest value is as high as all rows."""
    top = nice(float(values.max(initial=0.0)))
    levels = 4 if dots else len(CURVE_CHARACTERS) - 1
    heights = np.round(values / top * rows * levels).astype(np.int64)
    heights = np.maximum(heights, (values > 0).astype(np.int64))
    below = np.zeros_like(heights) if filled else _below_line(heights)
    signs = CURVE_CHARACTERS if filled else LINE_CHARACTERS
    lifted = [(rows - 1 - row) * levels for row in range(rows)]
    bodies = [_row(heights - lift, below - lift, "" if dots else signs) for lift in lifted]
    labels = [number(top), *[""] * (rows - 2), "0"]
    return [
        f"{label:>{LABEL_WIDTH - 1}} {body}" for label, body in zip(labels, bodies, strict=True)
    ]


def _below_line(heights: NDArray[np.int64]) -> NDArray[np.int64]:
    """(points,) what is left out under a line: it rises from the point before, and is never broken."""
    before = np.concatenate((heights[:1], heights[:-1]))
    return np.maximum(0, np.minimum(heights - 1, before))


def _row(heights: NDArray[np.int64], below: NDArray[np.int64], signs: str) -> str:
    """One row from what reaches into it, without what is below: in these signs, or in braille."""
    if signs:
        levels = np.clip(heights, 0, len(signs) - 1)
        levels = np.where(below >= len(signs) - 1, 0, levels)
        return "".join(signs[level] for level in levels)
    filled = np.concatenate((np.zeros((2, 1), np.int64), RISING), axis=1)
    top, bottom = (np.clip(one, 0, 4).reshape(-1, 2) for one in (heights, below))
    patterns = filled[0, top[:, 0]] | filled[1, top[:, 1]]
    patterns &= ~(filled[0, bottom[:, 0]] | filled[1, bottom[:, 1]])
    return "".join(chr(0x2800 + pattern) for pattern in patterns.tolist())


def nice(value: float) -> float:
    """The next of STEPS_OF_TEN times a power of ten."""
    if value <= 0:
        return 1.0
    power = 10.0 ** np.floor(np.log10(value))
    return float(next(step * power for step in STEPS_OF_TEN if value <= step * power * 1.000001))
