"""The parameters of traffic avoidance. Imports no Numba."""

from __future__ import annotations

import os
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

import msgspec
from msgspec import Meta

from strategies.routing.astar.astar_parameters import TieBreaking

if TYPE_CHECKING:
    from automaton.engine.state import Array, Grid


Share = Annotated[float, Meta(gt=0, le=1)]


class NetworkFile(msgspec.Struct, forbid_unknown_fields=True, frozen=True, kw_only=True):
    """A network of one's own."""

    network: Annotated[
        str,
        Meta(
            min_length=1,
            description="A file written by `automaton train traffic`, found from the scenario's folder.",
        ),
    ]


class Avoidance(TieBreaking, forbid_unknown_fields=True, frozen=True, kw_only=True):
    """What is predicted of other robots, and how many of them in a zone are too many."""

    predictor: Annotated[
        Literal["exact", "noisy", "network"] | NetworkFile,
        Meta(
            description="exact: the zones on the others' A* paths; noisy: some of them missed and "
            "others added, by precision and recall; network: what a trained network says, the "
            "shipped one, for warehouse-100, or that of a file."
        ),
    ] = "exact"
    precision: Annotated[
        Share | None, Meta(description="noisy: the share of the predicted zones that are right.")
    ] = None
    recall: Annotated[
        Share | None, Meta(description="noisy: the share of the used zones that are predicted.")
    ] = None
    prevalence: Annotated[
        Annotated[float, Meta(gt=0, lt=1)] | None,
        Meta(
            description="noisy: the share of all zones that a task uses on average; on it depends "
            "how many others are predicted. Left out: as in warehouse-100, 27.5 of 522."
        ),
    ] = None
    max_threshold: Annotated[
        int, Meta(ge=1, le=1000, description="Zones with A others are closed, A = 1 to this.")
    ] = 6
    closed_from: Annotated[
        Literal["A", "more than A"],
        Meta(
            description="How many others close a zone: A or more of them, or more than A, as Shaji "
            "Bhattathiri, Li and Kuhl print it (then one other never closes a zone)."
        ),
    ] = "A"

    @property
    def least_count(self) -> int:
        """The fewest others for which a zone is closed, where A = 1."""
        return 1 if self.closed_from == "A" else 2

    def __post_init__(self) -> None:
        given = [value is not None for value in (self.precision, self.recall)]
        if self.predictor == "noisy" and not all(given):
            raise ValueError("predictor: noisy needs precision and recall")
        if self.predictor != "noisy" and (any(given) or self.prevalence is not None):
            raise ValueError("precision, recall and prevalence are for predictor: noisy only")

    @property
    def files(self) -> tuple[Path, ...]:
        """The file of a network of one's own."""
        return (Path(self.predictor.network),) if isinstance(self.predictor, NetworkFile) else ()

    @property
    def network(self) -> Path:
        """The file of the network that is installed, or of one's own."""
        from strategies.routing.traffic_avoidance.network_files import shipped

        return shipped("warehouse-100") if self.predictor == "network" else self.files[0]

    def check_files(self, driving: Callable[[], tuple[Grid, Array]]) -> None:
        """Raises InputError for a network that cannot be read, or is one of another floor."""
        from strategies.routing.traffic_avoidance.network_files import network_for, whole_layers

        if self.predictor not in ("exact", "noisy"):
            whole_layers(network_for(*driving(), self.network))

    def resolve_paths(self, folder: Path) -> Avoidance:
        """The same with that file found from a folder."""
        for file in self.files:
            found = os.path.abspath(folder / file)
            return msgspec.structs.replace(self, predictor=NetworkFile(network=found))
        return self
