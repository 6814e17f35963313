"""How many examples the long property tests draw."""

import os


def examples(many: int) -> int:
    """Half of them, so that all tests take some minutes on two cores; all with the profile explore."""
    return many if os.environ.get("HYPOTHESIS_PROFILE") == "explore" else many // 2
