"""A trained network that predicts the zones of a leg, in whole numbers: equal on every machine.

    legs of a robot -> (start zone, end zone) -> three hidden layers -> a logit for each zone

All numbers are fixed-point, value * 2^bits. A sum of integers does not depend on its order, so a
compiler may reorder it as it likes. The words of a packed network, two int32 in each int64:

    zones, width 1, width 2, width 3, bits, 0, 0, 0, then the weights (inputs, outputs) and the bias
    of each layer; the first layer has a row for each start zone and then one for each end zone
"""

import numpy as np

from automaton.compiled import kernel
from automaton.world.state import NIL

HEADER = 8  # numbers before the first layer


@kernel
def predict_zones(network, scratch, start, end, touched):
    """Set touched[z] = 1 for the zones that a leg is predicted to touch; others stay as they are.

    `network`: a packed network; `scratch`: (scratch_of(network),) int64; `start`, `end`: zones or
    NIL. A zone is predicted when its probability is above 1/2, which is when its logit is above 0.
    """
    numbers = network.view(np.int32)
    zones, bits = np.int64(numbers[0]), np.int64(numbers[4])
    first, second, third = np.int64(numbers[1]), np.int64(numbers[2]), np.int64(numbers[3])
    at = HEADER
    one = scratch[:first]
    one[:] = 0
    if start != NIL:
        add_row(numbers[at + start * first :], 1, one)
    if end != NIL:
        add_row(numbers[at + (zones + end) * first :], 1, one)
    at += 2 * zones * first
    add_row(numbers[at:], 1, one)
    at += first
    two = scratch[first : first + second]
    at = add_layer(numbers, at, 0, bits, one, two)
    three = scratch[first + second : first + second + third]
    at = add_layer(numbers, at, bits, bits, two, three)
    logit = scratch[first + second + third : first + second + third + zones]
    add_layer(numbers, at, bits, bits, three, logit)
    for z in range(zones):
        if logit[z] > 0:
            touched[z] = 1


@kernel
def add_layer(numbers, at, shift, bits, inputs, sums):
    """sums = weights of the positive inputs >> shift, and bias; returns where the next layer begins."""
    outputs = sums.shape[0]
    bias = at + inputs.shape[0] * outputs
    sums[:] = 0
    add_row(numbers[bias:], np.int64(1) << bits, sums)
    for i in range(inputs.shape[0]):
        factor = inputs[i] >> shift
        if factor > 0:
            add_row(numbers[at + i * outputs :], factor, sums)
    return bias + outputs


@kernel
def add_row(row, factor, sums):
    """sums[j] += factor * row[j]."""
    for j in range(sums.shape[0]):
        sums[j] += np.int64(row[j]) * factor
