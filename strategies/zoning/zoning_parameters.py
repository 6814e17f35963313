"""Parameters of zoning. Times are in seconds and minutes, lengths in the scenario's unit of length.

If a scenario does not define `units.tick`, a tick counts as a second; if it does not define
`units.cell`, lengths are in cells.
"""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any, Literal, Self

import msgspec
import numpy as np
import yaml
from msgspec import Meta

from automaton.errors import InputError, nearest
from automaton.floor.floor_plan import NIL, FloorPlan
from automaton.floor.reachability import grouped, slot_access
from automaton.floor.traffic_zones import road_network
from automaton.scenario.floor_section import point_names
from automaton.scenario.quantities import LENGTH, MINUTES, SECONDS, quantity
from automaton.scenario.schema import Scenario
from automaton.strategy.lookup import ZoningParameters
from automaton.units import count
from strategies.allocation.allocation_parameters import refusal_of_tours

SHIPPED = Path(__file__).parent.parent.parent / "layouts" / "zones"

Seconds = Annotated[float, quantity(SECONDS, ge=0, le=1_000_000)]
Minutes = Annotated[float, quantity(MINUTES, ge=0, le=100_000)]
Length = Annotated[float, quantity(LENGTH, gt=0, le=1_000_000)]
TipPairs = Annotated[
    Literal["last", "all"],
    Meta(
        description="Tips to which a moved tip may be joined. all: any tip within reach in the "
        "receiving zone, tried in random order; last: only the tip with the largest number, as in "
        "the authors' code."
    ),
]


class Zones(ZoningParameters, forbid_unknown_fields=True, frozen=True, kw_only=True):
    """The common parameters of zones."""

    adjacency: Annotated[
        Length | None,
        Meta(
            description="Distance below which stations are adjacent, so that zones may exchange them; "
            "left out: the typical distance of stations on the floor."
        ),
    ] = None
    share_every: Annotated[Seconds, Meta(description="Seconds between two rounds of sharing.")] = (
        60.0
    )

    def resolve_paths(self, folder: Path) -> Self:
        """The same parameters, with the design read from its file. Raises InputError."""
        if not isinstance(self.design, str):
            return self
        return msgspec.structs.replace(self, design=read_zones(self.design, folder))

    def _wrong_priority(self, scenario: Scenario, floor_plan: FloorPlan) -> str | None:
        names = [robot_type.name for robot_type in scenario.fleet.types]
        most = len(floor_plan.stations) or self.groups
        for name, stations in self.priority.items():
            if name not in names:
                known = (
                    f"fleet.types has {', '.join(names)}" if names else "there are no fleet.types"
                )
                return f"priority names the type '{name}'{nearest(name, names)}, but {known}"
            for station in stations:
                if not 1 <= station <= most:
                    return f"priority names station {station}, but there are stations 1 to {most}"
        return None

    def stations(self, floor_plan: FloorPlan) -> int:
        """The stations in zones; without stations, the groups of slots that count as stations."""
        served = slot_access(floor_plan).max(axis=1, initial=NIL)
        stands = int(np.unique(served[served != NIL]).size)
        return len(floor_plan.stations) or min(self.groups, stands)

    def flaw(self, scenario: Scenario, floor_plan: FloorPlan) -> str | None:
        """Return an error of the design on this floor, or None."""
        if self.design is None:
            return None
        # Local import: only a design needs Numba.
        from automaton.engine.facilities import Roads
        from strategies.zoning.design_files import read_design

        cells = (
            floor_plan.stations if len(floor_plan.stations) else grouped(floor_plan, self.groups)[0]
        )
        try:
            roads = Roads(**road_network(floor_plan, cells)._asdict())
            read_design(floor_plan, roads, self.design, point_names(scenario.layout))
        except InputError as error:
            choice = scenario.strategy.zoning
            name = choice.get("design") if isinstance(choice, dict) else None
            which = f"the zone design {name!r}" if isinstance(name, str) else "the zone design"
            return f"{which}: {error.message}"
        return None

    def check_scenario(self, scenario: Scenario, floor_plan: FloorPlan) -> str | None:
        """Each robot has a zone with a station in it; a design says how many robots there are, and
        priority names types and stations."""
        wrong = refusal_of_tours(scenario, floor_plan) or self._wrong_priority(scenario, floor_plan)
        if wrong:
            return wrong
        zones = self.design.get("zones") if isinstance(self.design, dict) else None
        robots, stations = scenario.fleet.robots, self.stations(floor_plan)
        if robots > stations:
            counted = "stations" if len(floor_plan.stations) else "groups of slots (raise groups)"
            return (
                f"each robot serves a zone with a station at least, and there are {robots} robots and "
                f"{stations} {counted}; use fewer robots"
            )
        if not isinstance(zones, list) or len(zones) == robots:
            return self.flaw(scenario, floor_plan)
        return (
            f"the zone design has {count(len(zones), 'zone')}, one for each robot; there are {robots} "
            "(without a design, strategy.zoning.design=null, zones are made for any number)"
        )


class Monitoring(Zones, forbid_unknown_fields=True, frozen=True, kw_only=True):
    """The balance of zones, and the reaction to an imbalance (Keith & La; Ho & Liao)."""

    sharing: Annotated[
        bool,
        Meta(description="Whether orders go to robots of other zones while zones are unbalanced."),
    ] = True
    tolerance: Annotated[
        float,
        Meta(ge=0, le=1, description="Largest imbalance SVp at which zones count as balanced."),
    ] = 0.2
    window: Annotated[
        Minutes, Meta(description="Minutes for which a delivery counts in the measured flow.")
    ] = 20.0
    often: Annotated[
        Seconds, Meta(description="Seconds between two measurements while zones are unbalanced.")
    ] = 60.0
    seldom: Annotated[
        Seconds,
        Meta(description="Seconds between two measurements once zones were balanced for `calm`."),
    ] = 180.0
    calm: Annotated[
        Minutes,
        Meta(description="Minutes of balance after which measurements become rarer (`seldom`)."),
    ] = 5.0

    def check_scenario(self, scenario: Scenario, floor_plan: FloorPlan) -> str | None:
        """The checks of all zones; one computer makes these zones from the work of all robots."""
        if scenario.information != "everything":
            return (
                "one computer monitors all zones, so it needs information: everything; with less, "
                "use decentralized"
            )
        return super().check_scenario(scenario, floor_plan)


class Repairing(Monitoring, forbid_unknown_fields=True, frozen=True, kw_only=True):
    """The conditions of a redesign."""

    patience: Annotated[
        Minutes, Meta(description="Minutes of imbalance before zones are redesigned.")
    ] = 15.0
    compute: Annotated[Seconds, Meta(description="Seconds until a new design takes effect.")] = (
        200.0
    )
    share_while_computing: Annotated[
        bool,
        Meta(
            description="Whether robots share orders while a design is computed; the paper leaves it "
            "open."
        ),
    ] = True


class Annealing(Repairing, forbid_unknown_fields=True, frozen=True, kw_only=True):
    """Simulated annealing of zones (Ho & Liao, as Keith & La modified it)."""

    steps: Annotated[
        int,
        Meta(
            ge=1,
            le=100_000,
            description="M: number of accepted or impossible moves of a tip to another zone after "
            "which the annealing ends.",
        ),
    ] = 500
    hot: Annotated[float, Meta(gt=0, le=1000, description="T_i: initial temperature.")] = 4.5
    cold: Annotated[float, Meta(gt=0, le=1000, description="T_f: final temperature.")] = 0.35
    tip_pairs: TipPairs = "last"


class Genetic(Repairing, forbid_unknown_fields=True, frozen=True, kw_only=True):
    """A genetic algorithm over zone designs."""

    population: Annotated[int, Meta(ge=2, le=1000, description="Designs in a generation.")] = 60
    generations: Annotated[int, Meta(ge=1, le=10_000, description="Number of generations.")] = 100
    selected: Annotated[
        int,
        Meta(
            ge=1,
            le=1000,
            description="Number of best designs from which the next generation is bred.",
        ),
    ] = 10
    mutation: Annotated[
        float,
        Meta(ge=0, le=0.95, description="Probability that another mutation follows each mutation."),
    ] = 0.45
    matched: Annotated[
        bool,
        Meta(
            description="Whether each new zone goes to the robot with the nearest reference cell "
            "(`poses`); false: zones go to robots in the sequence in which they were bred."
        ),
    ] = True
    poses: Annotated[
        tuple[tuple[int, int], ...] | None,
        Meta(description="Cell [x, y] of each robot for `matched`; left out: the start cells."),
    ] = None


class Decentralized(Zones, forbid_unknown_fields=True, frozen=True, kw_only=True):
    """Robots negotiate their zones with those in range (Keith & La, Algorithms 3 and 4)."""

    range: Annotated[Length, Meta(description="r: communication range of the robots.")] = 328.0
    tolerance: Annotated[
        Minutes,
        Meta(description="L_TOL: minutes by which the load of a zone may differ from the mean."),
    ] = 18.0
    patience: Annotated[
        Minutes, Meta(description="T_LT: minutes without balance before a robot may redesign.")
    ] = 15.0
    hysteresis: Annotated[
        Minutes, Meta(description="Minutes in or out of tolerance before a robot acts.")
    ] = 6.5
    look: Annotated[
        Seconds, Meta(description="Seconds between two measurements of a robot's own load.")
    ] = 30.0
    average_every: Annotated[
        Seconds, Meta(description="T_AC: seconds between two rounds of averaging.")
    ] = 120.0
    rounds: Annotated[
        int, Meta(ge=1, le=10_000, description="Steps of the consensus algorithm.")
    ] = 100
    turns: Annotated[
        int, Meta(ge=1, le=100, description="E_t: number of turns that each robot leads.")
    ] = 2
    iterations: Annotated[int, Meta(ge=1, le=1000, description="I_t: exchanges in a turn.")] = 10
    hot: Annotated[float, Meta(gt=0, le=1000, description="T_i: initial temperature.")] = 4.5
    cold: Annotated[float, Meta(gt=0, le=1000, description="T_f: final temperature.")] = 0.3
    tip_pairs: TipPairs = "last"
    scale: Annotated[
        float,
        quantity(MINUTES, gt=0, le=1000, description="k: factor of the temperature, in minutes."),
    ] = 10.0
    pause: Annotated[
        Seconds, Meta(description="Seconds for which robots stand still during a redesign.")
    ] = 0.0
    sharing: Annotated[
        bool,
        Meta(
            description="Whether a robot out of tolerance gives orders to a neighbour if they "
            "begin near the neighbour's zone."
        ),
    ] = False
    drop_near: Annotated[
        Annotated[float, quantity(LENGTH, ge=0, le=1_000_000)],
        Meta(
            description="If the next station of an order is at most this far from the transfer "
            "station, the load goes directly to the next station; 0: never."
        ),
    ] = 0.0


def read_zones(name: str, folder: Path) -> dict[str, Any]:
    """The data of a design: a shipped one by name, or a file. Raises InputError."""
    shipped = {path.stem: path for path in sorted(SHIPPED.glob("*.yaml"))}
    path = shipped.get(name, folder / name)
    try:
        found = yaml.safe_load(path.read_text(encoding="utf-8"))
    except OSError:
        known = ", ".join(shipped)
        raise InputError(
            f"there is no zone design {name!r}{nearest(name, shipped)}; shipped are {known}, "
            "or name a file"
        ) from None
    except (yaml.YAMLError, UnicodeDecodeError) as error:
        first = str(error).splitlines()[0]
        raise InputError(f"the zone design {name!r} cannot be read: {first}") from None
    if not isinstance(found, dict):
        raise InputError(f"the zone design {name!r} must have a list `zones`")
    return found
