"""Proofs are long versions of what tests sample: run by hand, they print counts; pytest leaves them out.

    python tests/proofs/refinement.py [CASES]

This one counts the drawn worlds whose states a finer tick leaves as they are, by rule of following, by
how often a want is put to the fine world, and by how much finer it is (`refinement_trials` says what
is compared). Exits with 1 unless all are under `none` and `convoy`.
"""

from __future__ import annotations

import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[1] / "helpers"))

from moving_worlds import WORLDS
from refinement_trials import ALWAYS, ONCE, drawn_case, is_refined


def main(number: int) -> int:
    """Print the table of all worlds and rules; returns the exit code."""
    cases = [drawn_case(seed) for seed in range(number)]
    exact = True
    print("world        following  put     " + "".join(f"  K = {fine}" for fine in (2, 3, 5)))
    for make, following in WORLDS:
        for put in (ONCE, ALWAYS):
            same = [
                sum(is_refined(make, case, following, fine, put) for case in cases)
                for fine in (2, 3, 5)
            ]
            exact &= following == "handover" or min(same) == number
            counts = "".join(f"{count:7}" for count in same)
            print(f"{make.__name__:<12} {following:<10} {put:<8}{counts}", flush=True)
    print(f"of {number} worlds each")
    return 0 if exact else 1


if __name__ == "__main__":
    sys.exit(main(int(sys.argv[1]) if len(sys.argv) > 1 else 300))
