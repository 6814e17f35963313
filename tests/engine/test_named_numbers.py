"""Numbers that kernels write: attributes of a struct, alone or several in one array."""

from __future__ import annotations

import pickle
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from numba.core.errors import NumbaError

from automaton.engine.jit.kernel import jit_is_on, kernel
from automaton.engine.jit.structs import SCRATCH, Array, NamedNumbers, Struct, field, number


class Meter(NamedNumbers):
    turns: int = number("turns so far")
    litres: int = number("what has flowed")


class Pump(Struct):
    meter: Meter = field(Meter)
    level: float = field("() float64", "metres", default=2)
    strokes: int = field("() int64", "strokes so far", role=SCRATCH)
    is_on: int = field("() uint8", "1 = it runs")
    valves: Array = field("(n,) int32")


@kernel(cached=False)
def pump_water(pump, litres):
    meter = pump.meter
    meter.turns += 1
    meter.litres += litres
    pump.level -= 0.5
    pump.strokes = meter.turns * 10
    pump.is_on = 1
    return meter.litres


@kernel(cached=False)
def write_meter(pump):
    pump.meter.turns = 7


@kernel(cached=False)
def write_strokes(pump):
    pump.strokes = 7


@kernel(cached=False)
def turn(meter):
    meter.turns += 1


def readings(pump: Pump) -> tuple[Any, ...]:
    return pump.meter.tolist(), pump.level, pump.strokes, pump.is_on


@pytest.mark.parametrize("compiled", [True, False])
def test_kernels_and_python_write_the_same_numbers(compiled: bool) -> None:
    function = pump_water if compiled or not jit_is_on() else pump_water.py_func
    pump = Pump.sized({"n": 2})
    assert readings(pump) == ([0, 0], 2.0, 0, 0)
    assert function(pump, 3) == 3
    pump.meter.litres += 4
    pump.level = 1
    assert function(pump, 1) == 8
    assert readings(pump) == ([2, 8], 0.5, 20, 1)


def test_numbers_alone_are_an_argument_of_kernels() -> None:
    meter = Meter.zeros()
    turn(meter)
    assert meter.turns == 1


def test_numbers_may_be_given() -> None:
    pump = Pump.sized({"n": 2}, meter=np.array([5, 6]), strokes=9)
    assert (pump.meter.turns, pump.meter.litres, pump.strokes) == (5, 6, 9)
    with pytest.raises(TypeError, match=r"Pump.meter is \(3,\), where 2 is 2"):
        Pump.sized({"n": 2}, meter=np.zeros(3, np.int64))


@pytest.mark.parametrize("write", [write_meter, write_strokes])
def test_what_strategies_see_is_closed(write: Callable[[Pump], None]) -> None:
    pump = Pump.sized({"n": 2})
    view = pump.read_only()
    pump.strokes, pump.meter.turns = 4, 5
    assert (view.strokes, view.meter.turns) == (4, 5)
    with pytest.raises(NumbaError if jit_is_on() else ValueError, match="read-only"):
        write(view)
    with pytest.raises(ValueError, match="read-only"):
        view.meter.turns = 1
    with pytest.raises(ValueError, match="read-only"):
        view.strokes = 1
    write(pump.writable_view())
    assert 7 in (pump.strokes, pump.meter.turns)


def test_a_copy_has_numbers_of_its_own_and_a_replaced_struct_shares_them() -> None:
    pump = Pump.sized({"n": 2})
    pump_water(pump, 3)
    copy, shared = pump.copied(), pump.replaced(valves=np.zeros(5, np.int32))
    assert readings(copy) == ([1, 3], 1.5, 0, 1), "scratch is not copied"
    pump_water(pump, 3)
    assert readings(copy)[0] == [1, 3] and readings(shared) == readings(pump)
    assert {name for name, *_ in pump.arrays()} == {*pump._fields}


def test_numbers_are_copied_and_pickled_with_their_names() -> None:
    meter = Meter.zeros()
    meter.litres = 3
    assert meter.copy().litres == pickle.loads(pickle.dumps(meter)).litres == 3


def test_a_name_that_arrays_have_is_refused() -> None:
    with pytest.raises(TypeError, match=r"Sizes\.size: arrays have an attribute of this name"):
        type("Sizes", (NamedNumbers,), {"__annotations__": {"size": int}, "size": number("of it")})
