"""What of a scenario may change while a run goes on."""

from __future__ import annotations

import copy
from dataclasses import replace

import msgspec

from automaton.build.feasibility import check_energy
from automaton.build.resolve import Resolved, choose_strategies, naming_files
from automaton.scenario.document import Document
from automaton.scenario.overrides import override
from automaton.scenario.schema import Scenario
from automaton.scenario.validation import validated

CHANGEABLE = ("strategy", "durations", "information", "world", "stop")


def branched(resolved: Resolved, settings: tuple[str, ...]) -> Resolved:
    """The scenario with KEY=VALUE settings changed in the middle of a run.

    Floor, fleet, orders and seed are what the run began with. Raises InputError.
    """
    document = override(
        Document(data=copy.deepcopy(msgspec.to_builtins(resolved.scenario))), settings
    )
    scenario = validated(document, document.data, Scenario)
    for name in Scenario.__struct_fields__:
        if name not in CHANGEABLE and getattr(scenario, name) != getattr(resolved.scenario, name):
            can = ", ".join(CHANGEABLE)
            raise document.error(
                (name,), f"{name} cannot change while a run goes on; what can: {can}"
            )
    check_energy(document, scenario, resolved.floor_plan)
    strategies = choose_strategies(document, scenario, resolved.floor_plan)
    return replace(resolved, scenario=naming_files(scenario, strategies), strategies=strategies)
