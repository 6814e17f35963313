"""Legs to learn from: drives between racks and docks, and the zones that A* takes them through.

A network learns which zones a leg touches from the zones in which it starts and ends. A leg touches
the zone of every cell that its moves leave; ties of A* are settled first in, first out. Legs of a
training, others to judge it by, and the network that comes of it make a study.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, Final, NamedTuple

import numpy as np
import numpy.typing as npt
import torch
from torch.nn import functional

from automaton.engine.state import NIL
from automaton.errors import InputError
from automaton.floor.cells import DOCK, RACK
from automaton.papers.training_settings import (
    MEASURES,
    AnswerCounts,
    Settings,
    counts,
    first_bias,
    measured,
    sample_weights,
)
from automaton.scenario.robot_types import RobotType, types_of
from automaton.world.prepared_floor import Floor, floor_for, frozen
from automaton.world.resolve import Resolved
from automaton.world.rules import duration_table
from automaton.world.starts import first_headings
from strategies.routing import predicted_paths
from strategies.routing.astar import FIFO, route_space
from strategies.routing.predicted_paths import words
from strategies.routing.routing_parameters import ZoneNetwork, floor_fingerprint, predicted_zones

Cells = npt.NDArray[np.int32]


class Legs(NamedTuple):
    """n legs on a floor of Z zones."""

    start: Cells  # (n,) flat cells
    end: Cells  # (n,)
    start_zone: npt.NDArray[np.int64]  # (n,) NIL on an intersection
    end_zone: npt.NDArray[np.int64]  # (n,)
    touched: npt.NDArray[np.bool_]  # (n, Z)

    def some(self, mask: npt.NDArray[np.bool_]) -> Legs:
        """The legs of a mask (n,)."""
        return Legs(
            self.start[mask],
            self.end[mask],
            self.start_zone[mask],
            self.end_zone[mask],
            self.touched[mask],
        )


class Site(NamedTuple):
    """Where legs are driven: a floor, its robots' ticks, and the cells between which they drive."""

    floor: Floor
    duration: npt.NDArray[np.int32]  # ticks of each action
    racks: Cells  # (r,) flat cells from which a rack is served, one for each
    docks: Cells  # (d,)


def site_of(resolved: Resolved) -> Site:
    """The site of a scenario: racks and docks, or else whatever holds loads and wherever they go.

    On a floor with neither, legs lead from any cell to any other. Raises InputError for a floor
    without zones: nothing could be learnt there.
    """
    kinematics = types_of(resolved.scenario)[0].kinematics
    all_alike = RobotType(durations=resolved.scenario.durations, kinematics=kinematics)
    floor = floor_for(resolved.floor_plan, resolved.scenario.world.traffic_zones, (all_alike,))
    if floor.grid.traffic_zone_count == 0:
        raise InputError(f"{resolved.scenario.name}: this floor has no zones to learn")
    kind = floor.grid.kind[floor.slot_cell]
    outer, inner = kind == DOCK, kind == RACK
    if not outer.any() or not inner.any():
        outer, inner = floor.slot_endless == 1, floor.slot_endless == 0
    racks, docks = _access(floor, inner), _access(floor, outer)
    if not racks.size or not docks.size:
        racks = docks = np.flatnonzero(resolved.floor_plan.drivable).astype(np.int32)
    duration = frozen(duration_table(all_alike))  # as strategies see it: the same compiled search
    return Site(floor, duration, racks, docks)


def _access(floor: Floor, mask: npt.NDArray[np.bool_]) -> Cells:
    """The first access cell of each slot of a mask that has one."""
    access = floor.slot_access[mask]
    served = access[(access != NIL).any(axis=1)]
    first: Cells = served[np.arange(len(served)), (served != NIL).argmax(axis=1)]
    return first


def legs_of(site: Site, count: int, seed: int) -> Legs:
    """`count` legs, rack to dock and dock to rack by turns, drawn uniformly by (seed, leg).

    Raises InputError if robots cannot drive one of them.
    """
    start, end = np.zeros(count, np.int32), np.zeros(count, np.int32)
    grid = site.floor.grid
    used = np.zeros((count, words(grid.traffic_zone_count)), np.int64)
    workspace = route_space(grid)
    with np.errstate(over="ignore"):
        predicted_paths.draw_legs(site.racks, site.docks, np.uint64(seed), start, end)
        poses = start.astype(np.int64) * grid.headings + first_headings(grid, start)
        driven = predicted_paths.trace_legs(grid, site.duration, workspace, FIFO, poses, end, used)
    if driven < count:
        raise InputError("robots cannot drive from everywhere to everywhere on this floor")
    zone = grid.traffic_zone[:, 0].astype(np.int64)
    return Legs(start, end, zone[start], zone[end], members(used, grid.traffic_zone_count))


def members(used: npt.NDArray[np.int64], zones: int) -> npt.NDArray[np.bool_]:
    """(n, zones) bool of sets (n, words) with a bit for each zone."""
    octets: Any = used.astype("<i8").view(np.uint8)
    return np.unpackbits(octets, axis=1, count=zones, bitorder="little").astype(np.bool_)


def unseen(new: Legs, known: Legs) -> npt.NDArray[np.bool_]:
    """(n,) mask of the legs between zones that none of the known legs connects in that direction."""
    zones = np.int64(new.touched.shape[1] + 1)

    def pair(some: Legs) -> npt.NDArray[np.int64]:
        return (some.start_zone + 1) * zones + some.end_zone + 1

    mask: npt.NDArray[np.bool_] = ~np.isin(pair(new), pair(known))
    return mask


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


# Training of a zone network with PyTorch (Bhattathiri, Li & Kuhl, section 5.1).
#
# one-hot start and end zone -> 256 -> 256 -> 256 -> a sigmoid for each zone (3 hidden layers)
#
# Adam, weights from Glorot's uniform distribution, biases 0. One thread, and draws from a generator
# of the seed's own: equal on equal machines. After each epoch the network answers all legs that it is
# trained on; weights are kept when everything that is monitored has improved.


HIDDEN_WIDTH: Final = 256  # of a hidden layer
AT_ONCE: Final = 3000  # legs that are answered in one go

Keep = tuple[str, ...]  # metrics that must all improve; () = the loss
Layers = tuple[tuple[Any, Any], ...]  # (weights, bias) float32, as ZoneNetwork's


NO_ANSWERS: Final = AnswerCounts(0, 0, 0, 0)


@dataclass
class Checkpoint:
    """The weights of the best epoch so far, by what is monitored."""

    epoch: int = 0
    loss: float = math.inf
    counts: AnswerCounts = NO_ANSWERS
    layers: Layers = ()

    def improved(self, keep: Keep, loss: float, now: AnswerCounts) -> bool:
        """Whether an epoch is better in all that is monitored; the first one is."""
        if self.epoch == 0:
            return True
        if not keep:
            return loss < self.loss
        return all(MEASURES[name].improves(now, self.counts) for name in keep)


@dataclass
class Trained:
    """What a training gave: kept weights by what was monitored, and the loss of each epoch."""

    kept: dict[Keep, Checkpoint]
    losses: list[float] = field(default_factory=list)


OnEpoch = Callable[
    [int, float, AnswerCounts], None
]  # epoch from 1, its mean loss, answers after it


def train(
    legs: Legs,
    settings: Settings,
    keeps: Sequence[Keep] = ((),),
    on_epoch: OnEpoch | None = None,
) -> Trained:
    """Train once; each of `keeps` keeps weights of its own.

    Ends after `settings.epochs`, or when the mean loss over `settings.patience` epochs in a row was
    not lower than before.
    """
    threads = torch.get_num_threads()
    torch.set_num_threads(1)  # sums in one order
    try:
        return _train(legs, settings, keeps, on_epoch)
    finally:
        torch.set_num_threads(threads)


def _train(
    legs: Legs, settings: Settings, keeps: Sequence[Keep], on_epoch: OnEpoch | None
) -> Trained:
    generator = torch.Generator().manual_seed(settings.seed)
    inputs, truth = input_rows(legs), torch.from_numpy(legs.touched)
    bias = first_bias(legs.touched) if settings.weighting == "bias" else 0.0
    weights = sample_weights(legs.touched) if settings.weighting == "samples" else (1.0, 1.0)
    network = first_layers(legs.touched.shape[1], bias, generator, settings.hidden)
    parts = [part for layer in network for part in layer]
    optimizer = torch.optim.Adam(parts, lr=settings.rate, fused=True)
    trained = Trained({keep: Checkpoint() for keep in keeps})
    waited, lowest = 0, math.inf
    for epoch in range(1, settings.epochs + 1):
        batches = torch.randperm(len(inputs), generator=generator).split(settings.batch)
        loss = 0.0
        for batch in batches:
            wanted = truth[batch].float()
            value = mean_loss(settings.loss, logits(network, inputs[batch]), wanted, weights)
            step(optimizer, value)
            loss += value.item() * len(batch) / len(inputs)
        now = counts(answers(network, inputs), legs.touched)
        enter(trained, epoch, loss, now, network)
        if on_epoch is not None:
            on_epoch(epoch, loss, now)
        waited = 0 if loss < lowest else waited + 1
        lowest = min(lowest, loss)
        if waited == settings.patience:
            break
    return trained


def step(optimizer: Any, value: Any) -> None:
    """Go down the slope of a loss."""
    optimizer.zero_grad()
    value.backward()
    optimizer.step()


def enter(trained: Trained, epoch: int, loss: float, now: AnswerCounts, network: Any) -> None:
    """Note the loss of an epoch, and its weights where all that is monitored has improved."""
    trained.losses.append(loss)
    for keep, kept in trained.kept.items():
        if kept.improved(keep, loss, now):
            trained.kept[keep] = Checkpoint(epoch, loss, now, as_arrays(network))


def input_rows(legs: Legs) -> Any:
    """(n, 2) rows of the first layer's weights: the product with a one-hot input is their sum."""
    zones = legs.touched.shape[1]
    start = np.where(legs.start_zone == NIL, 2 * zones, legs.start_zone)
    end = np.where(legs.end_zone == NIL, 2 * zones, legs.end_zone + zones)
    return torch.from_numpy(np.stack([start, end], axis=1).astype(np.int64))


def first_layers(zones: int, bias: float, generator: Any, hidden: int) -> list[tuple[Any, Any]]:
    """Layers before training; the first one has a last row of zeros, for a cell in no zone."""
    layers = []
    inputs = 2 * zones
    for outputs in (*[HIDDEN_WIDTH] * hidden, zones):
        limit = math.sqrt(6 / (inputs + outputs))  # Glorot & Bengio 2010
        weights = torch.empty(inputs, outputs).uniform_(-limit, limit, generator=generator)
        layers.append((weights, torch.zeros(outputs)))
        inputs = outputs
    first = torch.cat([layers[0][0], torch.zeros(1, HIDDEN_WIDTH)])
    layers[0] = (first, layers[0][1])
    layers[-1][1].fill_(bias)
    for layer in layers:
        for part in layer:
            part.requires_grad_()
    return layers


def logits(network: Sequence[tuple[Any, Any]], rows: Any) -> Any:
    """(n, zones) logits of inputs (n, 2)."""
    weights, bias = network[0]
    none = len(weights) - 1
    active = functional.embedding_bag(rows, weights, mode="sum", padding_idx=none) + bias
    for weights, bias in network[1:]:
        active = torch.relu(active) @ weights + bias
    return active


def mean_loss(name: str, logit: Any, y: Any, weights: tuple[float, float]) -> Any:
    """The mean over legs and zones; `weights` of y = 0 and y = 1 (see training_settings)."""
    if name == "cross-entropy":
        each = functional.binary_cross_entropy_with_logits(logit, y, reduction="none")
    elif name == "hinge":
        each = (1 - y * torch.sigmoid(logit)).clamp(min=0)
    elif name == "signed-hinge":
        each = (1 - (2 * y - 1) * torch.sigmoid(logit)).clamp(min=0)
    else:
        raise ValueError(f"no loss is called {name!r}")
    if weights != (1.0, 1.0):
        each = each * (weights[0] + (weights[1] - weights[0]) * y)
    return each.mean()


def answers(network: Sequence[tuple[Any, Any]], rows: Any) -> Any:
    """(n, zones) bool array: the zones of probability above 1/2."""
    with torch.no_grad():
        parts = [logits(network, some) > 0 for some in rows.split(AT_ONCE)]
    return torch.cat(parts).numpy()


def as_arrays(network: Sequence[tuple[Any, Any]]) -> Layers:
    """Copies of the weights; without the row of zeros."""
    layers = [tuple(part.detach().numpy().copy() for part in layer) for layer in network]
    first, bias = layers[0]
    return ((first[:-1], bias), *((weights, bias) for weights, bias in layers[1:]))
