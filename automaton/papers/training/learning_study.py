"""A training from beginning to end: legs, network, and how well it predicts legs it never saw."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np

from automaton.papers.training.leg_samples import Legs, Site, legs_of, unseen
from automaton.papers.training.prediction_metrics import measured
from strategies.routing.traffic_avoidance.network_files import (
    ZoneNetwork,
    floor_fingerprint,
    predicted_zones,
)

TRAINING, UNUSED, UNSEEN = "training", "unused seed", "unseen pairs"


class Data(NamedTuple):
    """The legs of a study, by what they are for."""

    training: Legs
    unused: Legs  # as many, drawn with the next seed
    unseen: Legs  # those of them between zones that no leg of training connects

    def by_name(self) -> Mapping[str, Legs]:
        return {TRAINING: self.training, UNUSED: self.unused, UNSEEN: self.unseen}


def data_of(site: Site, legs: int, seed: int) -> Data:
    """Legs of `seed` to train with, and of `seed + 1` to judge by. Raises InputError."""
    training, unused = legs_of(site, legs, seed), legs_of(site, legs, seed + 1)
    return Data(training, unused, unused.some(unseen(unused, training)))


def network_of(layers: Any, site: Site, scenario: str, mode: str, about: Any) -> ZoneNetwork:
    """A network as it is kept in a file: float16, with what it was trained for and how."""
    kept = tuple((weights.astype(np.float16), bias.astype(np.float16)) for weights, bias in layers)
    origin = {
        "scenario": scenario,
        "mode": mode,
        "floor": floor_fingerprint(site.floor.grid, site.duration),
    }
    return ZoneNetwork(kept, origin | dict(about))


def judged(network: ZoneNetwork, data: Data) -> dict[str, dict[str, float]]:
    """All measures of a network's own answers on each kind of legs; an empty kind is left out."""
    return {
        name: measured(predicted_zones(network, legs.start_zone, legs.end_zone), legs.touched)
        for name, legs in data.by_name().items()
        if len(legs.touched)
    }
