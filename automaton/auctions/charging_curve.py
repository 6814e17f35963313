"""The charging curve, a step function: units per tick by the level at the start of the tick.

One piece is the linear curve. Further pieces make a taper; the time to charge from a to b is then the
sum over the pieces in between, each in whole ticks.
"""

import numpy as np

from automaton.compiled import kernel


@kernel
def charging_ticks(battery, low, high):
    """Ticks of charging from level `low` until the level is at least `high`."""
    ticks = np.int64(0)
    level = np.int64(low)
    last = battery.curve_rate.shape[0] - 1
    for k in range(last + 1):
        until = high if k == last else min(high, np.int64(battery.curve_from[k + 1]))
        if level < until:
            rate = np.int64(battery.curve_rate[k])
            needed = (until - level + rate - 1) // rate
            level += needed * rate
            ticks += needed
    return ticks


@kernel
def level_after(battery, low, ticks, full):
    """The level after so many ticks of charging; never above `full`."""
    level = np.int64(low)
    left = np.int64(ticks)
    last = battery.curve_rate.shape[0] - 1
    for k in range(last + 1):
        rate = np.int64(battery.curve_rate[k])
        if k < last:
            until = np.int64(battery.curve_from[k + 1])
            used = min(left, max((until - level + rate - 1) // rate, np.int64(0)))
        else:
            used = left
        level += used * rate
        left -= used
    return min(level, np.int64(full))
