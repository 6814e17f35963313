"""A trained network that predicts the zones of a leg, in whole numbers: equal on every machine.

    start zone, end zone -> three hidden layers of rectifiers -> a logit for each zone

All numbers are fixed-point, value * 2^bits. A sum of integers does not depend on its order, so a
compiler may reorder it as it likes.
"""

from functools import lru_cache

import numpy as np

from automaton.engine.jit.kernel import kernel
from automaton.engine.jit.structs import CONSTANT, SCRATCH, Struct, field
from automaton.engine.state import NIL, Array
from strategies.routing.traffic_avoidance.network_files import whole_layers
from strategies.routing.traffic_avoidance.path_zones import WORD


class DenseLayer(Struct):
    """A layer of a network, and room for what comes out of it."""

    weights: Array = field("(inputs, outputs) int32", role=CONSTANT)
    bias: Array = field("(outputs,) int32", role=CONSTANT)
    sums: Array = field("(outputs,) int64", role=SCRATCH)


class KernelNetwork(Struct):
    """A network as kernels read it. The first layer has a row for each start zone, then end zone."""

    bits: int = field("int64", "after the binary point")
    zones: int = field("int64", "0: there is no network")
    first: DenseLayer
    second: DenseLayer
    third: DenseLayer
    last: DenseLayer


def no_network():
    """What stands for a network where none is used."""
    layers = {
        name: DenseLayer.sized({"inputs": 0, "outputs": 0})
        for name in ("first", "second", "third", "last")
    }
    return KernelNetwork(bits=0, zones=0, **layers)


@lru_cache(maxsize=4)
def _short_layers(network):
    """The layers as whole numbers in int32, for kernels; read-only, since all runs share them."""
    layers = [
        (weights.astype(np.int32), bias.astype(np.int32))
        for weights, bias in whole_layers(network)[1]
    ]
    for part in (part for layer in layers for part in layer):
        part.setflags(write=False)
    return layers


def kernel_network(network):
    """The network as kernels read it, with scratch of its own."""
    first, second, third, last = (
        DenseLayer.sized(weights=weights, bias=bias) for weights, bias in _short_layers(network)
    )
    return KernelNetwork(
        bits=whole_layers(network)[0],
        zones=network.zones,
        first=first,
        second=second,
        third=third,
        last=last,
    )


@kernel
def add_predicted(network, start, end, used):
    """Add the zones that a leg is predicted to touch to a set; used: (words,) int64, a bit for each.

    `start`, `end`: zones or NIL. Predicted is what has a probability above 1/2: a logit above 0.
    """
    first, bits = network.first, network.bits
    first.sums[:] = 0
    if start != NIL:
        add_row(first.weights[start], 1, first.sums)
    if end != NIL:
        add_row(first.weights[network.zones + end], 1, first.sums)
    add_row(first.bias, 1, first.sums)
    run_layer(network.second, 0, bits, first.sums)
    run_layer(network.third, bits, bits, network.second.sums)
    run_layer(network.last, bits, bits, network.third.sums)
    for zone in range(network.zones):
        if network.last.sums[zone] > 0:
            used[zone >> 6] |= np.int64(1) << (zone & (WORD - 1))


@kernel
def run_layer(layer, shift, bits, inputs):
    """layer.sums = weights x the positive inputs >> shift, and the bias."""
    layer.sums[:] = 0
    add_row(layer.bias, np.int64(1) << bits, layer.sums)
    for i in range(inputs.shape[0]):
        factor = inputs[i] >> shift
        if factor > 0:
            add_row(layer.weights[i], factor, layer.sums)


@kernel
def add_row(row, factor, sums):
    """sums[j] += factor * row[j]."""
    for j in range(sums.shape[0]):
        sums[j] += np.int64(row[j]) * factor


@kernel
def predict_legs(network, start, end, used):
    """used[k] = the predicted zones of leg k: start, end (n,) int64 zones or NIL; used (n, words)."""
    for k in range(start.shape[0]):
        used[k] = 0
        add_predicted(network, start[k], end[k], used[k])
