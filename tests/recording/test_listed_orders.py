"""Long lists of orders are stored as columns, and come back as they were."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import msgspec
import numpy as np
import pytest

from automaton.recording.contents import FRAME_KIND_CONDITIONS, InvalidFrameError
from automaton.recording.frames import MIN_PACKED, decode, pack_listed, payload_of, unpack_listed
from automaton.scenario.order_lines import plain_data
from automaton.scenario.orders import Line, OrderLine, Orders
from automaton.scenario.quantities import DueAt
from automaton.scenario.schema import Fleet, Scenario


def conditions(lines: list[OrderLine]) -> dict[str, Any]:
    orders = Orders(listed=tuple(lines))
    scenario = Scenario(name="long", layout={}, fleet=Fleet(robots=1), orders=orders)
    arrays = {
        name: np.zeros(1, np.int32) for name in ("period", "wait", "steered", "watches_chargers")
    }
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


def lines(count: int) -> list[Line]:
    return [
        Line(
            pod=1 + k % 9,
            station=(None, "P1", 2)[k % 3],
            order=None if k % 5 == 0 else f"order {k // 2}",
            release=k,
            due=(None, 20, DueAt(at=7 * k))[k % 3],
            priority=k % 4,
            units=k % 3,
        )
        for k in range(count)
    ]


def with_lines(given: Sequence[Line]) -> dict[str, Any]:
    orders = Orders(lines=given)  # type: ignore[arg-type]
    content = conditions(transports(1))
    scenario = Scenario(name="long", layout={}, fleet=Fleet(robots=1), orders=orders)
    return {**content, "scenario": plain_data(scenario)}


def test_long_lists_of_lines_are_columns_and_come_back_as_they_were() -> None:
    content = with_lines(tuple(lines(MIN_PACKED)))
    stored = pack_listed(content)
    assert stored["scenario"]["orders"]["lines"] is None
    assert stored["line_names"]["station"] == ["P1", 2]
    payload = payload_of(FRAME_KIND_CONDITIONS, content)
    again = decode(FRAME_KIND_CONDITIONS, payload.data)
    assert not {"listed_lines", "line_names"} & set(again)
    assert msgspec.convert(again["scenario"], Scenario) == msgspec.convert(
        content["scenario"], Scenario
    )
    assert pack_listed(with_lines(tuple(lines(MIN_PACKED - 1)))).keys() == content.keys()


def test_orders_due_at_a_tick_are_columns_too() -> None:
    listed = [msgspec.structs.replace(one, due=DueAt(at=9)) for one in transports(MIN_PACKED)]
    content = conditions(listed)
    payload = payload_of(FRAME_KIND_CONDITIONS, content)
    assert pack_listed(content)["listed"]["due at"].tolist() == [9] * MIN_PACKED
    assert decode(FRAME_KIND_CONDITIONS, payload.data)["scenario"] == msgspec.msgpack.decode(
        msgspec.msgpack.encode(content["scenario"])
    )


def test_lines_that_name_what_is_not_told_are_refused() -> None:
    stored = pack_listed(with_lines(tuple(lines(MIN_PACKED))))
    stored["line_names"]["order"] = []
    with pytest.raises(InvalidFrameError, match="its lines contain an unnamed order"):
        unpack_listed(stored)


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
    with pytest.raises(InvalidFrameError, match="its table of orders is not valid"):
        unpack_listed({**conditions(transports(3)), "listed": columns})
