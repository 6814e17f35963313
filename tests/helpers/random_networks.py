"""Zone networks of random weights."""

import numpy as np

from strategies.routing.routing_parameters import ZoneNetwork


def random_network(seed, zones=70, widths=(9, 6, 11), scale=1.0, floor="none"):
    """A network of random weights, and what it was "trained" for."""
    rng = np.random.default_rng(seed)
    layers, inputs = [], 2 * zones
    for outputs in (*widths, zones):
        weights = rng.normal(0, scale / np.sqrt(inputs), (inputs, outputs))
        layers.append((weights.astype(np.float16), rng.normal(0, 0.3, outputs).astype(np.float16)))
        inputs = outputs
    return ZoneNetwork(tuple(layers), {"floor": floor, "scenario": "drawn", "mode": "undirected"})
