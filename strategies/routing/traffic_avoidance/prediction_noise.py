"""Predictions that err: the zones of a robot's task, as a classifier of some precision would see them.

Every zone is drawn for itself, addressed by (seed, task, robot, zone): a zone of the task is kept with
probability recall, another one is added with the probability of `false_alarms`.
"""

from typing import Final

import numpy as np

from automaton.engine.jit.kernel import kernel
from automaton.strategy.kernels import random_bits, splitmix64
from strategies.routing.traffic_avoidance.path_zones import WORD

STREAM_PREDICTIONS = 11  # of random draws; each stream has a number of its own

CERTAIN = 1 << 32  # probabilities are whole numbers of 2^-32
USED_SHARE: Final = 27.5 / 522  # of the zones, by a task in warehouse-100 (A*, random ties)


@kernel
def blur(used, traffic_zone_count, keep, add, seed, task, robot):
    """Replace a set of zones by its prediction; keep, add: probabilities in units of 1/CERTAIN."""
    base = random_bits(seed, STREAM_PREDICTIONS, task, robot)
    for zone in range(traffic_zone_count):
        bit = np.int64(1) << (zone & (WORD - 1))
        chance = np.int64(splitmix64(base + np.uint64(zone)) >> np.uint64(32))
        if used[zone >> 6] & bit:
            if chance >= keep:
                used[zone >> 6] &= ~bit
        elif chance < add:
            used[zone >> 6] |= bit


def false_alarms(precision: float, recall: float, used: float) -> float:
    """The probability with which a zone that a task does not use is predicted all the same.

        recall * used * (1 - precision) / (precision * (1 - used))

    `used`: the share of the zones that a task uses on average. Of all zones that are predicted of
    many tasks, the share `precision` is then right.
    """
    return min(1.0, recall * used * (1 - precision) / (precision * (1 - used)))
