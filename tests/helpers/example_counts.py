"""How many examples a property is tried on."""

from __future__ import annotations

import os

THOROUGH = 10  # times as many where new examples are wanted


def examples(number: int) -> int:
    """So many in each run of all tests, more with HYPOTHESIS_PROFILE=explore."""
    return number * (THOROUGH if os.environ.get("HYPOTHESIS_PROFILE") == "explore" else 1)
