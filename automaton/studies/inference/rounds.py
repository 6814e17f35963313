"""How many runs come next, where a study goes on until its intervals are as narrow as declared.

    next = the runs that the variances found so far take, but at least 1.1 n and at most 2 n

The smallest step keeps the looks at the data few; the largest keeps a first round whose runs differ
much by chance from asking for far too many. Whoever stops when the interval is narrow stops more often
where the variance happens to be small: a little less often than declared the interval holds the
truth. tests/helpers/statistics_trials.py rounds measures it.
"""

from __future__ import annotations

import math
from typing import Final

MIN_GROWTH: Final = 1.1  # of the runs from one round to the next
MAX_GROWTH: Final = 2.0


def next_round(n: int, wanted: int, at_most: int) -> int | None:
    """Runs of each point after the next round; None if `n` are enough, or are all there may be.

    `wanted`: the runs that the declared precision takes, by their variances.
    """
    if wanted <= n or n >= at_most:
        return None
    least, most = math.ceil(MIN_GROWTH * n), math.floor(MAX_GROWTH * n)
    return min(at_most, max(least, min(most, wanted)))
