"""Long lists of orders are stored as columns, and come back as they were."""

from __future__ import annotations

from typing import Any

import msgspec
import numpy as np
import pytest

from automaton.evidence.recording.contents import FRAME_KIND_CONDITIONS, InvalidFrameError
from automaton.evidence.recording.frames import decode, payload_of
from automaton.evidence.recording.listed_orders import MIN_PACKED, pack_listed, unpack_listed
from automaton.scenario.orders import OrderLine, Orders
from automaton.scenario.schema import Fleet, Scenario


def conditions(lines: list[OrderLine]) -> dict[str, Any]:
    orders = Orders(listed=tuple(lines))
    scenario = Scenario(name="long", layout={}, fleet=Fleet(robots=1), orders=orders)
    arrays = {name: np.zeros(1, np.int32) for name in ("period", "wait", "steered")}
    return {
        "tick": 0,
        "settings": (),
        "scenario": msgspec.to_builtins(scenario),
        "strategies": {},
        **arrays,
    }


def transports(count: int) -> list[OrderLine]:
    return [
        OrderLine(
            source=(k % 7, 1),
            target=(3, 2 + k % 5),
            release=9 * k,
            weight=1 + k % 3,
            priority=-(k % 9),
        )
        for k in range(count)
    ]


def test_a_long_list_is_stored_as_columns() -> None:
    content = conditions(transports(MIN_PACKED))
    stored = pack_listed(content)
    assert stored["scenario"]["orders"]["list"] is None
    assert stored["listed"]["from"].shape == (MIN_PACKED, 2)
    payload = payload_of(FRAME_KIND_CONDITIONS, content)
    again = decode(FRAME_KIND_CONDITIONS, payload.data)
    assert "listed" not in again
    assert msgspec.convert(again["scenario"], Scenario) == msgspec.convert(
        content["scenario"], Scenario
    )


@pytest.mark.parametrize(
    "lines",
    [
        transports(MIN_PACKED - 1),
        [*transports(MIN_PACKED), OrderLine(stops=((1, 1),))],
        [*transports(MIN_PACKED), OrderLine(source=(0, 0), target=(1, 0), stops=((1, 1),))],
    ],
    ids=["short", "tour", "stops"],
)
def test_other_lists_stay_as_they_are(lines: list[OrderLine]) -> None:
    content = conditions(lines)
    assert pack_listed(content) is content


@pytest.mark.parametrize(
    "columns",
    [
        {"from": np.zeros((3, 2), np.int32), "release": np.zeros(2, np.int32)},
        {"from": np.zeros(3, np.int32)},
        {"release": np.zeros((3, 2), np.int32)},
        {},
    ],
)
def test_columns_that_are_not_a_table_are_refused(columns: dict[str, Any]) -> None:
    with pytest.raises(InvalidFrameError, match="not a table"):
        unpack_listed({**conditions(transports(3)), "listed": columns})
