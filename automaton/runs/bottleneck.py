"""The bottleneck of a run: what was saturated for longest, when, and what the others did meanwhile.

The rules are in `saturated`. The first that holds counts, since what comes later follows from it: a
robot that waits for a charger is not idle either.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Final, NamedTuple

from automaton.runs.metric_catalogue import units_of
from automaton.runs.periods import HOUR_S, moment
from automaton.runs.periods import Period as Period
from automaton.units import count, number, percent
from automaton.world.resolved import Resolved

BUSY_SHARE: Final = 0.9  # share of time from which a station or the chargers are saturated
LINED_UP: Final = 0.5  # robots that stand on the way to full chargers
STATIONS_SHARE: Final = 0.5  # share of saturated stations from which it is the stations
LOST: Final = 1 / 3  # share of the time of robots at work, lost in traffic
IDLE_SHARE: Final = 0.05  # share of robots
FALL: Final = 0.1  # of a rate, from which it is said to fall
MEANS: Final = Period._fields[
    Period._fields.index("on_orders") : -1
]  # means over the ticks of a period
LEAST_TICKS: Final = 128  # of a run that has a bottleneck while it is watched
MENTIONED: Final = 0.05  # share of the run in which something else has to be saturated
MOST_DESCRIBED: Final = 3  # resources; others are only named


class Bottleneck(NamedTuple):
    """The resource that was saturated for longest."""

    resource: str  # chargers, stations, traffic, robots, or "station NAME"
    share: float  # of the run in which it was saturated
    first: int  # number of the first period of the longest stretch in which it was
    last: int


def saturated(period: Period, robots: int, stations: Sequence[str]) -> list[str]:
    """What is saturated in a period; several only if they are stations.

    Chargers, if their places are nearly always taken and half a robot or more stands on the way to one;
    stations, each or if they are many together, if they nearly always work; traffic, if a third of the
    robots at work lose their time to it; robots, if hardly one is idle although orders are open.
    """
    taken = period.charger_share >= BUSY_SHARE
    if period.chargers and taken and sum(period.charger_queues) >= LINED_UP:
        return ["chargers"]
    busy = [k for k, share in enumerate(period.stations) if share >= BUSY_SHARE]
    if len(busy) > 1 and len(busy) >= STATIONS_SHARE * len(period.stations):
        return ["stations"]
    if busy:
        return [f"station {stations[k]}" for k in busy]
    at_work = period.on_orders + period.in_traffic
    if at_work and period.in_traffic >= LOST * at_work:
        return ["traffic"]
    idle = period.idle + period.aside
    return ["robots"] if period.backlog and idle <= IDLE_SHARE * robots else []


def bottlenecks_of(
    periods: Sequence[Period], robots: int, stations: Sequence[str]
) -> list[Bottleneck]:
    """What was saturated, for longest first; nothing if no resource was.

    Of stations that were saturated equally long, the one with the longest queue comes first.
    """
    resources = [saturated(period, robots, stations) for period in periods]
    ticks: dict[str, int] = {}
    for names, period in zip(resources, periods, strict=True):
        for name in names:
            ticks[name] = ticks.get(name, 0) + period.ticks
    queues = in_queues(joined(periods))[0] if periods else ()
    queue_of = {f"station {name}": queue for name, queue in zip(stations, queues, strict=True)}
    return [
        Bottleneck(
            name,
            ticks[name] / max(periods[-1].end, 1),
            *longest_stretch(periods, [name in names for names in resources]),
        )
        for name in sorted(ticks, key=lambda one: (-ticks[one], -queue_of.get(one, 0.0)))
    ]


def longest_stretch(periods: Sequence[Period], is_in: Sequence[bool]) -> tuple[int, int]:
    """The first and the last period of the longest stretch of periods that are in it."""
    best, first, length = (0, 0), 0, -1
    for k, inside in enumerate(is_in):
        if not inside:
            first = k + 1
        elif periods[k].end - periods[first].begin > length:
            best, length = (first, k), periods[k].end - periods[first].begin
    return best


def bottleneck_sentences(resolved: Resolved, periods: Sequence[Period]) -> list[str]:
    """The paragraph about the bottleneck: what was saturated, when, and what the others did."""
    robots = resolved.scenario.fleet.robots
    if not periods:
        return []
    names = _stations(resolved, periods)
    bottlenecks = bottlenecks_of(periods, robots, names)
    if not bottlenecks or bottlenecks[0].share < MENTIONED:
        for_long = " for long" if bottlenecks else ""
        use = "; ".join(others("", joined(periods), robots))
        return [f"No resource was saturated{for_long}: {use}."]
    first, *more = bottlenecks
    stretch = joined(periods[first.first : first.last + 1])
    share = percent(first.share, 0)
    sentences = [
        f"{subject(first.resource)} the bottleneck, saturated for {share} of the run; the longest "
        f"stretch was {stretch_text(resolved, stretch)}: "
        f"{'; '.join(facts(first.resource, stretch, robots, names))}.",
        f"In this stretch {'; '.join(others(first.resource, stretch, robots))}.",
    ]
    mentioned = [first, *(one for one in more if one.share >= MENTIONED)]
    for one in mentioned[:MOST_DESCRIBED]:
        fall = rate_fall(resolved, periods, one)
        stretch = joined(periods[one.first : one.last + 1])
        if one is first and fall:
            sentences.append(f"As it began, {fall}.")
        elif one is not first:
            texts = [*facts(one.resource, stretch, robots, names), *([fall] if fall else [])]
            when = stretch_text(resolved, stretch)
            sentences.append(f"{subject(one.resource)} also saturated, {when}: {'; '.join(texts)}.")
    if rest := [one.resource for one in mentioned[MOST_DESCRIBED:]]:
        sentences.append(f"Also saturated: {', '.join(rest)}.")
    return [" ".join(sentences)]


def bottleneck_in_short(resolved: Resolved, periods: Sequence[Period]) -> str:
    """What was saturated for longest, and for how long; "" before the first period."""
    if not periods:
        return ""
    resource, share = longest_saturated(resolved, periods)
    if not share:
        return f"nothing saturated{' for long' if resource else ''}"
    return f"{resource}, saturated {percent(share, 0)} of the run"


def longest_saturated(resolved: Resolved, periods: Sequence[Period]) -> tuple[str, float]:
    """The resource that was saturated for longest, and its share of the run.

    ("", 0) if none was, and a share of 0 if it was not for long.
    """
    names, robots = _stations(resolved, periods), resolved.scenario.fleet.robots
    first = next(iter(bottlenecks_of(periods, robots, names)), None)
    if first is None:
        return "", 0.0
    return first.resource, first.share if first.share >= MENTIONED else 0.0


def _stations(resolved: Resolved, periods: Sequence[Period]) -> Sequence[str]:
    """The names of stations, or their numbers."""
    places, number_of = resolved.place_names.values(), len(periods[0].stations)
    known = [name.partition(" ")[2] for name in places if name.startswith("station ")]
    return known if len(known) == number_of else [str(k + 1) for k in range(number_of)]


def subject(resource: str) -> str:
    """A resource as the beginning of a sentence, with its verb."""
    is_one = resource.startswith("station ") or resource == "traffic"
    return f"{resource[0].upper()}{resource[1:]} {'was' if is_one else 'were'}"


def stretch_text(resolved: Resolved, stretch: Period) -> str:
    """When a stretch was: "from 13:00 to 14:00"."""
    return f"from {moment(resolved, stretch.begin)} to {moment(resolved, stretch.end)}"


def joined(periods: Sequence[Period]) -> Period:
    """Periods that follow each other as one; means are weighted by their ticks."""
    ticks = max(sum(one.ticks for one in periods), 1)

    def mean(values: Sequence[float]) -> float:
        pairs = zip(values, periods, strict=True)
        return sum(value * one.ticks for value, one in pairs) / ticks

    def mean_of(name: str) -> Any:
        values = [getattr(one, name) for one in periods]
        if isinstance(values[0], tuple):
            return tuple(mean(column) for column in zip(*values, strict=True))
        return mean(values)

    late = [one.late for one in periods if one.late is not None]
    first, last = periods[0], periods[-1]
    return first._replace(
        end=last.end,
        done=sum(one.done for one in periods),
        backlog=last.backlog,
        late=sum(late) if late else None,
        **{name: mean_of(name) for name in MEANS},
    )


def energy_of(period: Period) -> float:
    """Robots that charge, drive to chargers, or wait on the way there."""
    return period.charging + period.to_chargers + period.for_chargers


def facts(resource: str, period: Period, robots: int, stations: Sequence[str] = ()) -> list[str]:
    """How a resource was used in a period; `stations`: their names, for a single one."""
    if resource == "chargers":
        busy, queue = period.charging_places, sum(period.charger_queues)
        every = count(sum(period.places), "charger")
        if sum(period.places) > len(period.places):
            every = (
                f"{count(sum(period.places), 'place')} of {count(len(period.places), 'charger')}"
            )
        return [
            f"{number(round(busy, 1))} of {every} busy",
            f"{number(round(queue, 1))} robots standing on the way to a charger",
        ]
    if resource == "traffic":
        at_work = period.on_orders + period.in_traffic
        share = percent(period.in_traffic / at_work if at_work else 0.0, 0)
        return [f"{share} of the time of robots at work was lost in traffic"]
    if resource == "robots":
        texts = [f"{number(round(period.on_orders, 1))} of {count(robots, 'robot')} on orders"]
        energy = energy_of(period)
        return texts + (
            [f"{number(round(energy, 1))} charging, or on the way to a charger"] if energy else []
        )
    mean = sum(period.stations) / max(len(period.stations), 1)
    queues, what = in_queues(period)
    if resource == "stations":
        many = number(round(sum(queues), 1))
        return [f"stations {percent(mean, 0)} busy", f"{many} {what} in queues"]
    station = list(stations).index(resource.removeprefix("station "))
    text = f"{percent(period.stations[station], 0)} busy, all stations {percent(mean, 0)}"
    return [text, f"{number(round(queues[station], 1))} {what} in its queue"]


def in_queues(period: Period) -> tuple[tuple[float, ...], str]:
    """How many wait at each station, and what: parts where these are processed, else robots."""
    parts = period.station_parts
    return (parts, "parts") if parts else (period.station_queues, "robots")


def others(resource: str, period: Period, robots: int) -> list[str]:
    """How the other resources were used in a period."""
    texts = []
    if resource != "robots":
        texts += facts("robots", period, robots)
    if period.stations and not resource.startswith("station"):
        mean = sum(period.stations) / len(period.stations)
        texts.append(f"stations {percent(mean, 0)} busy")
    if resource != "traffic":
        texts += [fact for fact in facts("traffic", period, robots) if period.on_orders]
    if period.chargers and resource != "chargers":
        texts.append(f"chargers {percent(period.charger_share, 0)} busy")
    return texts


def rate_fall(resolved: Resolved, periods: Sequence[Period], bottleneck: Bottleneck) -> str:
    """How the flow fell as a resource came to be saturated, if it did."""
    if not bottleneck.first:
        return ""
    stretch = joined(periods[bottleneck.first : bottleneck.last + 1])
    before, during = rate(resolved, periods[bottleneck.first - 1]), rate(resolved, stretch)
    if during > (1 - FALL) * before:
        return ""
    values = f"from {number(round(before))} to {number(round(during))}"
    return f"{flow_name(resolved)} fell {values} {rate_unit(resolved)}"


def flow_name(resolved: Resolved) -> str:
    """What a period counts as done."""
    return "lines" if resolved.scenario.orders.lines is not None else "orders"


def rate(resolved: Resolved, period: Period) -> float:
    """What is done in a period, in an hour; in 1,000 ticks where a tick is not a time."""
    seconds = units_of(resolved)[0].seconds
    ticks = 1000 if seconds is None else HOUR_S / seconds
    return period.done / max(period.ticks, 1) * ticks


def rate_unit(resolved: Resolved) -> str:
    """The unit of `rate`."""
    return "in 1,000 ticks" if units_of(resolved)[0].seconds is None else "an hour"
