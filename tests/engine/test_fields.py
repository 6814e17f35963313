"""Fields of structs are declared once: what follows from the declarations."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from automaton.engine.jit.fields import field
from automaton.engine.jit.structs import Struct
from automaton.engine.state import Array


class Load(Struct):
    weight: Array = field("(n,) int32", "of each load", default=7)
    place: Array = field("(n, 2) uint8")
    sides: Array = field("(4n,) int64", default=-1)
    limit: int = field("int64")


def loads(**changed: Any) -> dict[str, Any]:
    values = {
        "weight": np.zeros(3, np.int32),
        "place": np.zeros((3, 2), np.uint8),
        "sides": np.zeros(12, np.int64),
        "limit": 5,
    }
    return values | changed


@pytest.mark.parametrize(
    ("changed", "sentence"),
    [
        (
            {"weight": np.zeros(3, np.int64)},
            r"Load.weight is \(3,\) int64; it is declared as \(n,\) int32",
        ),
        (
            {"place": np.zeros(3, np.uint8)},
            r"Load.place is \(3,\) uint8; it is declared as \(n, 2\) uint8",
        ),
        ({"place": np.zeros((4, 2), np.uint8)}, r"Load.place is \(4, 2\), where n is 3"),
        ({"place": np.zeros((3, 3), np.uint8)}, r"Load.place is \(3, 3\), where 2 is 2"),
        ({"place": np.zeros((2, 3), np.uint8).T}, "Load.place is not contiguous"),
        ({"sides": np.zeros(3, np.int64)}, "Load: 4n is 3, where n is 3"),
        ({"weight": [1, 2, 3]}, "Load.weight is not an array"),
    ],
)
def test_arrays_are_as_declared(changed: dict[str, Any], sentence: str) -> None:
    assert Load(**loads()).limit == 5
    with pytest.raises(TypeError, match=sentence):
        Load(**loads(**changed))


def test_read_only_arrays_are_no_state() -> None:
    weight = np.zeros(3, np.int32)
    weight.setflags(write=False)
    with pytest.raises(TypeError, match=r"Load.weight is read-only"):
        Load(**loads(weight=weight))


def test_what_is_not_given_has_its_default() -> None:
    load = Load.sized(place=np.ones((2, 2), np.uint8), limit=1)
    assert load.weight.tolist() == [7, 7] and load.weight.dtype == np.int32
    assert load.sides.tolist() == [-1] * 8
    with pytest.raises(TypeError, match="Load needs n"):
        Load.sized(limit=1)
