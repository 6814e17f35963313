"""Training of a zone network with PyTorch (Bhattathiri, Li & Kuhl, section 5.1); needs the extra `learn`.

    one-hot start and end zone -> 256 -> 256 -> 256 -> a sigmoid for each zone      (3 hidden layers)

Adam; initial weights from Glorot's uniform distribution, biases 0. One thread and a separate random
generator make results reproducible on equal machines. After each epoch the network answers all training
legs; weights are stored when all monitored metrics have improved.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Any, Final

import numpy as np
import torch
from torch.nn import functional

from automaton.engine.state import NIL
from automaton.papers.leg_samples import Legs
from automaton.papers.training_settings import (
    MEASURES,
    AnswerCounts,
    Settings,
    counts,
    first_bias,
    sample_weights,
)

HIDDEN_WIDTH: Final = 256  # width of a hidden layer
AT_ONCE: Final = 3000  # legs answered in one batch
NO_ANSWERS: Final = AnswerCounts(0, 0, 0, 0)

Keep = tuple[str, ...]  # metrics that must all improve; (): the loss
Layers = tuple[tuple[Any, Any], ...]  # (weights, bias) float32, as in ZoneNetwork


@dataclass
class Checkpoint:
    """The weights of the best epoch so far, by the monitored metrics."""

    epoch: int = 0
    loss: float = math.inf
    counts: AnswerCounts = NO_ANSWERS
    layers: Layers = ()

    def improved(self, keep: Keep, loss: float, now: AnswerCounts) -> bool:
        """Whether an epoch is better in all monitored metrics; the first epoch always is."""
        if self.epoch == 0:
            return True
        if not keep:
            return loss < self.loss
        return all(MEASURES[name].improves(now, self.counts) for name in keep)


@dataclass
class Trained:
    """The result of a training: stored weights by monitored metrics, and the loss of each epoch."""

    kept: dict[Keep, Checkpoint]
    losses: list[float] = field(default_factory=list)


OnEpoch = Callable[
    [int, float, AnswerCounts], None
]  # epoch from 1, its mean loss, answers after it


def train(
    legs: Legs, settings: Settings, keeps: Sequence[Keep] = ((),), on_epoch: OnEpoch | None = None
) -> Trained:
    """Train once, and store weights for each of `keeps`.

    Ends after `settings.epochs`, or when the mean loss has not reached a new minimum for
    `settings.patience` epochs.
    """
    threads = torch.get_num_threads()
    torch.set_num_threads(1)  # fixes the order of summation
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
    """Do one gradient step."""
    optimizer.zero_grad()
    value.backward()
    optimizer.step()


def enter(trained: Trained, epoch: int, loss: float, now: AnswerCounts, network: Any) -> None:
    """Store the loss of an epoch, and its weights where all monitored metrics have improved."""
    trained.losses.append(loss)
    for keep, kept in trained.kept.items():
        if kept.improved(keep, loss, now):
            trained.kept[keep] = Checkpoint(epoch, loss, now, as_arrays(network))


def input_rows(legs: Legs) -> Any:
    """(n, 2) rows of the first layer's weights; their sum is the product with the one-hot input."""
    zones = legs.touched.shape[1]
    start = np.where(legs.start_zone == NIL, 2 * zones, legs.start_zone)
    end = np.where(legs.end_zone == NIL, 2 * zones, legs.end_zone + zones)
    return torch.from_numpy(np.stack([start, end], axis=1).astype(np.int64))


def first_layers(zones: int, bias: float, generator: Any, hidden: int) -> list[tuple[Any, Any]]:
    """The initial layers; the first layer has a last row of zeros, for cells without a zone."""
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
    """The mean loss over legs and zones; `weights`: of y = 0 and y = 1 (see training_settings)."""
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
    """(n, zones) bool array: the zones with a probability above 1/2."""
    with torch.no_grad():
        parts = [logits(network, some) > 0 for some in rows.split(AT_ONCE)]
    return torch.cat(parts).numpy()


def as_arrays(network: Sequence[tuple[Any, Any]]) -> Layers:
    """Copies of the weights, without the row of zeros."""
    layers = [tuple(part.detach().numpy().copy() for part in layer) for layer in network]
    first, bias = layers[0]
    return ((first[:-1], bias), *((weights, bias) for weights, bias in layers[1:]))
