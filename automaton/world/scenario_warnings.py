"""The warnings of `check` about scenarios that `resolve` accepts: misfits and probable mistakes."""

from __future__ import annotations

import math
import os
from collections.abc import Iterator
from typing import TYPE_CHECKING, Final, NamedTuple

import numpy as np

from automaton.errors import Finding, InputError, Keys, alternatives
from automaton.floor.floor_plan import CHARGER, SHELF, STATION, UNLIMITED, WEIGHT_UNIT
from automaton.floor.reachability import dead_ends_of, steps_from
from automaton.scenario.arrivals import Mean, MeanTime
from automaton.scenario.order_lines import has_due_times, line_column, listed_lines, transports_of
from automaton.strategy.lookup import (
    ADMITS_ONE,
    AVOIDS_TRAFFIC,
    KEEPS_WAY_BACK,
    STEERS,
    declares,
    files_of,
    is_built_in,
)
from automaton.units import SECONDS_PER_UNIT, count, ticks_and_time, unit
from automaton.world.conversion_table import coarse_conversions
from automaton.world.fleet_warnings import (
    MOST_NAMED,
    fleet_warnings,
    gate_warnings,
    pod_warnings,
    size_warnings,
    standstill_warnings,
)
from automaton.world.floor_parts import places_of_chargers, service_cells
from automaton.world.resolved import Resolved

if TYPE_CHECKING:
    from automaton.engine.state import Array, Grid

NO_STRATEGY: Final = "none"
CHEAPER: Final = 1.25  # the factor from which the viewer draws a street
FAR_FROM_1: Final = 4  # factor of a mean weight from 1 that is likely a mistake
MOST_STATIONS: Final = 100  # stations between which all ways are measured


def misfits(resolved: Resolved) -> Iterator[Finding]:
    """Missing or unusable files of strategies, and a zone design that the fleet cannot serve."""
    for layer, choice in resolved.choices:
        keys: Keys = ("strategy", layer)
        for file in files_of(choice.parameters):
            if not os.path.isfile(file):
                yield Finding(keys, f"strategy.{layer}: there is no file {file}")
        check = getattr(choice.parameters, "check_files", None)
        try:
            if check is not None:
                check(lambda: grid_and_durations(resolved))
        except InputError as error:
            yield Finding(keys, f"strategy.{layer}: {error}")
    if resolved.zoning.design is not None:
        # Needs Numba, unlike most checks.
        from automaton.world.building import ZoneDesignError, build_world

        try:
            build_world(resolved, resolved.scenario.seed)
        except ZoneDesignError as error:
            yield Finding(("strategy", "zoning"), f"strategy.zoning: {error.message}")


def grid_and_durations(resolved: Resolved) -> tuple[Grid, Array]:
    """Return the grid, and the (A,) ticks of each action of the first type."""
    from automaton.world.prepared_floor import floor_for  # needs Numba, unlike most checks
    from automaton.world.rules import rules_for

    scenario, types = resolved.scenario, resolved.fleet.types
    grid = floor_for(resolved.floor_plan, scenario.world.traffic_zones, types).grid
    return grid, rules_for(scenario, scenario.seed).duration[0]


def scenario_warnings(resolved: Resolved) -> list[str]:
    """Return a sentence for each warning."""
    found = (
        nothing_to_avoid(resolved),
        parks_on_charger(resolved),
        out_of_range(resolved),
        never_charges(resolved),
        stays_on_station(resolved),
        resolved.fleet.handed_over(),
        counts_as_seconds(resolved),
        short_rows(resolved),
        nothing_to_carry(resolved),
    )
    sentences = [sentence for sentence in found if sentence]
    return [
        *sentences,
        *(() if resolved.order_file is None else resolved.order_file.warnings),
        *due_warnings(resolved),
        *late_releases(resolved),
        *coarse_conversions(resolved),
        *size_warnings(resolved),
        *fleet_warnings(resolved),
        *standstill_warnings(resolved),
        *pod_warnings(resolved),
        *gate_warnings(resolved),
        *street_warnings(resolved),
    ]


def street_warnings(resolved: Resolved) -> list[str]:
    """Warnings about weights of streets that no strategy reads, or that make turns nearly free."""
    floor_plan, choices = resolved.floor_plan, resolved.strategies
    into = [text for text in (leads_into_dead_end(resolved),) if text]
    if not len(floor_plan.move_weights):
        return into
    row, routing = choices["right_of_way"], choices["routing"]
    # A plug-in that steers may not read weights.
    steers = is_built_in("right_of_way", row.name) and declares("right_of_way", row.name, STEERS)
    warnings = []
    if not steers and not is_built_in("routing", routing.name):
        warnings.append(
            f"streets has weights, but strategy.routing {routing.name} may not read them; pibt, epibt "
            "and the shipped routings do"
        )
    if not steers and (floor_plan.wait_weights != WEIGHT_UNIT).any():
        warnings.append(
            f"streets has weights of waiting, but strategy.right_of_way is {row.name}; only pibt and "
            "epibt read them"
        )
    exits = (floor_plan.exits.reshape(-1)[:, None] >> np.arange(4)) & 1 > 0
    mean = float(f"{floor_plan.move_weights[exits].mean() / WEIGHT_UNIT:.3g}")
    turns = any(ticks for one in resolved.fleet.types for ticks in one.turns)
    if turns and mean > FAR_FROM_1:
        warnings.append(
            f"the mean weight of streets is {mean:,g}, so turns are nearly free; divide the weights, or "
            "set scale: mean for a file or a preset"
        )
    elif turns and mean < 1 / FAR_FROM_1:
        warnings.append(
            f"the mean weight of streets is {mean:g}, so turns are very expensive; divide the weights, "
            "or set scale: mean for a file or a preset"
        )
    return warnings + into


def leads_into_dead_end(resolved: Resolved) -> str:
    """Warn about streets whose cheaper or only direction leads into a dead end that admits one robot.

    Presets lay streets everywhere, so they lead into some of the dead ends of most floors.
    """
    floor_plan, streets = resolved.floor_plan, resolved.scenario.streets
    rule = resolved.strategies["right_of_way"].name
    is_preset = getattr(streets, "preset", None) is not None
    is_alone = resolved.scenario.fleet.robots < 2
    if not streets or is_preset or is_alone or not declares("right_of_way", rule, ADMITS_ONE):
        return ""
    ends, weights = dead_ends_of(floor_plan), floor_plan.move_weights
    entries = []
    for inside in np.flatnonzero(ends.depth == 1).tolist():
        out = int(ends.way_out[inside])
        before = inside + floor_plan.offsets[out]
        is_closed = not floor_plan.exits.flat[inside] >> out & 1
        ways = (weights[before, out ^ 2], weights[inside, out]) if len(weights) else (1, 1)
        if is_closed or ways[1] >= CHEAPER * ways[0]:
            entries.append(f"{list(floor_plan.xy(before))} to {list(floor_plan.xy(inside))}")
    if not entries:
        return ""
    more = f" and {len(entries) - MOST_NAMED} more" if len(entries) > MOST_NAMED else ""
    return (
        f"streets lead into dead ends ({', '.join(entries[:MOST_NAMED])}{more}): with {rule} a dead end "
        "admits one robot with a goal in it at a time, which comes out against the street; let the move "
        "out cost no more than the move in"
    )


def nothing_to_avoid(resolved: Resolved) -> str:
    """Warn about traffic avoidance if no robot slows another."""
    world, routing = resolved.scenario.world, resolved.strategies["routing"].name
    floor_plan = resolved.floor_plan
    crowds = bool((floor_plan.capacity[floor_plan.drivable] == UNLIMITED).all())
    if declares("routing", routing, AVOIDS_TRAFFIC) and crowds and world.slowdown == "none":
        return (
            f"routing {routing} finds no traffic to avoid: every cell holds any number of robots "
            "and world.slowdown is none, so no robot slows another; set world.slowdown: zones"
        )
    return ""


def parks_on_charger(resolved: Resolved) -> str:
    """Warn about robots that begin, and so park, on a charger that other robots need."""
    scenario, floor_plan, start = resolved.scenario, resolved.floor_plan, resolved.start
    robots, places = scenario.fleet.robots, sum(places_of_chargers(scenario, floor_plan).values())
    if resolved.strategies["charging"].name == NO_STRATEGY or not isinstance(start, tuple):
        return ""
    if scenario.fleet.when_idle != "park" or places >= robots:
        return ""
    for robot, cell in enumerate(start):
        if floor_plan.kind.flat[cell] == CHARGER:
            x, y = floor_plan.xy(cell)
            return (
                f"robot {robot} begins at [{x}, {y}] and therefore parks there, on a charger that "
                f"other robots need: {robots} robots share {places}; start it next to the charger"
            )
    return ""


def out_of_range(resolved: Resolved) -> str:
    """Warn about an order that needs more than a full battery, from a charger and back to one.

    Counts the charge above the reserve, and moves only: turns and handling need more.
    """
    scenario, floor_plan, choice = (
        resolved.scenario,
        resolved.floor_plan,
        resolved.strategies["charging"],
    )
    battery = scenario.battery
    if battery is None or not declares("charging", choice.name, KEEPS_WAY_BACK):
        return ""
    pairs = station_pairs(resolved)
    if not pairs or not getattr(choice.parameters, "never_strand", True):
        return ""
    chargers = np.flatnonzero(floor_plan.kind == CHARGER).tolist()
    there, back = steps_from(floor_plan, chargers), steps_from(floor_plan, chargers, backwards=True)
    batteries = [one.battery for one in resolved.fleet.types if one.battery is not None]
    move = min(one.drain.move for one in batteries) * resolved.fleet.least_move
    dearest, way = 0.0, pairs[0]
    for source in dict.fromkeys(source for source, _ in pairs):
        ahead = steps_from(floor_plan, [source])
        for target in (target for begin, target in pairs if begin == source):
            empty, loaded = int(there[source] + back[target]), int(ahead[target])
            cost = move * (empty + min(one.drain.loaded_factor for one in batteries) * loaded)
            if cost > dearest:
                dearest, way = cost, (source, target)
    least = 100 - min(one.reserve for one in batteries)
    if dearest <= least:
        return ""
    (x, y), (to_x, to_y) = (floor_plan.xy(cell) for cell in way)
    return (
        f"an order from [{x}, {y}] to [{to_x}, {to_y}] takes {dearest:g} % of a battery, from a "
        "charger "
        f"and back to one, but only {least:g} % are above the reserve: robots that leave a "
        "charger will never take it"
    )


def station_pairs(resolved: Resolved) -> list[tuple[int, int]]:
    """Flat cells of stations that orders may connect."""
    orders, floor_plan = resolved.scenario.orders, resolved.floor_plan
    stations = np.flatnonzero(floor_plan.kind == STATION).tolist()
    if orders.listed is not None:
        ends = [
            (floor_plan.cell(*line.ends[0]), floor_plan.cell(*line.ends[1]))
            for _, line in transports_of(resolved.scenario, floor_plan)
        ]
        return [pair for pair in ends[:MOST_STATIONS] if set(pair) <= set(stations)]
    if len(stations) > MOST_STATIONS:
        return []
    if orders.generator == "visits":
        return [(cell, cell) for cell in stations]
    if orders.generator == "stations":
        return [(a, b) for a in stations for b in stations if a != b]
    return []


def never_charges(resolved: Resolved) -> str:
    """Warn about batteries and chargers without a charging strategy."""
    chargers = int(np.count_nonzero(resolved.floor_plan.kind == CHARGER))
    none = resolved.strategies["charging"].name == NO_STRATEGY
    if resolved.scenario.battery is None or not chargers or not none:
        return ""
    return (
        f"robots have batteries and the floor has {count(chargers, 'charger')}, but strategy.charging "
        "is none, so no robot will charge; set strategy.charging to insertion, fill-up, "
        "threshold or opportunity"
    )


def stays_on_station(resolved: Resolved) -> str:
    """Warn about idle robots that block a station for ever."""
    scenario, floor_plan, start = resolved.scenario, resolved.floor_plan, resolved.start
    right_of_way = resolved.strategies["right_of_way"]
    gives_way = declares("right_of_way", right_of_way.name, STEERS)
    settled = not (gives_way or getattr(right_of_way.parameters, "idle_give_way", False))
    used = {cell for cell in served_stations(resolved) if floor_plan.capacity.flat[cell] == 1}
    if not settled or not used or scenario.fleet.robots < 2:
        return ""
    if resolved.may_stay:
        who = "robots without an order stay where they dropped the last one (idle: stay)"
    elif scenario.fleet.when_idle != "park" or start in ("parking-bays", "racks"):
        return ""
    elif start == "random":
        drivable = floor_plan.drivable.reshape(-1)
        free = int((drivable & ~service_cells(scenario, floor_plan)).sum())
        if scenario.fleet.robots <= free:
            return ""
        who = f"only {free:,} cells are not stations, so robots begin and park on stations too"
    else:
        begun = [robot for robot, cell in enumerate(start) if cell in used]
        if not begun:
            return ""
        who = f"robot {begun[0]} begins on a station and therefore parks there"
    return (
        f"{who}, but a station holds one robot: other robots may wait for it forever; set "
        "right_of_way: {name: retreat, idle_give_way: true}, or give robots parking cells of "
        "their own with fleet.start or parking bays"
    )


def served_stations(resolved: Resolved) -> set[int]:
    """Flat cells of stations where orders begin or end."""
    orders, floor_plan = resolved.scenario.orders, resolved.floor_plan
    stations = floor_plan.stations.tolist()
    if orders.parts is not None:
        return {stations[number - 1] for kind in orders.parts for number in kind.route}
    if orders.listed is not None:
        ends = {
            floor_plan.cell(*cell)
            for line in orders.listed
            for cell in (*line.stop_cells, line.source, line.target)
            if cell is not None
        }
        return ends & set(stations)
    return set(stations) if orders.generator in ("stations", "visits") else set()


def counts_as_seconds(resolved: Resolved) -> str:
    """Warn about zoning, whose parameters are times, if units.tick is not a time."""
    text = resolved.scenario.units.tick
    tick = unit(text)
    if resolved.strategies["zoning"].name == NO_STRATEGY or tick.seconds is not None:
        return ""
    if tick.name in ("tick", "ticks"):
        return ""
    return (
        f"units.tick is {text!r}, which is not a time, so zoning counts a tick as a second; use "
        f"{alternatives(SECONDS_PER_UNIT)}"
    )


def short_rows(resolved: Resolved) -> str:
    """Warn about rows of a picture that are shorter than others and end on a drivable cell."""
    rows = str(resolved.scenario.layout.get("picture", "")).rstrip().split("\n")
    width = max(map(len, rows))
    for number, row in enumerate(rows, 1):
        if row and len(row) < width and row[-1] not in "# ":
            return (
                f"row {number} of the picture ends with {row[-1]!r} after "
                f"{count(len(row), 'character')}, but other rows have {width:,}: the rest of the "
                "row is wall; write # there if this is intended"
            )
    return ""


def nothing_to_carry(resolved: Resolved) -> str:
    """Warn about a picture without loads if its loads are the orders."""
    orders, floor_plan = resolved.scenario.orders, resolved.floor_plan
    if orders.generator == "picture-loads" and not (floor_plan.loads == 1).any():
        return "there are no orders: orders are the loads drawn in the picture, and it has none"
    return ""


# Due times.


def due_warnings(resolved: Resolved) -> list[str]:
    """Return a sentence for each warning."""
    return [text for text in (due_too_early(resolved), nothing_due(resolved)) if text]


def due_too_early(resolved: Resolved) -> str:
    """Warn about orders that are due before they are released, as in some real files."""
    if resolved.days:
        return ""  # the reader warns about its rows
    orders = resolved.scenario.orders
    lines = listed_lines(orders)
    key, what = ("orders.lines", "line") if lines else ("orders.list", "order")
    times = [(one.due_tick, one.release) for one in orders.listed or ()]
    early = [
        number for number, (due, release) in enumerate(times) if due is not None and due < release
    ]
    early += np.flatnonzero(line_column(lines, "due") < line_column(lines, "release")).tolist()
    if not early:
        return ""
    if len(early) == 1:
        return f"{key}[{early[0]}] is due before it is released, and therefore late from the start"
    return (
        f"{count(len(early), what)} are due before they are released, and therefore late from the "
        f"start; the first is {key}[{early[0]}]"
    )


def nothing_due(resolved: Resolved) -> str:
    """Warn about an allocation by due times if no order has one."""
    ways = {getattr(choice.parameters, "by", None) for choice in resolved.allocations}
    if "due" not in ways or has_due_times(resolved.scenario.orders):
        return ""
    return (
        "strategy.allocation uses due times (by: due), but no order has one, so orders are served "
        "by release tick; set due in orders.list or in the file of orders"
    )


# Orders and parts that are released after the end of the run.


class Stream(NamedTuple):
    """A stream of orders or parts."""

    what: str  # "200 orders"
    first: int  # tick
    last: float  # tick; for random ones, the mean


def late_releases(resolved: Resolved) -> list[str]:
    """Return a sentence for each list or stream that continues after the end of the run.

    A stream may continue if the run does not end with its orders.
    """
    stop, tick = resolved.scenario.stop, unit(resolved.scenario.units.tick)
    end, ends_with_orders = stop.max_duration, stop.when != "never"
    over = f"when the run is over (stop.max_duration {ticks_and_time(end, tick)})"
    orders, lines = resolved.scenario.orders, listed_lines(resolved.scenario.orders)
    releases = [line.release for line in orders.listed or ()]
    if lines:
        releases = line_column(lines, "release").tolist()
    late = [release for release in releases if release >= end]
    if late:
        what = count(len(releases), "line" if lines else "order")
        which = f"{len(late):,} of {what} in the {'file' if resolved.days else 'list'}"
        comes = "comes" if len(late) == 1 else "come"
        unfinished = ", so it will not finish" if ends_with_orders else ""
        return [
            f"{which} {comes} after {ticks_and_time(min(late), tick)} or later, {over}{unfinished}"
        ]
    return [
        f"the last of {stream.what} comes after about {ticks_and_time(stream.last, tick)}, {over}"
        + (", so it may not finish" if ends_with_orders else "")
        for stream in streams(resolved)
        if stream.first >= end or (stream.last >= end and ends_with_orders)
    ]


def streams(resolved: Resolved) -> Iterator[Stream]:
    """The streams over time, without lists and closed loops."""
    orders = resolved.scenario.orders
    for kind in orders.parts or ():
        after = (kind.count - 1) * mean_of(kind.interarrival_time)
        what = count(kind.count, "part") + (f" {kind.name}" if kind.name else "")
        yield Stream(what, kind.first_release, kind.first_release + after)
    orders_count = generated_orders(resolved)
    if orders.mean_interarrival_time:
        last = (orders_count - 1) * orders.mean_interarrival_time
        yield Stream(count(orders_count, "order"), 0, last)
    if orders.arrivals is not None and orders.arrivals.bursts is not None:
        bursts = orders.arrivals.bursts
        many = math.ceil(orders_count / mean_of(bursts.size))
        yield Stream(count(orders_count, "order"), 0, (many - 1) * mean_of(bursts.every))


def generated_orders(resolved: Resolved) -> int:
    """The number of orders of a generator."""
    orders, floor_plan = resolved.scenario.orders, resolved.floor_plan
    if orders.generator == "picture-loads":
        return int(floor_plan.loads.sum())
    if orders.generator == "full-shelves":
        return int(np.count_nonzero(floor_plan.kind == SHELF))
    return orders.count or 0


def mean_of(number: int | Mean | MeanTime) -> float:
    """A given number, or the mean of a random one."""
    return number if isinstance(number, int) else number.mean
