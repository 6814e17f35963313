"""Small floors with pods, drawn at random: aisles, blocks of storage, stations with queues, lines."""

from __future__ import annotations

from random import Random
from typing import Any

import msgspec

from automaton.scenario.schema import Scenario
from automaton.world.resolve import Resolved, resolve

TICKS = 300  # of a run
WAYS = {"omni": ("..", "==", "><", "<>"), "differential": ("..", "==", "><"), "rail": ("++",)}
ALLOCATIONS = ("first-come", "shortest-job", "independent", "greedy", "auction")
STORAGE = ("fixed", "nearest", "class", "random")
DRIVING = (  # routing, right of way
    *(("shortest", "wait"), ("shortest", "retreat"), ("astar", "retreat")),
    ("traffic-avoidance", "retreat"),
    *(("shortest", "pibt"), ("shortest", "epibt")),
)
CLASSES = {"A": 0.3, "B": 0.7}
Place = tuple[int, int]


def drawn_pods(number: int, ticks: int = TICKS) -> Resolved:
    """The scenario of a number. Raises InputError: some that are drawn are refused."""
    chance = Random(f"pods {number}")
    kinematics = chance.choice(tuple(WAYS))
    rows = picture(chance, kinematics)
    stations = named_stations(chance, rows)
    pods = sum(row.count("p") for row in rows)
    robots = chance.randint(1, 6)
    hardships = Random(f"hardships {number}")
    under = hardships.choice(("empty", "empty", "none"))
    barred = "#t" if under == "empty" else "#tpq"
    free = [(x, y) for x, y in cells(rows) if rows[y][x] not in barred]
    listed = listed_pods(chance, rows) if chance.random() < 0.4 else None
    orders: Any = drawn_lines(chance, pods, len(stations), ticks)
    if listed is not None and isinstance(orders, list):
        orders = by_sku(chance, orders)
    names = [name for name in ALLOCATIONS if number % 4 != 3 or name != "auction"]
    allocation = {"name": chance.choice(names), "storage": chance.choice(STORAGE)}
    if allocation["name"] == "auction" and isinstance(orders, list):
        orders = [{**line, "priority": 0} for line in orders]  # of which auctions know none
    orders = {"lines": orders}
    if number % 4 == 3:
        orders = {"list": listed_orders(chance, rows, listed, ticks)}
    driving, following = chance.choice(DRIVING), chance.random() < 0.8
    if driving[1] == "epibt" and (kinematics != "differential"):
        driving = ("shortest", "pibt")
    sight: Any = "everything"
    if allocation["name"] != "auction" and driving[1] != "epibt":
        sight = chance.choice(("everything", "everything", {"radius": 3}))
    scenario = {
        "name": f"pods-{number}",
        "layout": {"picture": "\n".join("".join(row) for row in rows)},
        "fleet": {
            "robots": min(robots, len(free)),
            "kinematics": kinematics,
            "start": chance.sample(free, min(robots, len(free))),
        },
        "durations": {
            "move": chance.choice((1, 1, 2)),
            "turn": chance.choice((1, 1, 3)),
            "pick": chance.choice((0, 1, 3)),
            "drop": chance.choice((0, 1, 3)),
            "handling": drawn_handling(chance),
        },
        "world": {"following": "convoy" if following else "none"},
        "pods": {
            "under": under,
            "join": chance.random() < 0.7,
            "max_stops": chance.choice((1, 2, 4)),
            "classes": CLASSES if chance.random() < 0.5 else None,
            "list": listed,
        },
        "stations": stations,
        "orders": orders,
        "strategy": {
            "allocation": allocation,
            **dict(zip(("routing", "right_of_way"), driving, strict=True)),
        },
        "faults": drawn_faults(hardships),
        "information": sight,
        "stop": {"when": "delivered", "max_duration": ticks},
        "seed": number,
    }
    return resolve(msgspec.convert(scenario, Scenario))


def drawn_faults(chance: Random) -> dict[str, Any]:
    """Robots that go down and are towed, on every other floor."""
    return {
        "failure_probability": chance.choice((0, 0, 0.002, 0.01)),
        "tow_after": chance.choice((1, 3, 20, None)),
        "repair_time": chance.choice((1, 30, None)),
    }


def cells(rows: list[list[str]]) -> list[Place]:
    return [(x, y) for y, row in enumerate(rows) for x in range(len(row))]


def picture(chance: Random, kinematics: str) -> list[list[str]]:
    """Aisles with one or two rows of storage between them, ways around, and stations."""
    ways, width = chance.choice(WAYS[kinematics]), chance.randint(5, 9)
    side = "+" if kinematics == "rail" else "."
    rows = [ways[0] * width]
    for block in range(chance.randint(1, 2)):
        for _ in range(chance.randint(1, 2)):
            rows.append("".join(chance.choices(f"pq#{side}", (12, 5, 2, 2), k=width)))
        rows.append(ways[(block + 1) % 2] * width)
    drawn = [list(side + row + side) for row in rows]
    if not any("p" in row for row in drawn):
        drawn[1][1] = "p"
    drawn.append(["#"] * (width + 2))  # pockets: here stations are out of the way
    for _ in range(chance.randint(1, 3)):
        spots = [(x, y) for x, y in cells(drawn) if drawn[y][x] not in "pq#t"]
        x, y = chance.choice(spots)
        if chance.random() < 0.5:
            x, y = chance.randrange(1, width + 1), len(drawn) - 1
        drawn[y][x] = "t"
    return drawn


def listed_pods(chance: Random, rows: list[list[str]]) -> list[dict[str, Any]]:
    """The pods that are drawn and some more, in any sequence, with some SKUs each."""
    spots = [(x, y) for x, y in cells(rows) if rows[y][x] == "p"]
    spots += [(x, y) for x, y in cells(rows) if rows[y][x] == "q" and chance.random() < 0.3]
    chance.shuffle(spots)
    pods = [{"at": at, "skus": chance.sample("ABCD", chance.choice((0, 1, 1, 3)))} for at in spots]
    pods[0]["skus"] = list("ABCD")
    return pods


def listed_orders(
    chance: Random, rows: list[list[str]], pods: list[dict[str, Any]] | None, ticks: int
) -> list[dict[str, Any]]:
    """Pods to stops and to storage, some of them again and again, and tours between."""
    storage = [(x, y) for x, y in cells(rows) if rows[y][x] in "pq"]
    drawn = [(x, y) for x, y in storage if rows[y][x] == "p"]
    empty = [at for at in storage if at not in (drawn if pods is None else [p["at"] for p in pods])]
    standing = drawn if pods is None else [pod["at"] for pod in pods]
    standing = standing[: chance.choice((2, 99))]
    ways = [(x, y) for x, y in cells(rows) if rows[y][x] not in "pq#"]
    stations = [(x, y) for x, y in ways if rows[y][x] == "t"]
    orders: list[dict[str, Any]] = []
    for _ in range(chance.randint(1, chance.choice((5, 20)))):
        order: dict[str, Any] = {"from": chance.choice(standing)}
        places = stations if chance.random() < 0.7 else ways
        order["stops"] = [
            {"at": chance.choice(places), "for": chance.choice((0, 1, 6))}
            for _ in range(chance.choice((0, 1, 1, 3)))
        ]
        if not order["stops"]:
            del order["stops"]
        if chance.random() < 0.4:
            order["to"] = chance.choice([*empty, *empty, order["from"], *storage[:1]])
        if order.get("to") == order["from"] and "stops" not in order:
            del order["to"]
        if chance.random() < 0.15:
            order = {"stops": [chance.choice(ways)]}
        order["release"] = chance.choice((0, 0, chance.randrange(ticks // 2)))
        order["priority"] = chance.choice((0, 0, 0, 2))
        orders.append(order)
    orders[0] = {"from": standing[0], "stops": [stations[0]]}
    return orders


def by_sku(chance: Random, lines: list[dict[str, Any]]) -> list[dict[str, Any]]:
    """Two thirds of the lines want a SKU, and not a pod."""
    return [
        {**line, "pod": None, "sku": chance.choice("ABCD")} if chance.random() < 0.67 else line
        for line in lines
    ]


def named_stations(chance: Random, rows: list[list[str]]) -> dict[str, Any]:
    """By name: the cell, a queue that is straight, places and breaks."""
    found: dict[str, Any] = {}
    taken: set[Place] = set()
    for x, y in cells(rows):
        if rows[y][x] != "t":
            continue
        dx, dy = chance.choice(((1, 0), (-1, 0), (0, 1), (0, -1)))
        queue: list[Place] = []
        for step in range(1, chance.randint(1, 4)):
            u, v = x + step * dx, y + step * dy
            inside = 0 <= v < len(rows) and 0 <= u < len(rows[0])
            if not inside or rows[v][u] not in ".+" or (u, v) in taken:
                break
            queue.append((u, v))
        taken |= set(queue)
        one: dict[str, Any] = {"at": (x, y), "queue": queue}
        one["max_trips"] = chance.choice(("queue", "queue", None, 1, 2))
        if chance.random() < 0.3:
            one["breaks"] = [{"from": chance.randint(0, 200), "for": chance.randint(1, 60)}]
        if chance.random() < 0.3:
            one["handling"] = drawn_handling(chance)
        found[f"P{len(found) + 1}"] = one
    return found


def drawn_handling(chance: Random) -> dict[str, Any]:
    line = chance.choice(
        (
            *(0, 2, 7, 2.5),
            {"uniform": {"from": 1, "to": 6}},
            {"lognormal": {"mean": 5, "sd": 3}},
            {"exponential": 4},
            {"empirical": [1.5, 3, 8]},
        )
    )
    return {"visit": chance.choice((0, 0, 1, 0.3)), "line": line, "unit": chance.choice((0, 0.4))}


def drawn_lines(chance: Random, pods: int, stations: int, ticks: int) -> Any:
    """Lines, listed or drawn."""
    count = chance.randint(1, chance.choice((6, 25)))
    if chance.random() < 0.4:
        return {
            "count": count,
            "mean_interarrival_time": chance.choice((0, 5, 12)),
            "per_order": chance.choice((1, {"mean": 2})),
            "stations": chance.choice(("fewest-lines", "random")),
        }
    lines = []
    for _ in range(count):
        line = {"pod": chance.randint(1, min(pods, chance.choice((2, 99)))), "units": 1}
        line["release"] = chance.choice((0, 0, chance.randrange(ticks // 2)))
        line["priority"] = chance.choice((0, 0, 0, 2))
        line["units"] = chance.randint(0, 3)
        if chance.random() < 0.5:
            line["station"] = chance.randint(1, stations)
        if chance.random() < 0.4:
            line["order"] = chance.randint(1, 5)
        lines.append(line)
    return lines
