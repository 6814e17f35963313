"""Random floors, fleets and rules, with strategies that decide at random, for property tests."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, get_args

import msgspec
import numpy as np
from hypothesis import strategies as st
from random_floors import pictures
from random_strategies import Mood

from automaton.errors import InputError
from automaton.floor.drawn_floors import draw_floor
from automaton.floor.floor_plan import STATION, FloorPlan
from automaton.floor.reachability import to_and_from
from automaton.floor.traffic_zones import ZONE_MODES
from automaton.scenario.durations import MoveByLoad, TypeDurations
from automaton.scenario.fleet import FleetType, Kinematics
from automaton.scenario.quantities import WeightRange
from automaton.scenario.robot_types import floor_by_type, types_of
from automaton.scenario.schema import (
    Area,
    Battery,
    ChargeRange,
    Drain,
    Durations,
    Fault,
    Faults,
    Fleet,
    Orders,
    Scenario,
    Stop,
    WorldRules,
)
from automaton.strategy.lookup import NoParameters
from automaton.world.building import build_world
from automaton.world.resolved import Resolved, StrategyChoice
from strategies.right_of_way.right_of_way_parameters import PibtParameters

TICKS = 24  # of a run

# Floors on which robots are sure to meet; the last row of every floor is 's' and 'd' by turns.
DRAWN = (
    ">v\n^<",
    ">>v\n^<<",
    ">>v\n^#v\n^<<",
    ">v>v\n^<^<",
    "..c.\n....",
    "c..c\n.cc.",
    "t..c\n.tc.",
    "tct\n~~~",
    "t.t\n...",
    "tt",
    "+-+\n|#|\n+-+",
    "+-+-+\n|#|#|\n+-+-+",
    ".==.\n.==.",
    "===\n=#=\n===",
    "==\n==",
    "=~=",
    ".~.\n~~~",
    "~~~\n~c~",
    ".=~.\n~.=.",
    ".......",
    "..c..\n.###.\n.....",
    "t+t\n+t+",
    "+t\nt+",
)
SYMBOLS = ".......+++===~~><v^-|ccttt#"

ACTIVE = {  # shares of 256 in which a layer does something
    "zoning": (40, 128),
    "charging": (40, 128),
    "allocation": (40, 128, 220),
    "routing": (128, 240),
    "right_of_way": (20, 128, 220, 240),
}
LOOPS = (
    ">v\n^<\nsd",
    ">v\n^<\nds",
    "c.\n.c\nsd",
    ">cv\n^<<\nsds",
    "=.=\n.c.\nsds",
    "b=.\nb..\n sd",
    "===\n===\nsds",
    "==\nsd",
    "+t\nt+\nsd",
    "~~\n~~\nsd",
)
STRATEGIES = {
    "charging": "RandomCharging",
    "allocation": "RandomAllocation",
    "routing": "RandomRouting",
    "right_of_way": "RandomRightOfWay",
}


@dataclass(frozen=True)
class Case:
    """A world and the moods of its strategies."""

    resolved: Resolved
    storage: tuple[int, ...]


@st.composite
def plans(draw: Any) -> FloorPlan:
    if draw(st.booleans()):
        lines = draw(st.sampled_from(DRAWN)).split("\n")
    else:
        width = draw(st.integers(2, 5))
        lines = draw(pictures(SYMBOLS, width, draw(st.integers(1, 3)))).split("\n")
    lines.append(("sd" * 5)[: len(lines[0])])
    if draw(st.booleans()) and any(line[0] not in "#sd" for line in lines):
        lines = [("b" if line[0] not in "#sd" else " ") + line for line in lines]
    elif all(set(line) <= set("#sd") for line in lines):
        lines.append("." * len(lines[0]))
    return draw_floor("\n".join(lines))


@st.composite
def moods(draw: Any, layer: str, busy: bool) -> Mood:
    low, more = draw(st.tuples(st.integers(1, 3), st.integers(0, 2)))
    return Mood(
        seed=draw(st.integers(0, 2**32)),
        every=1 if busy or layer == "right_of_way" else draw(st.sampled_from([1, 2, 3])),
        illegal=0 if busy else draw(st.sampled_from([0, 4, 16])),
        active=ACTIVE[layer][-1] if busy else draw(st.sampled_from(ACTIVE[layer])),
        waits=(low, low + more, low, low + more, draw(st.integers(1, 3))),
    )


@st.composite
def rules(draw: Any) -> WorldRules:
    slow = draw(st.integers(0, 2)) == 2
    return WorldRules(
        following=draw(st.sampled_from(["convoy", "handover", "none"])),
        traffic_zones=draw(st.sampled_from(ZONE_MODES)) if slow else "undirected",
        slowdown="zones" if slow else "none",
        extra_tick_probability=draw(st.sampled_from([0.0, 0.5] if slow else [0.0, 0.0, 0.0, 0.5])),
    )


ENDLESS = Battery(drain=Drain(move=0.0), charge_rate=100.0)  # robots go to chargers for nothing


@st.composite
def batteries(draw: Any) -> Battery | None:
    if draw(st.integers(0, 2)):
        return None
    rates = st.sampled_from([0.0, 0.5, 3.0, 10.0, 40.0])
    names = ("move", "turn", "pick", "drop", "try_drop", "wait")
    drain = Drain(
        loaded_factor=draw(st.sampled_from([1.0, 1.5])), **{n: draw(rates) for n in names}
    )
    curve = draw(st.sampled_from([20.0, 100.0, ((0.0, 30.0), (60.0, 5.0))]))
    start = draw(st.sampled_from([100.0, 30.0, ChargeRange(least=0.0, most=60.0)]))
    return Battery(drain=drain, charge_rate=curve, initial_charge=start)


@st.composite
def faults(draw: Any, robots: int, ticks: int) -> Faults:
    if draw(st.integers(0, 2)):
        return Faults()
    found = st.builds(Fault, robot=st.integers(0, robots - 1), at=st.integers(1, ticks))
    return Faults(  # type: ignore[arg-type]
        listed=tuple(draw(st.lists(found, max_size=3))),
        failure_probability=draw(st.sampled_from([0.0, 0.0, 0.05])),
        tow_after=draw(st.sampled_from([1, 4, None])),
        repair_time=draw(st.sampled_from([1, 5, None])),
    )


@st.composite
def demands(draw: Any, stations: int) -> Orders:
    if stations < 2 or draw(st.integers(0, 3)) == 3:
        return Orders(generator="full-shelves")
    generator = draw(st.sampled_from(["stations", "visits"]))
    return Orders(
        generator=generator,
        count=draw(st.integers(1, 12)),
        mean_interarrival_time=draw(st.sampled_from([0.0, 1.0, 3.0])),
    )


@st.composite
def scenarios(
    draw: Any, robots: int, busy: bool, bays: bool, stations: int = 0, until: int = TICKS
) -> Scenario:
    leaves = not busy and not bays and draw(st.integers(0, 2)) == 2
    ticks = st.just(1) if busy else st.integers(1, 3)
    kinematics = "omni" if busy else draw(st.sampled_from(["rail", "differential", "omni"]))
    return Scenario(
        name="case",
        layout={},
        fleet=Fleet(  # type: ignore[arg-type]
            robots=robots, kinematics=kinematics, when_idle="leave" if leaves else "park"
        ),
        durations=Durations(
            move=draw(ticks),
            turn=draw(ticks),
            pick=(pick := draw(st.integers(0, 3))),
            drop=(drop := draw(st.integers(0, 3))),
            try_drop=draw(ticks),
            handling_jitter=draw(st.sampled_from([0, 0, 0, 2])) if pick and drop else 0,
        ),
        world=WorldRules() if busy else draw(rules()),
        orders=draw(demands(stations)),
        battery=ENDLESS if busy else draw(batteries()),
        faults=Faults() if busy else draw(faults(robots, until)),
        stop=Stop(when="never", max_duration=until),
        seed=draw(st.integers(0, 2**32)),
    )


@st.composite
def cases(draw: Any, types: bool = False, ticks: int = TICKS) -> Case:
    busy = draw(st.integers(0, 3)) == 3  # everybody on the move: rings would be rare otherwise
    floor_plan = draw_floor(draw(st.sampled_from(LOOPS))) if busy else draw(plans())
    if len(floor_plan.bays):
        n, start = draw(st.sampled_from(range(len(floor_plan.bays), 0, -1))), "parking-bays"
    else:
        cells = draw(st.permutations(np.flatnonzero(floor_plan.drivable).tolist()))
        most = min(6, len(cells))
        n = draw(st.one_of(st.just(most), st.integers(1, most)))
        start = tuple(cells[:n])
    picks = {"zoning": StrategyChoice("none", NoParameters())}
    if zoned := not busy and draw(st.integers(0, 3)) == 3:
        picks["zoning"] = StrategyChoice(
            "random_strategies:RandomZoning", draw(moods("zoning", busy))
        )
    for layer, name in STRATEGIES.items():
        picks[layer] = StrategyChoice(f"random_strategies:{name}", draw(moods(layer, busy)))
    if steers := draw(st.sampled_from([None, None, "random", "pibt"])):
        picks["right_of_way"] = (
            StrategyChoice("pibt", PibtParameters())
            if steers == "pibt"
            else StrategyChoice(
                "random_strategies:RandomSteering", draw(moods("right_of_way", busy))
            )
        )
    stations = reachable_stations(floor_plan, start)
    scenario = draw(scenarios(n, busy, start == "parking-bays", stations, ticks))
    if types:
        scenario = draw(typed(scenario, floor_plan, start))
    resolved = Resolved(scenario, floor_plan, picks, start=start, source="")  # type: ignore[arg-type]
    if zoned:
        try:
            build_world(resolved, scenario.seed)
        except InputError:  # no route leads from station to station
            picks["zoning"] = StrategyChoice("none", NoParameters())
    return Case(resolved, tuple(draw(st.permutations(range(n)))))


@st.composite
def typed(draw: Any, scenario: Scenario, floor_plan: FloorPlan, start: Any) -> Scenario:
    """The same with two types of robots, for which a load may make a difference.

    And perhaps an area that is closed to one of them, or to robots with a load.
    """
    fleet = scenario.fleet
    few = draw(st.integers(1, max(1, fleet.robots - 1)))
    factor, payload = draw(st.integers(1, 3)), draw(st.sampled_from([1, 2, None]))
    ticks = st.integers(1, 3)
    own = TypeDurations(
        move=draw(st.none() | st.builds(MoveByLoad, empty=ticks, loaded=ticks)),
        try_drop=draw(st.none() | ticks),
    )
    ways = st.sampled_from([*[None] * 6, *get_args(Kinematics)])
    slow = FleetType(
        name="slow",
        robots=few,
        move_time_factor=factor,
        payload=payload,
        durations=own,
        kinematics=draw(ways),
    )
    other = FleetType(name="other", payload=2, kinematics=draw(ways))
    kinds = [slow, other] if few < fleet.robots else [slow]
    fleet = msgspec.structs.replace(fleet, types=tuple(kinds))
    orders = scenario.orders
    weight = WeightRange(least=1, most=3)
    scenario = msgspec.structs.replace(
        scenario, fleet=fleet, orders=msgspec.structs.replace(orders, weight=weight)
    )
    closed_to = st.sampled_from([("slow",), ("loaded",), ("slow", "loaded")])
    columns = sorted(draw(st.integers(0, floor_plan.width - 1)) for _ in range(2))
    rows = sorted(draw(st.integers(0, floor_plan.height - 1)) for _ in range(2))
    area = Area(first=(columns[0], rows[0]), last=(columns[1], rows[1]), closed_to=draw(closed_to))
    closed = msgspec.structs.replace(scenario, areas={"area": area})
    shut = floor_by_type(floor_plan, types_of(closed)).closed[0]
    homes = floor_plan.bays[:, 1].tolist() if start == "parking-bays" else start
    allowed = orders.generator == "full-shelves" and not shut[list(homes[: fleet.robots])].any()
    return closed if allowed else scenario


def reachable_stations(floor_plan: FloorPlan, start: Any) -> int:
    """How many stations every robot gets to and home from, whatever its kinematics."""
    home = int(floor_plan.bays[0, 1]) if start == "parking-bays" else start[0]
    return int(
        np.count_nonzero(
            to_and_from(floor_plan, home, True) & (floor_plan.kind.reshape(-1) == STATION)
        )
    )
