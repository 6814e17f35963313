"""Random floors with everything on at once: pods, gates, batteries, faults, types, speeds and strategies.

What is random about pods, gates and crowds comes from `pod_floors`, `gate_trials` and `flow_floors`;
this puts it on one floor. A scenario is plain data, so that it can be printed as YAML.
"""

from __future__ import annotations

from random import Random
from typing import Any

import flow_floors
import gate_trials
import msgspec
import numpy as np
import pod_floors
from pod_floors import Place, cells

from automaton.scenario.schema import Scenario
from automaton.world.resolve import Resolved, resolve

TICKS = 400  # of a run
RULES = flow_floors.RULES
Rows = list[list[str]]
Plain = dict[str, Any]

STEERED = ("pibt", "epibt")
FOLLOWED = ("shortest", "astar", "congestion", "traffic-avoidance")  # routings with routes
MECHANISMS = ("sequential", "arrival", "parallel", "combinatorial", "assignment")
CHARGING: tuple[Any, ...] = (
    "opportunity",
    "opportunity",
    {"name": "opportunity", "start_below": 50.0},
    "threshold",
    {"name": "threshold", "mode": "threshold-only", "threshold": 40.0},
    "insertion",
    {"name": "insertion", "mode": "joint"},
    {"name": "insertion", "never_strand": False},
    {"name": "fill-up", "target": 70.0},
    "none",
)
OPEN = ".=+~"  # cells that may be a gate, a charger or an area
DRIVABLE = ".=+~><v^tc"


def drawn_whole(number: int, ticks: int = TICKS) -> Plain:
    """Return the scenario of a number as plain data; some are refused."""
    chance = Random(f"whole {number}")
    has_pods = chance.random() < 0.85
    kinematics = chance.choice(("omni", "differential", "differential", "rail"))
    rows = floor_with_pods(chance, kinematics) if has_pods else floor_without_pods(chance)
    if not has_pods and kinematics == "rail":
        kinematics = "omni"
    battery = chance.random() < 0.8
    if battery:
        add_chargers(chance, rows)
    open_pockets(rows)
    under = chance.choice(("empty", "empty", "none"))
    scenario: Plain = {"name": f"whole-{number}", "seed": number}
    scenario["durations"] = durations(chance)
    scenario["world"] = world_rules(chance)
    scenario["floor"] = changing_floor(chance, rows)
    bays = chance.random() < 0.15
    scenario["fleet"] = fleet = fleet_on(
        chance, rows, kinematics, scenario["floor"], bays, "#sdpq" if under == "none" else "#sd"
    )
    scenario["layout"] = {"picture": "\n".join("".join(row) for row in with_bays(rows, bays))}
    if has_pods:
        scenario |= demand_for_pods(chance, rows, ticks, under)
    else:
        scenario["orders"] = demand_without_pods(chance, rows, fleet["robots"])
    if types := robot_types(chance, fleet, battery):
        fleet["types"] = types
    if areas := closed_areas(chance, rows, types):
        scenario["areas"] = areas
    scenario["faults"] = faults(chance, fleet["robots"], battery, ticks)
    if battery:
        scenario["battery"] = batteries(chance, fleet["robots"])
    scenario["strategy"] = strategies(chance, scenario, rows, battery)
    scenario["information"] = information(chance, scenario["strategy"])
    # What is listed is done soon, and robots would stand idle.
    when = chance.choice(
        ("delivered", "parked") if listed(scenario["orders"]) else ("never", "parked")
    )
    scenario["stop"] = {"when": when, "max_duration": ticks}
    if chance.random() < 0.15:
        scenario["measure"] = {"warm_up": ticks // 4}
    if chance.random() < 0.08:
        scenario["refine"] = chance.choice((2, 3))
        scenario["decide"] = chance.choice(("coarse", "fine"))
    add_premises(Random(f"premises {number}"), scenario)
    plain: Plain = msgspec.to_builtins(scenario)
    return plain


def resolved_whole(scenario: Plain) -> Resolved:
    """Resolve plain data. Raises InputError and msgspec.ValidationError: some are refused."""
    return resolve(msgspec.convert(scenario, Scenario))


# Floors


def floor_with_pods(chance: Random, kinematics: str) -> Rows:
    """Aisles between storage, in half of them with a hall beside them."""
    rows = pod_floors.picture(chance, kinematics)
    if chance.random() < 0.5:
        way = "+" if kinematics == "rail" else "."
        columns = chance.randint(2, 4)
        rows = [row + [way] * columns for row in rows]
        for y in range(1, len(rows) - 1):
            if chance.random() < 0.4 and kinematics != "rail":
                rows[y][-columns] = "#"
    if kinematics != "rail" and chance.random() < 0.3:
        replace_some(chance, rows, "~", chance.randint(1, 3))
    return rows


def floor_without_pods(chance: Random) -> Rows:
    """Halls with shelves in their walls, or streets, each with stations at the rim."""
    if chance.random() < 0.4:
        rows = [list(row) for row in gate_trials.drawn_floor(chance)]
        for x, y in cells(rows):
            if rows[y][x] == "#" and chance.random() < 0.7:
                rows[y][x] = "s"
        rows[chance.randrange(len(rows))].append("d")
        width = max(map(len, rows))
        return [row + ["#"] * (width - len(row)) for row in rows]
    draws = np.random.default_rng(chance.getrandbits(32))
    rows = flow_floors.drawn_floor(draws, lanes=chance.random() < 0.5)
    flow_floors.enter_at_rim(draws, rows, "t")
    return rows


def replace_some(chance: Random, rows: Rows, symbol: str, count: int) -> None:
    """Make so many open cells something else."""
    spots = [(x, y) for x, y in cells(rows) if rows[y][x] in OPEN]
    for x, y in chance.sample(spots, min(count, max(0, len(spots) - 4))):
        rows[y][x] = symbol


def add_chargers(chance: Random, rows: Rows) -> None:
    """One to three chargers: in pockets of the last row, as stations are, or on the floor."""
    last = len(rows) - 1
    pockets = [
        x for x, cell in enumerate(rows[last]) if cell == "#" and rows[last - 1][x] in DRIVABLE
    ]
    count = chance.randint(1, 3)
    for x in chance.sample(pockets, min(count, len(pockets))):
        rows[last][x] = "c"
    if not pockets or chance.random() < 0.2:
        replace_some(chance, rows, "c", 1)


def open_pockets(rows: Rows) -> None:
    """Let robots turn off one-way aisles into stations and chargers."""
    for x, y in cells(rows):
        if rows[y][x] not in "tc":
            continue
        for u, v in ((x, y - 1), (x, y + 1), (x - 1, y), (x + 1, y)):
            if 0 <= v < len(rows) and 0 <= u < len(rows[v]) and rows[v][u] in "^v<>":
                rows[v][u] = "."


def with_bays(rows: Rows, bays: bool) -> Rows:
    """The same with a parking bay before each row that begins on the floor."""
    if not bays:
        return rows
    return [["b" if row[0] in DRIVABLE else " ", *row] for row in rows]


def changing_floor(chance: Random, rows: Rows) -> Plain:
    """Gates of all kinds in two of three, and speed limits."""
    floor: Plain = {}
    masked = ["".join("." if cell in OPEN else "#" for cell in row) for row in rows]
    if chance.random() < 0.65 and any(".." in row for row in masked):
        floor = gate_trials.gates_on(chance, masked)
    if chance.random() < 0.25:
        floor["speed_limits"] = [
            {"cells": rectangle(chance, rows, 5, 4), "max_speed": chance.randint(1, 4)}
            for _ in range(chance.randint(1, 2))
        ]
    return floor


def rectangle(chance: Random, rows: Rows, width: int, height: int) -> Plain:
    """Two corners on the floor."""
    x, y = chance.choice([(x, y) for x, y in cells(rows) if rows[y][x] in DRIVABLE])
    u = min(x + chance.randrange(width), len(rows[0]) - 1)
    v = min(y + chance.randrange(height), len(rows) - 1)
    return {"from": (x, y), "to": (u, v)}


def cells_of_lifts(floor: Plain) -> set[Place]:
    """The cells of shafts, which go along rows."""
    return {
        (x, lift["shaft"][0][1])
        for lift in floor.get("lifts", ())
        for x in range(lift["shaft"][0][0], lift["shaft"][1][0] + 1)
    }


# Robots


def durations(chance: Random) -> Plain:
    """What operations take: mostly a tick or two, in some with a load more."""

    def drive(longest: int) -> Any:
        ticks = chance.randint(1, longest)
        by_load = {"empty": ticks, "loaded": chance.randint(ticks, 3)}
        return by_load if chance.random() < 0.25 else ticks

    out = {
        "move": drive(chance.choice((1, 1, 2, 3))),
        "turn": drive(chance.choice((1, 2, 3))),
        "pick": chance.choice((0, 1, 3)),
        "drop": chance.choice((0, 1, 3)),
        "handling": pod_floors.drawn_handling(chance),
    }
    if out["pick"] and out["drop"] and chance.random() < 0.3:
        out["handling_jitter"] = chance.randint(1, 3)
    return out


def world_rules(chance: Random) -> Plain:
    slow = chance.random() < 0.25
    return {
        "following": chance.choice((*RULES, "convoy")),
        "slowdown": "zones" if slow else "none",
        "traffic_zones": chance.choice(("undirected", "directed", "with-intersections")),
        "extra_tick_probability": chance.choice((0, 0, 0, 0.1)),
        "access_cell": chance.choice(("fixed", "fixed", "nearest")),
    }


def fleet_on(
    chance: Random, rows: Rows, kinematics: str, floor: Plain, bays: bool, barred: str
) -> Plain:
    """A few robots, and where they begin: some in shafts, where they are refused.

    `barred`: symbols of cells in which none begins.
    """
    fleet: Plain = {"kinematics": kinematics}
    careless = chance.random() < 0.15
    shafts = set() if careless else cells_of_lifts(floor)
    free = [at for at in cells(rows) if rows[at[1]][at[0]] not in barred and at not in shafts]
    stand = [at for at in free if rows[at[1]][at[0]] != "t"] or free
    fleet["robots"] = min(chance.randint(1, 7), max(1, len(stand) // 3))
    if bays:
        homes = sum(row[0] in DRIVABLE for row in rows)
        fleet["robots"] = max(1, min(fleet["robots"], homes))
        fleet["start"] = "parking-bays"
    elif chance.random() < 0.75:
        fleet["start"] = chance.sample(stand, fleet["robots"])
        if careless and (lifts := sorted(cells_of_lifts(floor))):
            fleet["start"][0] = chance.choice(lifts)
            fleet["start"] = list(dict.fromkeys(fleet["start"]))
            fleet["robots"] = len(fleet["start"])
    else:
        fleet["start"] = "random"
    if not bays and chance.random() < 0.1:
        fleet["when_idle"] = "leave"
    return fleet


def robot_types(chance: Random, fleet: Plain, battery: bool) -> list[Plain]:
    """Two types in one of three: slow ones, with kinematics, payload, durations and batteries."""
    robots = fleet["robots"]
    if robots < 2 or chance.random() < 0.67:
        return []
    slow: Plain = {"name": "slow", "robots": chance.randint(1, robots - 1)}
    slow["move_time_factor"] = chance.randint(1, 3)
    if fleet["kinematics"] != "rail" and chance.random() < 0.3:
        slow["kinematics"] = chance.choice(("omni", "differential"))
    if chance.random() < 0.4:
        slow["durations"] = {"move": {"empty": 1, "loaded": chance.randint(1, 2)}, "pick": 2}
    if chance.random() < 0.3:
        slow["payload"] = chance.choice((1, 5))
    if battery and chance.random() < 0.4:
        slow["battery"] = {
            "drain": {"move": 0.8, "wait": 0.02},
            "charge_rate": chance.choice((2.0, [[0, 4], [60, 1]])),
            "reserve": 10,
        }
    return [slow, {"name": "other"}]


def closed_areas(chance: Random, rows: Rows, types: list[Plain]) -> Plain:
    """A small part of the floor that some robots may not enter, now and then."""
    if chance.random() < 0.85:
        return {}
    closed_to = chance.choice(["loaded", "empty", *(kind["name"] for kind in types)])
    corners = rectangle(chance, rows, 2, 2)
    return {"corner": {"from": corners["from"], "to": corners["to"], "closed_to": [closed_to]}}


def batteries(chance: Random, robots: int) -> Plain:
    """Batteries that are low soon."""
    drain = {
        "move": chance.choice((0.1, 0.5, 1, 2)),
        "turn": chance.choice((0, 0.1, 0.5)),
        "pick": chance.choice((0, 0.3)),
        "drop": chance.choice((0, 0.3)),
        "wait": chance.choice((0, 0.01, 0.05)),
        "loaded_factor": chance.choice((1, 1.5)),
    }
    starts: tuple[Any, ...] = (100, 60, {"from": 5, "to": 100})
    each = tuple(chance.randint(20, 100) for _ in range(robots))
    return {
        "drain": drain,
        "charge_rate": chance.choice((1, 3, 10, [[0, 1]], [[0, 5], [70, 0.5]])),
        "initial_charge": chance.choice((*starts, each)),
        "reserve": chance.choice((0, 0, 20)),
    }


def faults(chance: Random, robots: int, battery: bool, ticks: int) -> Plain:
    """Faults, listed or by probability, towing, repairs in place, and delays."""
    draws = np.random.default_rng(chance.getrandbits(32))
    out: Plain = {"tow_after": 20, "repair_time": 50}
    kind = chance.choice(("none", "crowd", "pods", "listed", "place"))
    if kind == "crowd":
        out |= flow_floors.faults_of(draws)
    elif kind == "pods":
        out |= pod_floors.drawn_faults(chance)
    elif kind in ("listed", "place"):
        when = sorted(chance.randrange(1, ticks) for _ in range(chance.randint(1, 4)))
        out["list"] = [{"robot": chance.randrange(robots), "at": tick} for tick in when]
        out["tow_after"] = chance.choice((1, 5, 20, 20, 20, None))
    if kind == "place":
        out["repair_in_place"] = chance.choice((7, {"uniform": {"from": 2, "to": 20}}))
    if chance.random() < 0.3:
        out["delays"] = {
            "probability": chance.choice((0.005, 0.03)),
            "ticks": {"from": 1, "to": chance.choice((3, 12))},
            "events": chance.choice(("bernoulli", "poisson")),
            "distribution": chance.choice(("uniform", {"gaussian": {"mean_ratio": 0.3}})),
            "of": chance.choice((("move", "turn"), ("move",), ())),
        }
    if battery and chance.random() < 0.4:
        out["charge"] = chance.choice((30, 100))
    return out


# Demand


def demand_for_pods(chance: Random, rows: Rows, ticks: int, under: str) -> Plain:
    """Pods, named stations, and lines or listed orders."""
    stations = pod_floors.named_stations(chance, rows)
    pods = sum(row.count("p") for row in rows)
    listed = pod_floors.listed_pods(chance, rows) if chance.random() < 0.4 else None
    orders: Plain
    if chance.random() < 0.25:
        orders = {"list": pod_floors.listed_orders(chance, rows, listed, ticks)}
    else:
        lines = pod_floors.drawn_lines(chance, pods, len(stations), ticks)
        if listed is not None and isinstance(lines, list):
            lines = pod_floors.by_sku(chance, lines)
        if isinstance(lines, dict) and ticks > TICKS:
            lines["count"] = ticks // chance.choice((10, 20))
            lines["mean_interarrival_time"] = chance.choice((5, 15))
        orders = {"lines": lines}
    if listed is not None and chance.random() < 0.3:
        for pod in listed:
            pod["weight"] = chance.choice((1, 1, 4))
    return {
        "stations": stations,
        "orders": orders,
        "pods": {
            "under": under,
            "join": chance.random() < 0.7,
            "max_stops": chance.choice((1, 2, 4)),
            "classes": pod_floors.CLASSES if chance.random() < 0.5 else None,
            "list": listed,
        },
    }


def demand_without_pods(chance: Random, rows: Rows, robots: int) -> Plain:
    """Loads of shelves, or tours, visits and loads between stations."""
    if any("s" in row for row in rows):
        return {"generator": "full-shelves"}
    generator = chance.choice(("tours", "visits", "stations", "stations"))
    orders: Plain = {"generator": generator, "count": 200}
    if generator == "tours":
        orders["stops"] = {"from": 1, "to": 3}
    if chance.random() < 0.5:
        orders["arrivals"] = {"closed_loop": {"in_system": robots + chance.randint(0, 3)}}
    else:
        orders["mean_interarrival_time"] = chance.choice((0, 2, 10))
    return orders


# Strategies


def strategies(chance: Random, scenario: Plain, rows: Rows, battery: bool) -> Plain:
    """Strategies of all layers that go with the rest of a scenario."""
    fleet, orders = scenario["fleet"], scenario["orders"]
    kinds = {kind.get("kinematics", fleet["kinematics"]) for kind in fleet.get("types", ({},))}
    plans = kinds == {"differential"} and not any(set(row) & set("=~") for row in rows)
    right_of_way = chance.choice(("wait", "retreat", "retreat", "pibt", "pibt", "epibt", "epibt"))
    if right_of_way == "epibt" and not plans:
        right_of_way = "pibt"
    allocation = allocation_for(chance, scenario)
    charging = chance.choice(CHARGING) if battery else "none"
    if orders.get("generator") in ("tours", "visits"):
        charging = "none"
    return {
        "allocation": allocation,
        "charging": charging,
        "routing": "shortest" if right_of_way in STEERED else chance.choice(FOLLOWED),
        "right_of_way": right_of_way,
    }


def allocation_for(chance: Random, scenario: Plain) -> Plain:
    """A strategy that allocates the orders of a scenario."""
    orders = scenario["orders"]
    tours = orders.get("generator") == "tours" or "list" in orders
    names = ["first-come", "shortest-job", "independent", "greedy"]
    is_prioritized = any(line.get("priority") for line in listed(orders))
    if not tours and not is_prioritized:
        names += ["auction"] * 2
    if orders.get("generator") == "full-shelves" and scenario["world"]["access_cell"] == "fixed":
        names += ["cooperative", "adaptive"]
    name = chance.choice(names)
    allocation: Plain = {"name": name}
    if "pods" in scenario and name not in ("cooperative", "adaptive"):
        allocation["storage"] = chance.choice(pod_floors.STORAGE)
    if name == "auction":
        allocation["mechanism"] = chance.choice(MECHANISMS)
        allocation["max_orders_per_robot"] = chance.choice((1, 3))
    if name in ("shortest-job", "greedy"):
        allocation["idle"] = chance.choice(("park", "stay"))
    return allocation


def add_premises(chance: Random, scenario: Plain) -> None:
    """Allocations of types, chargers for two or any number, plans made again after a wait."""
    strategy, fleet, layout = scenario["strategy"], scenario["fleet"], scenario["layout"]
    if fleet["robots"] > 1 and "types" not in fleet and chance.random() < 0.3:
        fleet["types"] = [{"name": "own", "robots": fleet["robots"] // 2}, {"name": "usual"}]
    if "types" in fleet and chance.random() < 0.7:
        own = allocation_for(chance, scenario)
        if own["name"] != "auction" or scenario["information"] == "everything":
            fleet["types"][0]["strategy"] = {"allocation": own}
    if "c" in layout["picture"] and chance.random() < 0.4:
        layout["picture"] = layout["picture"].replace("c", "x")
        layout["legend"] = {"x": {"kind": "charger", "capacity": chance.choice((0, 2, 2))}}
    if strategy["right_of_way"] == "retreat" and chance.random() < 0.3:
        strategy["right_of_way"] = {"name": "retreat", "after_wait": "replan"}
    if strategy["charging"] == "opportunity":
        every = chance.choice((7, 50, 1000))
        strategy["charging"] = {"name": "opportunity", "check_idle_every": every}


def listed(orders: Plain) -> list[Plain]:
    """The lines or orders that are listed one by one."""
    lines = orders.get("lines", orders.get("list"))
    return lines if isinstance(lines, list) else []


def information(chance: Random, strategy: Plain) -> Any:
    """What robots know, as far as their strategies let them know less."""
    if strategy["allocation"]["name"] == "auction" or strategy["right_of_way"] == "epibt":
        return "everything"
    some: tuple[Any, ...] = ({"radius": 3}, {"radius": 5, "shape": "circle"})
    if strategy["right_of_way"] not in STEERED:
        some = (*some, "orders")
    return chance.choice((*some, *["everything"] * 6))


# What a scenario holds


def contents_of(scenario: Plain) -> set[str]:
    """Name what a scenario has, for counts."""
    floor, faults_, fleet = scenario["floor"], scenario["faults"], scenario["fleet"]
    picture, world = scenario["layout"]["picture"], scenario["world"]
    gates = {name for name in ("closed", "doors", "blocks", "lifts") if floor.get(name)}
    fails = bool(faults_.get("list") or faults_.get("failure_probability"))
    strategy = scenario["strategy"]
    is_open = scenario["information"] == "everything"
    by_name = {
        "pods": "pods" in scenario,
        "gates": bool(gates),
        "battery": "battery" in scenario,
        "charging": strategy["charging"] != "none",
        "faults": fails,
        "delays": "delays" in faults_,
        "repair in place": faults_.get("repair_in_place") is not None,
        "types": "types" in fleet,
        "double lanes": "=" in picture,
        "slow zones": world["slowdown"] == "zones",
        "speed limits": "speed_limits" in floor,
        "areas": "areas" in scenario,
        "sight": not is_open,
        "bays": fleet["start"] == "parking-bays",
        "refined": scenario.get("refine", 1) > 1,
        "own allocations": any("strategy" in kind for kind in fleet.get("types", ())),
        "shared chargers": "legend" in scenario["layout"],
    }
    out = {name for name, holds in by_name.items() if holds} | gates
    right_of_way = strategy["right_of_way"]
    out |= {world["following"], fleet["kinematics"], strategy["routing"]}
    out.add("plan again" if isinstance(right_of_way, dict) else right_of_way)
    out.add(strategy["allocation"]["name"])
    if {"pods", "gates", "battery", "faults"} <= out:
        out.add("pods + gates + battery + faults")
    if {"pods", "charging", "gates"} <= out and out & {"faults", "delays"}:
        out.add("pods + gates + charging + faults or delays")
    return out
