"""Random cases by address: the content of a scenario file from a seed and a number.

A third of the cases each has rail, differential and omni robots. Floors have 4 x 4 to 16 x 16 cells
with shelves, racks, stations or pods, one-way cells, aisles for two, places for any number, dead
ends, parking bays and chargers; or they are small table-tops and depots. A case is redrawn until
`resolve` accepts it with shipped strategies in all layers.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from functools import lru_cache
from random import Random
from typing import Any, Final, TypeAlias

import msgspec

from automaton.errors import InputError
from automaton.scenario.schema import Strategies
from automaton.strategy.lookup import (
    NO_STRATEGY,
    ROUTED,
    STEERS,
    TAKES_SHORTEST_ROUTES,
    declares,
    default_for,
    names_in_random_cases,
)
from automaton.world.resolve import Resolved, resolve

Document: TypeAlias = dict[str, Any]  # the content of a scenario file
Rows = list[list[str]]

CASE_TICKS: Final = 300  # of a run
CROWD_EVERY: Final = 20  # every so many cases one has a crowd
CROWD_ROBOTS: Final = 60
DRAWS_OF_A_CASE: Final = 60
KINEMATICS: Final = ("rail", "differential", "omni")
INFORMATION: Final = (*["everything"] * 3, "orders", "radius")  # shares of the cases
WITHOUT_ZONES: Final = 4  # shares of the cases, for one with each strategy of zoning


def random_case(seed: int, number: int, layer: str = "") -> Document:
    """The case of an address, for strategies of a layer; a charging strategy always gets batteries.

    Callers must not change it. Raises InputError if no draw of this address can run.
    """
    return accepted_case(seed, number, layer if layer in ("charging", "zoning") else "")


@lru_cache(maxsize=1024)  # a process checks several strategies on equal cases
def accepted_case(seed: int, number: int, layer: str) -> Document:
    """The first draw of an address that can run. Raises InputError."""
    for draw in range(DRAWS_OF_A_CASE):
        document = drawn_case(Random(f"{seed} {number} {draw}"), number, layer)
        if is_runnable(document):
            return document
    raise InputError(f"case {number} of seed {seed} has no floor that can run; use another --seed")


def is_runnable(document: Document) -> bool:
    """Whether the scenario is accepted as it is."""
    try:
        resolve(document)
    except InputError:
        return False
    return True


PARTNERS: Final = {  # the layer whose strategy may not fit to another one
    "zoning": "allocation",
    "charging": "allocation",
    "allocation": "charging",
    "routing": "right_of_way",
    "right_of_way": "routing",
}


def with_strategy(document: Document, layer: str, strategy: Any) -> Resolved:
    """The scenario of `fitting_case`. Raises InputError."""
    return resolve(fitting_case(document, layer, strategy))


def fitting_case(document: Document, layer: str, strategy: Any) -> Document:
    """The case with another strategy in one layer: a name, or its parameters with its name.

    If that does not fit to the drawn strategy of the layer beside it, others are tried there. Raises
    InputError, the first refusal, if the strategy refuses the scenario.
    """
    beside = PARTNERS[layer]
    drawn = {**document.get("strategy", {}), layer: strategy}
    choices = [drawn]
    if drawn.get(beside, "none") != "none":
        choices += [{**drawn, beside: name} for name in names_in_random_cases(beside)]
    refusal = None
    for choice in choices:
        case = {**document, "strategy": choice}
        try:
            resolve(case)
            return case
        except InputError as error:
            refusal = refusal or error
    assert refusal is not None
    raise refusal


def drawn_case(chance: Random, number: int, layer: str) -> Document:
    """One draw of a case; it may not be able to run."""
    kinematics = KINEMATICS[number % len(KINEMATICS)]
    is_crowd = number % CROWD_EVERY == CROWD_EVERY - 1
    has_battery = layer == "charging" or chance.random() < 0.25
    kinds = CROWD_KINDS if is_crowd else tuple(FLOOR_KINDS)
    if layer == "zoning":
        kinds = ("stations", "stations", "shelves")
    kind = chance.choice(kinds)
    document = FLOOR_KINDS[kind](chance, kinematics, is_crowd)
    layout = document["layout"]
    rows = [list(row) for row in layout["picture"].split("\n")] if "picture" in layout else []
    if rows:
        overlay(chance, rows, kinematics, has_battery)
        layout["picture"] = "\n".join(map("".join, rows))
    robots = CROWD_ROBOTS if is_crowd else chance.randint(1, 12)
    if layer == "zoning":  # each robot serves a zone with a station
        robots = chance.randint(1, 3)
    has_bays = bool(rows) and not is_crowd and chance.random() < 0.25
    if has_bays:
        robots = add_bays(chance, layout, robots)
    fleet = fleet_of(chance, robots, kinematics)
    fleet["start"] = "parking-bays" if has_bays else "random"
    if "generator" in layout:  # a generated floor has its own starts
        del fleet["start"]
    document |= {
        "name": f"case-{number}",
        "fleet": fleet,
        "durations": durations(chance),
        "world": world_rules(chance),
        "faults": faults(chance),
        "information": information(chance),
        "stop": {"when": "never", "max_duration": CASE_TICKS},
        "strategy": strategies(chance, has_battery, kind == "stations" or layer == "zoning"),
        "seed": chance.randrange(2**32),
    }
    if has_battery:
        document["battery"] = battery(chance)
    return document


def strategies(chance: Random, has_battery: bool, may_have_zones: bool) -> dict[str, str]:
    """A strategy for each layer."""
    plain = plain_strategies()
    names = {layer: names_in_random_cases(layer) for layer in plain}
    names["right_of_way"].append(plain["right_of_way"])  # twice: robots that only wait get stuck
    drawn = {layer: chance.choice(some) for layer, some in names.items()}
    steers = declares("right_of_way", drawn["right_of_way"], STEERS)
    if steers and not declares("routing", drawn["routing"], TAKES_SHORTEST_ROUTES):
        drawn["routing"] = plain["routing"]
    if not may_have_zones or chance.randrange(WITHOUT_ZONES + 1):
        drawn["zoning"] = NO_STRATEGY
    if not has_battery:
        drawn["charging"] = NO_STRATEGY
    return drawn


def plain_strategies() -> dict[str, str]:
    """The strategies of a scenario that chooses none, for robots that follow routes."""
    return msgspec.structs.asdict(Strategies(right_of_way=default_for("right_of_way", ROUTED)))


# The floors, each with its demand.


def free_floor(chance: Random, is_crowd: bool) -> Rows:
    """Free cells, 4 x 4 to 16 x 16."""
    width, height = (16 if is_crowd else chance.randint(4, 16) for _ in range(2))
    return [["."] * width for _ in range(height)]


def shelves(chance: Random, kinematics: str, is_crowd: bool) -> Document:
    """Rows of shelves between aisles, and destinations at the lower rim."""
    rows = free_floor(chance, is_crowd)
    share = chance.choice((0.4, 0.7, 1.0))
    for y in range(1, len(rows) - 2, chance.choice((2, 3))):
        for x in range(1, len(rows[0]) - 1):
            if x % 5 and chance.random() < share:
                rows[y][x] = chance.choice("ssss#")
    rows.append(["#"] * len(rows[0]))
    for _ in range(chance.randint(1, 3)):
        rows[-1][chance.randrange(len(rows[0]))] = "d"
    return {"layout": {"picture": joined(rows)}, "orders": {"generator": "full-shelves"}}


def racks(chance: Random, kinematics: str, is_crowd: bool) -> Document:
    """Racks between aisles, and docks at the left rim."""
    rows = free_floor(chance, is_crowd)
    for y in range(2, len(rows) - 1, 3):
        for x in range(2, len(rows[0]) - 1):
            rows[y][x] = "r" if x % 6 else "."
    for y in chance.sample(range(1, len(rows) - 1), min(2, len(rows) - 2)):
        rows[y][0] = "i"
    orders = {"generator": "dock-to-rack", **stream(chance)}
    return {"layout": {"picture": joined(rows)}, "orders": orders}


def stations(chance: Random, kinematics: str, is_crowd: bool) -> Document:
    """Obstacles at random, and stations between which loads are carried, or that robots visit."""
    rows = free_floor(chance, is_crowd)
    obstruct(chance, rows)
    for _ in range(chance.randint(2, 6)):
        y, x = chance.randrange(len(rows)), chance.randrange(len(rows[0]))
        rows[y][x] = "t"
    orders = {"generator": chance.choice(("stations", "stations", "visits")), **stream(chance)}
    return {"layout": {"picture": joined(rows)}, "orders": orders}


def tours(chance: Random, kinematics: str, is_crowd: bool) -> Document:
    """Obstacles at random, and visits of one to three cells."""
    rows = free_floor(chance, is_crowd)
    obstruct(chance, rows)
    orders = {"generator": "tours", "stops": {"from": 1, "to": 3}, **stream(chance)}
    return {"layout": {"picture": joined(rows)}, "orders": orders}


def pods(chance: Random, kinematics: str, is_crowd: bool) -> Document:
    """Pods in storage cells between aisles, and one or two stations."""
    width = chance.randint(5, 9)
    rows = [["."] * width for _ in range(chance.randint(4, 9))]
    for y in range(1, len(rows) - 1, 2):
        for x in range(1, width - 1):
            rows[y][x] = chance.choice("pppq.")
    rows[1][1] = "p"
    rows.append(["#"] * width)
    for x in chance.sample(range(width), chance.randint(1, 2)):
        rows[-1][x] = "t"
    lines = {"count": chance.randint(1, 25), "mean_interarrival_time": chance.choice((0, 5, 12))}
    return {
        "layout": {"picture": joined(rows)},
        "orders": {"lines": lines},
        "pods": {"under": chance.choice(("empty", "none")), "join": chance.random() < 0.7},
    }


def table_top(chance: Random, kinematics: str, is_crowd: bool) -> Document:
    """A small table-top warehouse; only robots on rails drive there."""
    tables, positions = chance.randint(2, 5), chance.randint(2, 6)
    layout = {"generator": "tabletop", "tables": tables, "positions": positions}
    return {"layout": layout, "orders": {"generator": "full-shelves"}}


def depots(chance: Random, kinematics: str, is_crowd: bool) -> Document:
    """De Ryck's depots with their chargers."""
    return {
        "layout": {"generator": "depots"},
        "orders": {"generator": "stations", **stream(chance)},
    }


Drawer = Callable[[Random, str, bool], Document]
FLOOR_KINDS: Final[dict[str, Drawer]] = {
    one.__name__: one for one in (shelves, racks, stations, tours, pods, table_top, depots)
}
CROWD_KINDS: Final = ("tours", "stations")


def joined(rows: Rows) -> str:
    """The picture of these rows."""
    return "\n".join(map("".join, rows))


def obstruct(chance: Random, rows: Rows) -> None:
    """Draw walls at random, or a grid of streets around blocks."""
    share = chance.choice((0.0, 0.1, 0.2))
    is_grid = chance.random() < 0.4
    for y, x in inner(rows):
        is_block = bool(x % 3 and y % 3) if is_grid else chance.random() < share
        if is_block:
            rows[y][x] = "#"


def inner(rows: Rows) -> Iterator[tuple[int, int]]:
    """Row and column of the cells within the rim."""
    for y in range(1, len(rows) - 1):
        for x in range(1, len(rows[0]) - 1):
            yield y, x


def overlay(chance: Random, rows: Rows, kinematics: str, has_battery: bool) -> None:
    """Change free cells: aisles for two, places without limit, one-way streets, dead ends, chargers."""
    if chance.random() < 0.3:
        symbol = chance.choice("=~")
        y = chance.randrange(len(rows))
        rows[y] = [symbol if cell == "." else cell for cell in rows[y]]
    if kinematics != "rail" and chance.random() < 0.3:  # a one-way street around the floor
        last = len(rows[0]) - 1
        for x in range(1, last):
            rows[0][x] = ">" if rows[0][x] == "." else rows[0][x]
        for y in range(1, len(rows) - 1):
            rows[y][last] = "v" if rows[y][last] == "." else rows[y][last]
    if chance.random() < 0.3:  # a dead end below the floor
        x = chance.randrange(len(rows[0]))
        for _ in range(2):
            rows.append(["#"] * len(rows[0]))
            rows[-1][x] = "."
        if rows[-3][x] in "#d":
            rows[-3][x] = "."
    if has_battery:
        free = [(y, x) for y, row in enumerate(rows) for x, cell in enumerate(row) if cell == "."]
        for y, x in chance.sample(free, min(len(free), chance.randint(1, 3))):
            rows[y][x] = "c"
    if kinematics == "rail":
        for row in rows:
            row[:] = ["+" if cell == "." else cell for cell in row]


def add_bays(chance: Random, layout: Document, robots: int) -> int:
    """Draw parking bays in a column before the picture; returns the robots that fit."""
    rows = layout["picture"].split("\n")
    doors = [y for y, row in enumerate(rows) if row[0] in ".+"]
    bays = set(chance.sample(doors, min(robots, len(doors))))
    drawn = [("b" if y in bays else "#") + row for y, row in enumerate(rows)]
    layout["picture"] = "\n".join(drawn)
    return max(1, len(bays))


# The fleet, the rules and the demand.


def stream(chance: Random) -> Document:
    """How many orders, and when: all at once, one after another, in a closed loop, or hardly any."""
    way = chance.randrange(4)
    if way == 0:
        return {"count": chance.randint(1, 40)}
    if way == 1:
        return {"count": chance.randint(5, 60), "mean_interarrival_time": chance.choice((1, 4, 15))}
    if way == 2:
        loop = {"in_system": chance.randint(1, 15)}
        return {"count": 200, "arrivals": {"closed_loop": loop}}
    return {"count": 1, "mean_interarrival_time": 100_000}


def fleet_of(chance: Random, robots: int, kinematics: str) -> Document:
    """Robots of one to three types."""
    fleet: Document = {"robots": robots, "kinematics": kinematics}
    kinds = min(chance.choice((1, 1, 2, 3)), robots)
    if kinds > 1:
        share = robots // kinds
        numbers = [share] * (kinds - 1) + [robots - share * (kinds - 1)]
        fleet["types"] = [
            {"name": f"type-{k}", "robots": many, "durations": {"move": chance.randint(1, 4)}}
            for k, many in enumerate(numbers)
        ]
    return fleet


def durations(chance: Random) -> Document:
    """Ticks of actions: mostly short, up to 9."""
    ticks = chance.choice(((1, 1), (1, 3), (1, 9)))
    handling = chance.choice((ticks, (0, 2)))
    return {
        "move": chance.randint(*ticks),
        "turn": chance.randint(*ticks),
        "pick": chance.randint(*handling),
        "drop": chance.randint(*handling),
    }


def world_rules(chance: Random) -> Document:
    """The rule of following, slow zones and delays of moves."""
    return {
        "following": chance.choice(("convoy", "handover", "none")),
        "access_cell": chance.choice(("fixed", "nearest")),
        "slowdown": chance.choice(("none", "none", "none", "zones")),
        "extra_tick_probability": chance.choice((0, 0, 0, 0.05)),
    }


def faults(chance: Random) -> Document:
    """Robots that go down, on every third floor, and robots that stand for a while."""
    out: Document = {"tow_after": chance.choice((5, 20)), "repair_time": chance.choice((10, 50))}
    if chance.random() < 0.33:
        out["failure_probability"] = chance.choice((0.0005, 0.003))
    if chance.random() < 0.25:
        out["delays"] = {"probability": 0.005, "ticks": {"from": 1, "to": 8}}
    return out


def information(chance: Random) -> Any:
    """Everything, the list of orders, or a radius."""
    known = chance.choice(INFORMATION)
    if known != "radius":
        return known
    return {"radius": chance.randint(1, 4), "shape": chance.choice(("square", "circle"))}


def battery(chance: Random) -> Document:
    """Batteries that last for about as long as a run."""
    return {
        "drain": {"move": chance.choice((0.2, 0.6)), "turn": 0.1, "wait": 0.02},
        "charge_rate": chance.choice((1.0, 4.0)),
        "initial_charge": {"from": 30, "to": 100},
        "reserve": 20,
    }


# Floors beside the random cases.

RING: Final = "t...t\n.s.s.\n.....\ns.d.s\nt...t"
RAILS: Final = "+++++\n+s+s+\n+++++\ns+d+s\n+++++"


def delivery_floor(layer: str, number: int) -> Document:
    """A floor of the check `delivery`: one robot or 4, of each kinematics in turn."""
    kinematics = ("omni", "differential", "rail")[number // 2 % 3]
    picture = RAILS if kinematics == "rail" else RING
    return open_floor(layer, picture, 4 if number % 2 else 1, kinematics)


def open_floor(layer: str, picture: str, robots: int, kinematics: str) -> Document:
    """A small floor on which all can pass, with five or so orders."""
    document: Document = {
        "name": "delivery",
        "layout": {"picture": picture},
        "fleet": {"robots": robots, "kinematics": kinematics, "start": "random"},
        "orders": {"generator": "full-shelves"},
        "strategy": plain_strategies(),
        "stop": {"when": "delivered", "max_duration": 2_000},
        "seed": 1,
    }
    if layer == "zoning":
        document["orders"] = {"generator": "stations", "count": 5}
    if layer == "charging":
        document["layout"]["picture"] = picture[:2] + "c" + picture[3:]
        document["battery"] = {"drain": {"move": 0.2}, "charge_rate": 5.0}
    return document


def odd_case(document: Document, number: int) -> Document:
    """One of five odd changes of a case, by its number."""
    fleet = document["fleet"]
    robots = fleet["robots"]
    match number % 5:
        case 0:
            fleet = {**fleet, "robots": 1, "types": ()}
            return {**document, "fleet": fleet}
        case 1:
            orders = {"generator": "visits", "count": 1, "mean_interarrival_time": 1_000_000}
            return {**document, "orders": orders}
        case 2:
            return {**document, "durations": {"move": 500, "turn": 500, "pick": 500, "drop": 500}}
        case 3:
            down = [{"robot": k, "at": 2 + k % 3} for k in range(robots)]
            return {**document, "faults": {"list": down, "tow_after": None, "repair_time": None}}
    weak = {"name": "weak", "robots": (robots + 1) // 2, "payload": 1}
    strong = {"name": "strong", "robots": robots // 2}
    kinds = [weak, strong] if robots > 1 else [strong | {"robots": 1}]
    orders = {**document.get("orders", {}), "weight": {"from": 1, "to": 3}}
    return {**document, "fleet": {**fleet, "types": kinds}, "orders": orders}
