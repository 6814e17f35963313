"""The parameters of zoning from which a world is built, also of plug-ins and recordings."""

from __future__ import annotations

import msgspec
import pytest

from automaton.strategy.api import InputError, Strategy
from automaton.strategy.lookup import (
    AsRecorded,
    NoParameters,
    ZoningParameters,
    zoning_parameters_of,
)
from automaton.world.resolve import resolve


class Grouped(ZoningParameters, forbid_unknown_fields=True, frozen=True, kw_only=True):
    """Parameters of a plug-in that extends the base."""

    eagerness: int = 3


class Alone(msgspec.Struct, frozen=True):
    """Parameters of a plug-in that has one of the base's for itself."""

    groups: int = 6


class Extends(Strategy):
    """Zoning that decides nothing."""

    layer = "zoning"
    Parameters = Grouped

    def decide(self, view, batch, decisions, memory, workspace):
        """Leaves all zones as they are."""


class Ignores(Extends):
    """Zoning with parameters that would be ignored."""

    Parameters = Alone


def test_shipped_strategies_and_plug_ins_say_what_a_world_is_built_from() -> None:
    chosen = "strategy.zoning={name: annealing, groups: 5}"
    assert resolve("tabletop-mini", [chosen]).zoning.groups == 5
    assert resolve("tabletop-mini").zoning == ZoningParameters()
    chosen = f"strategy.zoning={{name: '{__name__}:Extends', groups: 7}}"
    assert resolve("tabletop-mini", [chosen]).zoning.groups == 7
    assert zoning_parameters_of(NoParameters()) == ZoningParameters()


def test_a_recording_says_it_without_the_plug_in() -> None:
    recorded = AsRecorded({"groups": 7, "eagerness": 4})
    assert zoning_parameters_of(recorded) == ZoningParameters(groups=7)


def test_a_parameter_that_would_be_ignored_is_refused() -> None:
    said = "Alone has the parameter groups, so it must extend .*ZoningParameters"
    with pytest.raises(InputError, match=said):
        resolve("tabletop-mini", [f"strategy.zoning={__name__}:Ignores"])
