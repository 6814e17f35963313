"""A trained network that predicts the zones of a leg, in whole numbers: equal on every machine.

    start zone, end zone -> three hidden layers of rectifiers -> a logit for each zone

All numbers are fixed-point, value * 2^bits. A sum of integers does not depend on its order, so a
compiler may reorder it as it likes. A packed network has two int32 in each of its words:

    zones, width 1, width 2, width 3, bits, 0, 0, 0, then weights (inputs, outputs) and bias of each
    layer; the first layer has a row for each start zone and then one for each end zone
"""

import numpy as np

from automaton.engine.jit.kernel import kernel
from automaton.engine.state import NIL
from strategies.routing.traffic_avoidance.path_zones import WORD

NETWORK_HEADER_WORDS = 8  # numbers before the first layer
BITS = 4  # the place of `bits` in it


@kernel
def add_predicted(network, scratch, start, end, used):
    """Add the zones that a leg is predicted to touch to a set; used: (words,) int64, a bit for each.

    `network`: packed; `scratch`: an int64 for each neuron; `start`, `end`: zones or NIL. Predicted
    is what has a probability above 1/2: a logit above 0.
    """
    numbers = network.view(np.int32)
    zones, bits, width = np.int64(numbers[0]), np.int64(numbers[BITS]), np.int64(numbers[1])
    sums = scratch[:width]
    sums[:] = 0
    if start != NIL:
        add_row(numbers[NETWORK_HEADER_WORDS + start * width :], 1, sums)
    if end != NIL:
        add_row(numbers[NETWORK_HEADER_WORDS + (zones + end) * width :], 1, sums)
    at = NETWORK_HEADER_WORDS + 2 * zones * width
    add_row(numbers[at:], 1, sums)
    at += width
    begin = np.int64(0)
    for layer in range(1, 4):
        after = np.int64(numbers[1 + layer]) if layer < 3 else zones
        inputs = scratch[begin : begin + width]
        begin += width
        sums = scratch[begin : begin + after]
        at = add_layer(numbers, at, bits if layer > 1 else 0, bits, inputs, sums)
        width = after
    for zone in range(zones):
        if sums[zone] > 0:
            used[zone >> 6] |= np.int64(1) << (zone & (WORD - 1))


@kernel
def add_layer(numbers, at, shift, bits, inputs, sums):
    """sums = weights x the positive inputs >> shift, and the bias; returns where the next begins."""
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


@kernel
def predict_legs(network, scratch, start, end, used):
    """used[k] = the predicted zones of leg k: start, end (n,) int64 zones or NIL; used (n, words)."""
    for k in range(start.shape[0]):
        used[k] = 0
        add_predicted(network, scratch, start[k], end[k], used[k])
