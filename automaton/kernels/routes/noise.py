"""Predictions that err: the zones of a robot's task, as a classifier of some precision would see them.

Every zone is drawn for itself, addressed by (seed, task, robot, zone): a zone of the task is kept with
probability recall, another one is added with such a probability that the precision comes out.
"""

import numpy as np

from automaton.compiled import kernel
from automaton.kernels.draws import PREDICTIONS, draw, mix
from automaton.kernels.routes.replay import WORD

CERTAIN = 1 << 32  # probabilities are whole numbers of 2^-32


@kernel
def blur(used, zones, keep, add, seed, task, robot):
    """Replace a set of zones by its prediction; keep, add: probabilities in units of 1/CERTAIN."""
    base = draw(seed, PREDICTIONS, task, robot)
    for zone in range(zones):
        bit = np.int64(1) << (zone & (WORD - 1))
        chance = np.int64(mix(base + np.uint64(zone)) >> np.uint64(32))
        if used[zone >> 6] & bit:
            if chance >= keep:
                used[zone >> 6] &= ~bit
        elif chance < add:
            used[zone >> 6] |= bit


@kernel
def false_alarms(keep, precision, members, zones):
    """The probability `add` with which `members` zones of so many are seen with this precision.

    Of the zones then seen, the share `precision` is right on average. All probabilities are in
    units of 1/CERTAIN.
    """
    others = zones - members
    if others == 0:
        return np.int64(0)
    wrong = keep * (members * ((CERTAIN - precision) / precision)) / others
    return np.int64(min(wrong, float(CERTAIN)))
