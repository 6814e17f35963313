"""Weighted average consensus with Metropolis weights (Algorithm 3), and the spread about it (eq. 5).

x_i <- W_ii x_i + sum W_ij x_j over neighbours j,  W_ij = 1 / (1 + max(d_i, d_j)),  W_ii = 1 - sum.

Values are whole numbers, such as billionths of a minute, and what two neighbours exchange is rounded
towards zero: what one gains the other loses, so that every step preserves the sum to the last digit.
"""

from math import sqrt

import numpy as np

from automaton.engine.jit.kernel import kernel


@kernel
def moved(value, other, degree, other_degree):
    """How far a value moves towards that of a neighbour in a step."""
    gap = other - value
    weight = 1 + max(degree, other_degree)
    return gap // weight if gap >= 0 else -(-gap // weight)


@kernel
def sigma_about(load, reach, mean):
    """Eq. 5: spread of the loads with reach[z] = 1 about `mean`.

    The paper prints (L_i + x_i)^2 for the robot's own load; the authors' code has the minus.
    """
    count = np.int64(0)
    total = 0.0
    for z in range(load.shape[0]):
        if reach[z] == 1:
            total += (load[z] - mean) * (load[z] - mean)
            count += 1
    return sqrt(total / count) if count > 0 else 0.0
