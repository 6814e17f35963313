"""The parameters of zoning from which a world is built, whatever the strategy."""

from __future__ import annotations

from typing import Annotated, Any

import msgspec
from msgspec import Meta

from automaton.errors import InputError
from automaton.strategy.entry import AsRecorded


class ZoningParameters(msgspec.Struct, forbid_unknown_fields=True, frozen=True, kw_only=True):
    """Where zones begin; the parameters of each zoning strategy that has any of these extend it."""

    design: Annotated[
        str | dict[str, Any] | None,
        Meta(
            description="The zones at the start: the name of a shipped design, a file, or "
            "{zones: [...]}; left out: simulated annealing on the flow between all stations"
        ),
    ] = None
    groups: Annotated[
        int,
        Meta(
            ge=2,
            le=500,
            description="groups of slots that count as stations on a floor without any",
        ),
    ] = 18
    priority: Annotated[
        dict[str, tuple[int, ...]],
        Meta(
            description="{TYPE: [stations]}: where robots of a type come first: zones are made so, and "
            "no exchange takes such a station from them for another type"
        ),
    ] = {}


def zoning_parameters_of(parameters: msgspec.Struct) -> ZoningParameters:
    """What the parameters of a zoning strategy say of the world, or the defaults.

    Raises InputError where a struct has such a parameter of its own: it would be ignored.
    """
    if isinstance(parameters, ZoningParameters):
        return parameters
    names = ZoningParameters.__struct_fields__
    if isinstance(parameters, AsRecorded):
        said = {name: parameters.values[name] for name in names if name in parameters.values}
        return msgspec.convert(said, ZoningParameters)
    for name in names:
        if hasattr(parameters, name):
            raise InputError(
                f"strategy.zoning: {type(parameters).__name__} has the parameter {name}, so it must "
                "extend automaton.strategy.zone_parameters.ZoningParameters"
            )
    return ZoningParameters()
