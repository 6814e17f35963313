"""The parameters of routing, and networks that predict zones: their files and NumPy inference."""

from __future__ import annotations

import hashlib
import json
import os
import zipfile
import zlib
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import lru_cache
from importlib import resources
from pathlib import Path
from typing import Annotated, Any, ClassVar, Final, Literal

import msgspec
import numpy as np
import numpy.typing as npt
from msgspec import Meta

from automaton.atomic_write import atomic_writer
from automaton.engine.state import ACTION_MOVE, ACTION_TURN, NIL, Array, Grid
from automaton.errors import InputError
from automaton.floor.floor_plan import FloorPlan
from automaton.scenario.order_lines import carries_pods
from automaton.scenario.quantities import TIME, quantity
from automaton.scenario.schema import Scenario

NO_TASKS_OF_PODS = (
    "forecast {} supports loads, but not pods that go to stations and back; use forecast plans"
)
MOST_PLANNED = 100_000_000  # limit of robots x ticks of the plans of `congestion`: 0.9 GB


class ShortestRoutes(msgspec.Struct, forbid_unknown_fields=True, frozen=True):
    """A strategy without parameters."""

    takes_shortest_routes: ClassVar[bool] = True


class TieBreaking(msgspec.Struct, forbid_unknown_fields=True, frozen=True, kw_only=True):
    """The choice of A* among paths of equal cost."""

    searches_by_astar: ClassVar[bool] = True

    tie_break: Annotated[
        Literal["fifo", "larger_g", "random"],
        Meta(
            description="Cell that is expanded first among several with the same estimate. fifo: the "
            "one found first; larger_g: the one farthest from the start; random: a random one, by seed "
            "and leg."
        ),
    ] = "larger_g"


class SharedPlans(msgspec.Struct, forbid_unknown_fields=True, frozen=True, kw_only=True):
    """How far routes avoid the traffic that is predicted from the plans of all robots."""

    avoids_traffic: ClassVar[bool] = True

    beta: Annotated[
        float,
        Meta(
            ge=0,
            le=100,
            description="Accepted detour, in moves, to meet one robot fewer in a zone.",
        ),
    ] = 2.0
    replan_period: Annotated[
        int,
        quantity(
            TIME,
            ge=0,
            le=1_000_000,
            description="Ticks between two replannings of all robots; 0: never.",
        ),
    ] = 20
    horizon: Annotated[
        int, quantity(TIME, ge=1, le=10_000, description="Ticks for which traffic is predicted.")
    ] = 500

    forecast: Annotated[
        Literal["plans", "tasks", "task-averages"],
        Meta(
            description="Source of the prediction. plans: the plans of all robots with their times, "
            "including slow zones; tasks: the A* paths of all tasks, without delays; "
            "task-averages: like tasks, but averaged over time."
        ),
    ] = "plans"

    def check_scenario(self, scenario: Scenario, floor_plan: FloorPlan) -> str | None:
        """Forecasts from tasks support only loads. Plans take 9 bytes of memory per robot and tick."""
        if self.forecast != "plans" and carries_pods(scenario, floor_plan):
            return NO_TASKS_OF_PODS.format(self.forecast)
        robots = scenario.fleet.robots
        if robots * self.horizon <= MOST_PLANNED:
            return None
        return (
            f"{robots:,} plans of {self.horizon:,} ticks do not fit into memory: robots x horizon may "
            f"be {MOST_PLANNED:,}, so with this fleet horizon at most {MOST_PLANNED // robots}"
        )


Share = Annotated[float, Meta(gt=0, le=1)]


class NetworkFile(msgspec.Struct, forbid_unknown_fields=True, frozen=True, kw_only=True):
    """A network from a file."""

    network: Annotated[
        str,
        Meta(
            min_length=1,
            description="A file written by `automaton train traffic`, found from the scenario's folder.",
        ),
    ]


class Avoidance(TieBreaking, forbid_unknown_fields=True, frozen=True, kw_only=True):
    """The predictor of other robots, and the number of them that closes a zone."""

    avoids_traffic: ClassVar[bool] = True

    predictor: Annotated[
        Literal["exact", "noisy", "network"] | NetworkFile,
        Meta(
            description="Predictor of the zones that other robots will use. exact: the zones on their "
            "A* paths; noisy: the zones of exact with errors, by precision and recall; network: a "
            "trained network, either the shipped one for warehouse-100 or one from a file."
        ),
    ] = "exact"
    precision: Annotated[
        Share | None,
        Meta(description="Share of predicted zones that are right, for the noisy predictor."),
    ] = None
    recall: Annotated[
        Share | None,
        Meta(description="Share of used zones that are predicted, for the noisy predictor."),
    ] = None
    prevalence: Annotated[
        Annotated[float, Meta(gt=0, lt=1)] | None,
        Meta(
            description="Share of all zones that a task uses on average. The noisy predictor derives the "
            "number of wrong zones from it. Left out: the share in warehouse-100, 27.5 of 522."
        ),
    ] = None
    max_threshold: Annotated[
        int,
        Meta(
            ge=1,
            le=1000,
            description="Greatest threshold A. For each A from 1 to this number, one plan avoids the "
            "zones in which A or more other robots are predicted.",
        ),
    ] = 6
    closed_from: Annotated[
        Literal["A", "more than A"],
        Meta(
            description="How many other robots a zone must have to be avoided at threshold A. A: A or "
            "more. more than A: as Shaji Bhattathiri, Li and Kuhl print it; then a zone with one "
            "robot is never avoided."
        ),
    ] = "A"

    @property
    def least_count(self) -> int:
        """The fewest others that close a zone if A = 1."""
        return 1 if self.closed_from == "A" else 2

    def __post_init__(self) -> None:
        given = [value is not None for value in (self.precision, self.recall)]
        if self.predictor == "noisy" and not all(given):
            raise ValueError("predictor: noisy needs precision and recall")
        if self.predictor != "noisy" and (any(given) or self.prevalence is not None):
            raise ValueError("precision, recall and prevalence are for predictor: noisy only")

    @property
    def files(self) -> tuple[Path, ...]:
        """The file of the user's network."""
        return (Path(self.predictor.network),) if isinstance(self.predictor, NetworkFile) else ()

    @property
    def network(self) -> Path:
        """The file of the shipped or the user's network."""
        return shipped("warehouse-100") if self.predictor == "network" else self.files[0]

    def check_files(self, driving: Callable[[], tuple[Grid, Array]]) -> None:
        """Raise InputError for a network that cannot be read or belongs to another floor."""
        if self.predictor not in ("exact", "noisy"):
            whole_layers(network_for(*driving(), self.network))

    def resolve_paths(self, folder: Path) -> Avoidance:
        """The same parameters, with the file relative to a folder."""
        for file in self.files:
            found = os.path.abspath(folder / file)
            return msgspec.structs.replace(self, predictor=NetworkFile(network=found))
        return self


# Networks that predict which zones a leg touches.
#
#     start zone, end zone (one-hot) -> hidden layers of rectifiers -> a logit for each zone
#
# A file is a plain .npz: float16 arrays, their low and high bytes apart, which compresses better, and
# a text about the training. Inference uses integers (value * 2^bits), so that NumPy and compiled code
# agree in every bit.


Weights = npt.NDArray[np.float16]
Whole = npt.NDArray[np.int64]

NETWORK_LAYERS: Final = 4  # three hidden ones and the output
MOST_BITS, FEWEST_BITS = 16, 8  # after the binary point
ZIP_ERRORS: Final = (zipfile.BadZipFile, zlib.error, NotImplementedError, RuntimeError)
EXACT_BELOW = 2**53  # float64 sums of integers below this are exact in any order
NETWORK_FORMAT = "automaton zone network 1"


@dataclass(frozen=True, eq=False)
class ZoneNetwork:
    """A trained network: weights (inputs, outputs) and biases of its layers, and its origin.

    The first layer has 2 x zones inputs: the start zone, then the end zone.
    """

    layers: tuple[tuple[Weights, Weights], ...]
    about: Mapping[str, Any]  # floor (fingerprint), scenario, mode, and training settings

    @property
    def zones(self) -> int:
        return int(self.layers[-1][1].size)


def shipped(scenario: str) -> Path:
    """The shipped network for the floor of a shipped scenario, if there is one."""
    return Path(str(resources.files("strategies.routing") / "networks" / f"{scenario}.npz"))


def network_for(grid: Grid, duration: Array, file: Path) -> ZoneNetwork:
    """The network of a file; it must be trained for this floor. Raises InputError."""
    try:
        network = _loaded(file, file.stat().st_mtime_ns)
    except OSError as error:
        raise InputError(f"cannot read {file}: {error.strerror or error}") from error
    check_floor(network, grid, duration, file)
    return network


@lru_cache(maxsize=4)
def _loaded(file: Path, changed: int) -> ZoneNetwork:
    return load_network(file)


def load_network(path: Path) -> ZoneNetwork:
    """Read a network. Raises InputError."""
    try:
        with np.load(path, allow_pickle=False) as file:
            about = json.loads(str(file["about"]))
            layers = tuple(
                (of_bytes(file[f"weights{k}"]), of_bytes(file[f"bias{k}"]))
                for k in range(NETWORK_LAYERS)
            )
    except OSError as error:
        raise InputError(f"cannot read {path}: {error.strerror or error}") from error
    except (KeyError, ValueError, EOFError, TypeError, MemoryError, *ZIP_ERRORS) as error:
        raise InputError(f"{path} is not a file of a zone network") from error
    network = ZoneNetwork(layers, about)
    if not isinstance(about, dict) or about.get("format") != NETWORK_FORMAT or not _fits(network):
        raise InputError(f"{path} is not a file of a zone network")
    return network


def bytes_apart(values: Weights) -> npt.NDArray[np.uint8]:
    """(2, ...) the low and the high bytes of an array."""
    pairs = np.ascontiguousarray(values, "<f2").view(np.uint8).reshape(*values.shape, 2)
    return np.moveaxis(pairs, -1, 0)


def of_bytes(apart: npt.NDArray[np.uint8]) -> Weights:
    """The array with these low and high bytes. Raises ValueError or TypeError for anything else."""
    if apart.dtype != np.uint8 or len(apart) != 2:
        raise TypeError("no low and high bytes")
    return np.moveaxis(apart, 0, -1).copy().view("<f2")[..., 0].astype(np.float16)


def _fits(network: ZoneNetwork) -> bool:
    """Whether the layers fit one another."""
    width = 2 * network.zones
    for weights, bias in network.layers:
        if weights.dtype != np.float16 or bias.dtype != np.float16 or bias.ndim != 1:
            return False
        if weights.shape != (width, bias.size) or not np.isfinite(weights).all():
            return False
        if not np.isfinite(bias).all():
            return False
        width = bias.size
    return True


def check_floor(network: ZoneNetwork, grid: Grid, duration: Array, file: Path) -> None:
    """Raise InputError if a network was trained for other passages or zones."""
    if network.about.get("floor") == floor_fingerprint(grid, duration):
        return
    about = network.about
    raise InputError(
        f"{file.name} was trained for the floor of {about.get('scenario')} with "
        f"{network.zones:,} zones ({about.get('mode')}), which is not this floor with "
        f"{grid.traffic_zone_count:,}; train one for it by `automaton train traffic --scenario NAME "
        "--out FILE` and name it as {network: FILE}"
    )


def floor_fingerprint(grid: Grid, duration: Array) -> str:
    """32 hex digits that identify all inputs of A* paths and their zones: passages, turns, zones.

    `duration`: (A,) ticks of each action of a robot of the first type. If types turn differently,
    the number of headings also counts, since paths then differ between types.
    """
    costs = [int(duration[action]) for action in (ACTION_MOVE, ACTION_TURN)]
    headings = int(grid.type_headings[0])
    text = f"{grid.width} {headings} {costs if headings > 1 else []}"
    kinds = np.unique(grid.type_headings).tolist()
    if len(kinds) > 1:
        text += f" {kinds}"
    digest = hashlib.blake2b(text.encode(), digest_size=16)
    digest.update((grid.cell_flags & np.uint8(31)).tobytes())
    digest.update(np.ascontiguousarray(grid.traffic_zone, np.int32).tobytes())
    digest.update(grid.min_move_ticks.tobytes())
    return digest.hexdigest()


def save_network(path: Path, network: ZoneNetwork) -> None:
    """Write a network atomically. Raises InputError."""
    arrays: dict[str, Any] = {
        "about": np.array(json.dumps({"format": NETWORK_FORMAT, **network.about}))
    }
    for k, (weights, bias) in enumerate(network.layers):
        arrays[f"weights{k}"], arrays[f"bias{k}"] = bytes_apart(weights), bytes_apart(bias)
    with atomic_writer(path) as file:
        np.savez_compressed(file, **arrays)


def predicted_zones(network: ZoneNetwork, start: Whole, end: Whole) -> npt.NDArray[np.bool_]:
    """(n, zones) bool: the predicted zones of n legs; `start`, `end`: zones or NIL.

    Equal to the compiled form in every bit: all numbers are integers below 2^53, whose float64 sums
    are exact in any order.
    """
    bits, layers = whole_layers(network)
    weights, bias = (part.astype(np.float64) for part in layers[0])
    weights = np.vstack([weights, np.zeros((1, weights.shape[1]))])  # the row of no zone
    none = len(weights) - 1
    sums = weights[np.where(start == NIL, none, start)] + bias
    sums += weights[np.where(end == NIL, none, end + network.zones)]
    for k, (whole_weights, whole_bias) in enumerate(layers[1:]):
        active = np.maximum(sums, 0.0)
        if k > 0:
            active = np.floor(active / 2.0**bits)
        sums = active @ whole_weights.astype(np.float64) + whole_bias * 2.0**bits
    answer: npt.NDArray[np.bool_] = sums > 0
    return answer


@lru_cache(maxsize=4)
def whole_layers(network: ZoneNetwork) -> tuple[int, list[tuple[Whole, Whole]]]:
    """(bits, layers as integers value * 2^bits), with the most bits that keep every sum exact.

    Raises InputError for weights so large that fewer than 8 bits remain.
    """
    for bits in range(MOST_BITS, FEWEST_BITS - 1, -1):
        layers = [(_whole(weights, bits), _whole(bias, bits)) for weights, bias in network.layers]
        widest = max(int(np.abs(part).max()) for layer in layers for part in layer)
        if widest < 2**31 and largest_sum(layers, bits) < EXACT_BELOW:
            return bits, layers
    raise InputError("the weights of the network are too large: the training failed")


def _whole(values: Weights, bits: int) -> Whole:
    return np.rint(values.astype(np.float64) * 2.0**bits).astype(np.int64)


def largest_sum(layers: list[tuple[Whole, Whole]], bits: int) -> int:
    """An upper bound on the absolute value of every partial sum, for any input."""
    weights, bias = layers[0]
    bound = 2 * int(np.abs(weights).max()) + int(np.abs(bias).max())
    highest = bound
    for k, (weights, bias) in enumerate(layers[1:]):
        largest = bound if k == 0 else bound >> bits
        heaviest = int(np.abs(weights).sum(axis=0).max())
        bound = largest * heaviest + (int(np.abs(bias).max()) << bits)
        highest = max(highest, bound)
    return highest
