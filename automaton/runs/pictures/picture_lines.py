"""The lines below the map of a picture: the state of robots and orders in English.

    A (2, 3) north-south, northbound, carries 7 to (11, 4) via (10, 4), drove; route nnEES
    order 7 delivered to (11, 4) in tick 123, picked up 3 times

One table of phrases is used for writing and for reading. A phrase is a template such as "turning for
{busy} more tick(s)" and the values that it fixes. It is written if its fixed values hold and none of
its named values is the default; reading it yields both. Default values are not mentioned.
"""

from __future__ import annotations

import re
from collections.abc import Iterable
from typing import Final, NamedTuple

from automaton.engine.state import (
    BATTERY_FULL,
    BATTERY_PERCENT,
    GOAL_CHARGE,
    GOAL_DROP,
    GOAL_NONE,
    GOAL_PARK,
    GOAL_PICK,
    GOAL_STOP,
    LAYER_CHARGING,
    NEED_ALLOCATION,
    NEED_CHARGING,
    NEED_RIGHT_OF_WAY,
    NEED_ROUTE,
    NIL,
    ORDER_CARRIED,
    ORDER_DELIVERED,
    ORDER_STARTED,
    ORDER_WAITING,
    REASON_AROUND_CLOSED,
    REASON_AROUND_ROBOTS,
    REASON_IDLE,
    REASON_NEW_GOAL,
    REASON_NO_ORDER,
    REASON_ORDER_RETURNED,
    REASON_ORDER_TAKEN,
    REASON_PICKED,
    REASON_REPLAN,
    REASON_SERVED,
    RETRY_EXHAUSTED,
    RETRY_WAITED,
    Robots,
    World,
)
from automaton.errors import InputError
from automaton.floor.floor_plan import DIRECTIONS, FloorPlan
from automaton.runs.progress import has_lines
from automaton.vocabulary import (
    ACTION_PHRASES,
    CONDITION_WORDS,
    DONE_WORD,
    HEADING_WORDS,
    ORDER_WORDS,
)

Pair = tuple[int, int]
Value = int | Pair | None  # a number, a cell (x, y), or no cell
Facts = dict[str, Value]

CELL_FACTS = {
    "claim",
    "goal_cell",
    "slot",
    "place",
    "current_slot",
    "target",
}  # named values that are cells
PERCENT_FIELDS = {
    "charge",
    "charge_target",
}  # named values that are shares of a full battery, in percent
PLACEHOLDER = re.compile(r"\{(\w+)\}")
BETWEEN_FACTS = re.compile(r", (?![^(]*\))")  # a comma, but not the one inside of (x, y)


class Phrase:
    """A template and the values that it fixes."""

    def __init__(self, template: str, **fixed: Value) -> None:
        self.template = template
        self.fixed = fixed
        self.named = PLACEHOLDER.findall(template)
        self.pattern = re.compile(_pattern(template))

    def write(self, facts: Facts, default: Facts) -> str | None:
        """The phrase with the values of `facts`, None if it does not apply."""
        if any(facts[name] != value for name, value in self.fixed.items()):
            return None
        if any(facts[name] == default[name] for name in self.named):
            return None
        if all(facts[name] == default[name] for name in (*self.fixed, *self.named)):
            return None
        text = self.template
        for name in self.named:
            value = facts[name]
            text = text.replace(
                f"{{{name}}}", percents(value) if name in PERCENT_FIELDS else str(value)
            )
            text = (
                text.replace("(s)", "" if value == 1 else "s") if name not in CELL_FACTS else text
            )
        return text

    def read(self, text: str) -> Facts | None:
        """The values of a text that matches this phrase; None if it does not match."""
        match = self.pattern.fullmatch(text)
        if match is None:
            return None
        said: Facts = dict(self.fixed)
        for name, value in match.groupdict().items():
            if name in PERCENT_FIELDS:
                said[name] = round(float(value) * BATTERY_PERCENT)
            else:
                said[name] = pair(value) if name in CELL_FACTS else int(value)
        return said


def percents(value: Value) -> str:
    """A share of a full battery in percent, with all digits."""
    assert isinstance(value, int)
    return f"{value / BATTERY_PERCENT:.7f}".rstrip("0").rstrip(".")


def _pattern(template: str) -> str:
    pattern = re.escape(template).replace(r"\(s\)", "s?")
    for name in PLACEHOLDER.findall(template):
        value = r"\(-?\d+, -?\d+\)" if name in CELL_FACTS else r"-?\d+"
        value = r"\d+(?:\.\d+)?" if name in PERCENT_FIELDS else value
        pattern = pattern.replace(rf"\{{{name}\}}", f"(?P<{name}>{value})")
    return pattern


def pair(text: str) -> Pair:
    """(x, y) as numbers."""
    x, y = re.findall(r"-?\d+", text)
    return int(x), int(y)


def write_facts(groups: Iterable[Iterable[Phrase]], facts: Facts, default: Facts) -> list[str]:
    """The first phrase of each group that applies."""
    written = []
    for group in groups:
        said = (phrase.write(facts, default) for phrase in group)
        text = next((one for one in said if one is not None), None)
        if text is not None:
            written.append(text)
    return written


def read_facts(groups: Iterable[Iterable[Phrase]], text: str, subject: str) -> Facts:
    """The values of comma-separated facts. Raises InputError for unknown words."""
    phrases = [phrase for group in groups for phrase in group]
    facts: Facts = {}
    for one in BETWEEN_FACTS.split(text) if text else ():
        said = next((found for phrase in phrases if (found := phrase.read(one)) is not None), None)
        if said is None:
            raise InputError(f"'{one}' is not a known fact about {subject}")
        facts.update(said)
    return facts


def write_route(steps: Iterable[int], at: int) -> str:
    """Directions as letters, lower case for steps already driven; runs of more than 3 are counted.

    eeSSE   two steps east driven; south, south and east to come
    12eS    12 steps east driven; south to come
    """
    letters = "".join("ESWN"[step] for step in steps)
    letters = letters[:at].lower() + letters[at:]
    return re.sub(r"(.)\1{3,}", lambda run: f"{len(run[0])}{run[1]}", letters)


def read_route(text: str) -> tuple[list[int], int]:
    """The directions of a route and the number of steps already driven. Raises InputError."""
    if not re.fullmatch(r"(\d*[eswn])*(\d*[ESWN])*", text):
        raise InputError(
            f"'{text}' is not a route: use eswn for steps driven, then ESWN for steps to come"
        )
    runs = re.findall(r"(\d*)([eswnESWN])", text)
    letters = "".join(letter * int(count or 1) for count, letter in runs)
    return ["ESWN".index(letter) for letter in letters.upper()], sum(map(str.islower, letters))


# An order has a line once it has left its initial place.
#
# order 8 under way; stops in ticks 12 31
#
# The line of a robot names its order. A carried order has a line only if it was dropped on its way
# before. An order without a load has a line as soon as a stop is done.


ORDER_NUMBERS = ("state", "delivered", "legs")


def _order_phrase(state: int, rest: str = "") -> Phrase:
    return Phrase(ORDER_WORDS[state] + rest, state=state)


STATE_PHRASES = (
    Phrase(f"{DONE_WORD} at {{current_slot}} in tick {{delivered}}", state=ORDER_DELIVERED, trip=1),
    _order_phrase(ORDER_DELIVERED, " to {current_slot} in tick {delivered}"),
    _order_phrase(ORDER_WAITING, " at {current_slot} as load {spare} for {target}"),
    _order_phrase(ORDER_WAITING, " at {current_slot} for {target}"),
    _order_phrase(ORDER_CARRIED, " to {target}"),
    _order_phrase(ORDER_CARRIED),
    Phrase(f"{DONE_WORD} in tick {{delivered}}", state=ORDER_DELIVERED),
    _order_phrase(ORDER_WAITING, " again"),
    _order_phrase(ORDER_STARTED),
)
ORDER_PHRASE_GROUPS = (STATE_PHRASES, (Phrase("picked up {legs} time(s)"),))
# Values that a line omits. An order with a line was picked up at least once.
LEFT_OUT: Final[Facts] = {
    **{"state": NIL, "delivered": NIL, "legs": 1, "spare": NIL, "trip": 0},
    **{"current_slot": None, "target": None},
}
ORDER_LINE = re.compile(
    r"order (?P<number>\d+) (?P<facts>[^;]+)(?:; stops in ticks (?P<stops>[\d ]+))?"
)


def order_line(world: World, floor_plan: FloorPlan, order: int) -> str | None:
    """The line of an order; None if it needs none."""
    facts = order_facts(world, floor_plan, order)
    if facts["current_slot"] == facts["source"] and facts["legs"] == 0:
        return None  # still at its initial place
    stops_done = int(world.orders.stops_done[order])
    if facts["state"] == ORDER_CARRIED and facts["legs"] == 1 and not stops_done:
        return None  # shown in the robot's line
    name = "trip" if facts["trip"] else "order"
    line = f"{name} {order} {', '.join(write_facts(ORDER_PHRASE_GROUPS, facts, LEFT_OUT))}"
    first = int(world.orders.first_stop[order])
    ticks = world.stops.done[first : first + stops_done].tolist()
    return line + (f"; stops in ticks {' '.join(map(str, ticks))}" if ticks else "")


def order_facts(world: World, floor_plan: FloorPlan, order: int) -> Facts:
    """The values of an order in the world, with slots as (x, y)."""
    orders = world.orders

    def xy(slot: int) -> Value:
        return None if slot == NIL else floor_plan.xy(int(world.slots.cell[slot]))

    facts: Facts = {name: int(getattr(orders, name)[order]) for name in ORDER_NUMBERS}
    facts["trip"] = int(has_lines(world))
    for name in ("current_slot", "target", "source"):
        facts[name] = xy(int(getattr(orders, name)[order]))
    current_slot = int(orders.current_slot[order])
    facts["spare"] = (
        current_slot - world.slots.first_spare if current_slot >= world.slots.first_spare else NIL
    )
    return facts


class DrawnOrder(NamedTuple):
    """The content of an order's line."""

    number: int
    facts: Facts
    stops: list[int]  # the ticks in which its stops were done


def read_order(text: str) -> DrawnOrder:
    """Read the line of an order. Raises InputError."""
    match = ORDER_LINE.fullmatch(text)
    if match is None:
        raise InputError(
            f"'{text}' is not a line about an order, such as order 7 waiting at (3, 4)"
        )
    facts = read_facts(ORDER_PHRASE_GROUPS, match["facts"], f"order {match['number']}")
    if "state" not in facts:
        raise InputError(f"order {match['number']}: is it delivered, waiting or carried?")
    stops = [int(tick) for tick in (match["stops"] or "").split()]
    return DrawnOrder(int(match["number"]), LEFT_OUT | facts, stops)


# The line of a robot. Robots 0 to 25 are named A to Z, the others by number. Some defaults depend on
# other values (a robot's direction of travel is its heading).


# Fields with their own notation in a line; all other fields of the state are written as numbers.
OTHERWISE = {
    *("cell", "claim", "goal_cell", "slot", "need", "service_zone"),
    *("route", "route_length", "route_index", "order_queue"),
}
NEEDS = {
    "need_work": NEED_ALLOCATION,
    "need_route": NEED_ROUTE,
    "need_way": NEED_RIGHT_OF_WAY,
    "need_charging": NEED_CHARGING,
}

TASK = (
    Phrase("carries {load} to {slot} via {goal_cell}", goal_type=GOAL_DROP),
    Phrase("carries {load}", goal_type=GOAL_NONE),
    Phrase("fetches {order} from {place} via {goal_cell}", goal_type=GOAL_PICK),
    Phrase("carries {load} to a stop at {goal_cell}", goal_type=GOAL_STOP),
    Phrase("does a stop of {order} at {goal_cell}", goal_type=GOAL_STOP),
    Phrase("goes home", goal_type=GOAL_PARK),
    Phrase("goes to {goal_cell} to charge up to {charge_target} %", goal_type=GOAL_CHARGE),
)
ACTION = tuple(
    Phrase(text, action=code) if "{busy}" in text else Phrase(text, action=code, busy=0)
    for code, phrases in enumerate(ACTION_PHRASES)
    for text in (f"{phrases.present} for {{busy}} more tick(s)", phrases.past)
)
REASON = (
    Phrase("last asked as free", reason=REASON_IDLE),
    Phrase("last asked after a pick", reason=REASON_PICKED),
    Phrase("last asked after a stop", reason=REASON_SERVED),
    Phrase("last asked after giving its order back", reason=REASON_ORDER_RETURNED),
    Phrase("last asked for a new plan", reason=REASON_REPLAN),
)
PHRASE_GROUPS = (
    tuple(Phrase(f"{name}bound", travel=d) for d, name in enumerate(DIRECTIONS)),
    TASK,
    (Phrase("will try to drop first", try_drop=1),),
    ACTION,
    (Phrase("claims {claim}"),),
    (Phrase("retreats {retreat_moves} more step(s)"),),
    (Phrase("failed {failed_retries} time(s)"),),
    (
        Phrase("then retries", retry_state=RETRY_WAITED),
        Phrase("is stuck", retry_state=RETRY_EXHAUSTED),
    ),
    (Phrase("asks for the right of way", need_way=1),),
    (
        Phrase("found no work at change {seen_revision}", need_work=1),
        Phrase("asks for work", need_work=1),
    ),
    REASON,
    (Phrase("asks for a route", need_route=1),),
    (
        Phrase("routed around robots", route_reason=REASON_AROUND_ROBOTS),
        Phrase("routed around closed cells", route_reason=REASON_AROUND_CLOSED),
        Phrase("routed freely", route_reason=REASON_NEW_GOAL),
        Phrase("never routed", route_reason=0),
    ),
    tuple(Phrase(f"is told to step {name}", step=d) for d, name in enumerate(DIRECTIONS)),
    (Phrase("parked", parked=1),),
    (Phrase("priority {priority}"),),
    (Phrase("zone {service_zone}"),),
    (Phrase("may have an order while it charges", charging_interruptible=1),),
    (Phrase("charge {charge} %"),),
    tuple(Phrase(word, status=code) for code, word in enumerate(CONDITION_WORDS)),
    (Phrase("for good", status_until=NIL), Phrase("until tick {status_until}")),
    (Phrase("has ticket {ticket}"),),
    (Phrase("asks for charging", need_charging=1),),
    (
        Phrase("charging asked after an order", charging_reason=REASON_ORDER_TAKEN),
        Phrase("charging asked when idle", charging_reason=REASON_NO_ORDER),
    ),
)


def numbers_of(robots: type[Robots]) -> dict[str, int]:
    """The fields of a class of robots that a line writes as numbers, and their defaults."""
    names = robots.fields_where(lambda declared: declared.digest is not None)
    return {n: robots._declared[n].default for n in (*names, "step") if n not in OTHERWISE}


def groups_of(robots: type[Robots]) -> tuple[tuple[Phrase, ...], ...]:
    """The phrases of a line; a field without a phrase is written by its name."""
    phrases = [phrase for group in PHRASE_GROUPS for phrase in group]
    said = {"heading"}.union(*([*phrase.named, *phrase.fixed] for phrase in phrases))
    others = [name for name in numbers_of(robots) if name not in said]
    return (*PHRASE_GROUPS, *((Phrase(f"{name.replace('_', ' ')} {{{name}}}"),) for name in others))


OFF_FLOOR = "off the floor at"
ROBOT_LINE = re.compile(
    r"(?P<name>[A-Z]|\d+) "
    r"(?P<place>\(-?\d+, -?\d+\)|in its parking bay|off the floor at \(\d+, \d+\))"
    r"(?:,? (?P<heading>east-west|north-south|facing \w+))?(?:, (?P<facts>[^;]+))?"
    r"(?:; route (?P<route>\w+))?(?:; plan (?P<plan>[\d ]+))?"
)


def name_of(identity: int) -> str:
    """A to Z, then numbers from 26."""
    return chr(ord("A") + identity) if identity < 26 else str(identity)


def identity_of(name: str) -> int:
    return ord(name) - ord("A") if name.isupper() else int(name)


def robot_line(world: World, floor_plan: FloorPlan, i: int, brief: bool = False) -> str:
    """The line of the robot at storage index i; brief: without values that have no effect."""
    robots = world.robots
    facts = robot_facts(world, floor_plan, i)
    default = default_facts(facts, int(world.clock.tick), type(robots))
    headings = int(world.grid.type_headings[robots.type[i]])
    if brief:
        facts |= {name: default[name] for name in idle_facts(world, headings)}
    said = write_facts(groups_of(type(robots)), facts, default)
    heading = _heading_words(headings)[int(robots.heading[i])]
    start = f"{name_of(int(robots.identity[i]))} {_place(facts)}"
    if heading:
        start += f"{',' if facts['cell'] is None else ''} {heading}"
    line = ", ".join([start, *said])
    route_length, order_queue_length = (
        int(robots.route_length[i]),
        int(robots.order_queue_length[i]),
    )
    if route_length:
        steps, driven = robots.route[i, :route_length].tolist(), int(robots.route_index[i])
        line += f"; route {write_route(steps, driven)}"
    if order_queue_length:
        line += (
            f"; plan {' '.join(str(order) for order in robots.order_queue[i, :order_queue_length])}"
        )
    return line


def idle_facts(world: World, headings: int) -> list[str]:
    """The values without effect in this world: `travel` of robots that never turn, charging requests
    without a charging strategy.

    `headings`: the number of headings of the robot's type.
    """
    names = ["travel"] if headings == 1 else []
    if world.tally.batches[LAYER_CHARGING] == 0:  # no charging strategy
        names += ["need_charging", "charging_reason"]
    return names


def _place(facts: Facts) -> str:
    """The place of a robot."""
    if facts["cell"] is not None:
        return str(facts["cell"])
    return f"{OFF_FLOOR} {facts['left']}" if facts["left"] else "in its parking bay"


def robot_facts(world: World, floor_plan: FloorPlan, i: int) -> Facts:
    """The values of a robot in the world, with cells as (x, y)."""
    robots = world.robots

    def xy(cell: int) -> Value:
        return None if cell == NIL else floor_plan.xy(cell)

    facts: Facts = {name: int(getattr(robots, name)[i]) for name in numbers_of(type(robots))}
    facts["service_zone"] = int(robots.service_zone[i]) + 1  # counted from 1, like stations
    for name in ("cell", "claim", "goal_cell"):
        facts[name] = xy(int(getattr(robots, name)[i]))
    off = facts["cell"] is None and robots.bay[i] == NIL
    facts["left"] = xy(int(robots.home[i])) if off else None
    slot, order = int(robots.slot[i]), int(robots.order[i])
    place = NIL if order == NIL else int(world.orders.current_slot[order])
    facts["slot"] = None if slot == NIL else xy(int(world.slots.cell[slot]))
    facts["place"] = None if place == NIL else xy(int(world.slots.cell[place]))
    for name, bit in NEEDS.items():
        facts[name] = int(int(robots.need[i]) & bit != 0)
    return facts


def default_facts(facts: Facts, tick: int, robots: type[Robots] = Robots) -> Facts:
    """The values that a line omits, given its other values."""
    default: Facts = {**numbers_of(robots), **dict.fromkeys([*NEEDS, "service_zone"], 0)}
    default.update(dict.fromkeys(("claim", "goal_cell", "slot", "place", "left")))
    default["charge"] = BATTERY_FULL
    default["cell"] = None
    default["heading"] = default["travel"] = facts.get("heading", 0)
    default["parked"] = int(facts["cell"] is None)
    default["reason"] = REASON_IDLE if facts.get("load", NIL) == NIL else REASON_PICKED
    default["route_reason"] = REASON_NEW_GOAL if tick else 0
    return default


class RobotLine(NamedTuple):
    """The content of a robot's line."""

    identity: int
    facts: Facts
    route: tuple[list[int], int]  # steps, and number of steps already driven
    plan: list[int]


def read_robot(text: str, tick: int, robots: type[Robots] = Robots) -> RobotLine:
    """Read the line of a robot. Raises InputError."""
    match = ROBOT_LINE.fullmatch(text)
    if match is None:
        raise InputError(
            f"'{text}' is not a line about a robot, such as A (2, 3) north-south, drove"
        )
    facts = read_facts(groups_of(robots), match["facts"] or "", f"robot {match['name']}")
    place = match["place"]
    facts["cell"] = pair(place) if place.startswith("(") else None
    facts["left"] = pair(place) if place.startswith(OFF_FLOOR) else None
    if match["heading"]:
        facts["heading"] = _heading(match["heading"])
    facts["order"] = facts.get("load", facts.get("order", NIL))
    facts = default_facts(facts, tick, robots) | facts
    plan = [int(order) for order in (match["plan"] or "").split()]
    return RobotLine(identity_of(match["name"]), facts, read_route(match["route"] or ""), plan)


def _heading_words(headings: int) -> tuple[str, ...]:
    """The words for each heading of a type with this number of headings ("facing" with four)."""
    names = HEADING_WORDS[headings]
    return tuple(f"facing {name}" for name in names) if headings == len(DIRECTIONS) else names


def _heading(words: str) -> int:
    for headings in HEADING_WORDS:
        if words in _heading_words(headings):
            return _heading_words(headings).index(words)
    raise InputError(f"'{words}' is not a direction; there are {', '.join(DIRECTIONS)}")
