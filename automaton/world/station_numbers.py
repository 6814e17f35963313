"""The numbers and the names of the stations to which pods are carried."""

from __future__ import annotations

from automaton.floor.floor_plan import FloorPlan
from automaton.scenario.carried_pods import carries_pods
from automaton.scenario.schema import Scenario
from automaton.world.resolve import Resolved


def station_numbers(scenario: Scenario, floor_plan: FloorPlan) -> dict[str, int]:
    """The number of each station, from 0, by its name and by its number from 1 as text."""
    cells = floor_plan.stations.tolist()
    numbers = {str(k + 1): k for k in range(len(cells))}
    named = {
        name: cells.index(floor_plan.cell(*station.at))
        for name, station in scenario.stations.items()
    }
    return numbers | named


def station_names(resolved: Resolved) -> tuple[str, ...]:
    """The name of each station, its number from 1 where it has none; () without pods."""
    scenario, floor_plan = resolved.scenario, resolved.floor_plan
    if not carries_pods(scenario, floor_plan):
        return ()
    return all_station_names(scenario, floor_plan)


def all_station_names(scenario: Scenario, floor_plan: FloorPlan) -> tuple[str, ...]:
    """The name of each station, with pods or without; its number from 1 where it has none."""
    names = [str(k + 1) for k in range(len(floor_plan.stations))]
    for name, number in station_numbers(scenario, floor_plan).items():
        if name in scenario.stations:
            names[number] = name
    return tuple(names)
