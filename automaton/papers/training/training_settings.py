"""How a network is trained; the defaults are those of Bhattathiri, Li & Kuhl where they print them."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Settings:
    """All that a training follows from, its legs aside."""

    loss: str = "cross-entropy"  # of automaton.papers.training.losses.LOSSES
    weighting: str = "none"  # of WEIGHTINGS
    batch: int = 32  # legs
    epochs: int = 100  # at most
    patience: int = 5  # epochs without lower loss after which training ends
    rate: float = 0.001  # of Adam; the paper prints none
    seed: int = 1  # of the first weights, the legs and their order
    hidden: int = 3  # layers of 256
    legs: int = 15_000  # half from racks to docks, half back
