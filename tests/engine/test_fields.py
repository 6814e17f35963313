"""Fields of structs are declared once: what follows from the declarations."""

from __future__ import annotations

from collections.abc import Iterator
from functools import cache
from operator import attrgetter
from typing import Any

import numpy as np
import pytest

from automaton.engine import digest
from automaton.engine.digest import DIGEST_NAMES
from automaton.engine.facilities import ServiceZones, Stations
from automaton.engine.jit.field_kernels import (
    digest_names,
    digested_fields,
    digesting,
    hiding,
    showing,
)
from automaton.engine.jit.structs import (
    BY_ENTRY,
    CARRIED,
    CONSTANT,
    SCRATCH,
    STATE,
    STATIC,
    VISIBLE,
    Field,
    Struct,
    field,
)
from automaton.engine.observation import Observation
from automaton.engine.state import Array, Orders, Robots, Tally, World
from automaton.history.playback import Keyframes
from automaton.history.snapshot import by_robot
from automaton.runs.pictures.picture_lines import read_robot, robot_line
from automaton.runs.simulation import Simulation
from automaton.runs.state_copy import take_over
from automaton.world.resolve import resolve


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
        ({"limit": 2.7}, r"Load.limit is 2.7; it is declared as int64"),
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
    with pytest.raises(TypeError, match=r"Load.weight needs n"):
        Load.sized(limit=1)


@pytest.mark.parametrize("n", [0, 1, 9, 40_000])  # the last is more than is copied as a whole
def test_arrays_that_are_not_given_lie_apart_and_have_their_defaults(n: int) -> None:
    load, other = Load.sized({"n": n}), Load.sized({"n": n})
    for made in (load, other):
        assert (made.weight == 7).all() and made.weight.shape == (n,)
        assert not made.place.any() and made.place.shape == (n, 2)
        assert (made.sides == -1).all() and made.sides.shape == (4 * n,)
        assert made.sides is made.sides
    load.weight[:], load.place[:], load.sides[:] = 1, 2, 3
    assert (load.weight == 1).all() and (load.place == 2).all() and (load.sides == 3).all()
    assert (other.weight == 7).all() and not other.place.any() and (other.sides == -1).all()
    assert [name for name, *_ in load.arrays()] == ["weight", "place", "sides"]


def test_an_array_is_made_when_somebody_looks() -> None:
    face = Load.sized({"n": 2}).read_only()
    assert "weight" not in vars(face)
    assert face.weight.tolist() == [7, 7]
    with pytest.raises(ValueError, match="read-only"):
        face.weight[0] = 1


class Table(Struct):
    ways: Array = field("(n,) int32", role=CONSTANT)
    marks: Array = field("(n,) int32", default=-1)


class Search(Struct, role=SCRATCH):
    table: Table
    heap: Array = field("(n,) int32")


class Found(Struct):
    search: Search
    answer: Array = field("(n,) int32")


def test_a_copy_has_its_own_scratch_and_the_same_constants() -> None:
    ways, four = np.arange(4, dtype=np.int32), np.full(4, 4, np.int32)
    table = Table(ways=ways, marks=four.copy())
    found = Found(search=Search(table=table, heap=four.copy()), answer=four.copy())
    copy = found.copied()
    assert copy.answer.tolist() == [4] * 4 and copy.search.heap.tolist() == [0] * 4
    assert copy.search.table.ways.tolist() == [0, 1, 2, 3]
    assert copy.search.table.marks.tolist() == [-1] * 4
    assert {name for name, *_ in found.arrays()} == {"search.heap", "search.table.ways", "answer"}


# The proof: one more field of robots, declared and nothing else, is everywhere.


class MoreRobots(Robots):
    mood: Array = field("(n,) int16", "how it feels", digest=len(DIGEST_NAMES))


class MoreWorld(World):
    robots: MoreRobots


def with_moods(*settings: str, **options: Any) -> Simulation:
    """A simulation whose robots have moods."""
    made = Simulation(resolve("tabletop-mini", ("fleet.robots=4", *settings)), **options)
    n = len(made.world.robots.cell)
    for name in ("world", "visible_world"):
        world = getattr(made, name)
        parts = {part: getattr(world, part) for part in world._fields}
        robots = {field: getattr(world.robots, field) for field in world.robots._fields}
        parts["robots"] = MoreRobots.sized({"n": n}, **robots)
        setattr(made, name, MoreWorld(**parts))
    made.world.robots.mood[:] = np.arange(5, 5 + n)
    return made


def python(kernel: Any) -> Any:
    """A kernel as Python: nothing is compiled for one test."""
    return getattr(kernel, "py_func", kernel)


def test_one_more_field_is_in_the_digest() -> None:
    names = digest_names(MoreWorld)
    assert names == (*DIGEST_NAMES, "robots.mood")
    before, after = moods_digest(0), moods_digest(1)
    assert np.flatnonzero(before != after).tolist() == [len(DIGEST_NAMES)]


def moods_digest(more: int) -> Any:
    run = with_moods()
    run.world.robots.mood[2] += more
    out = np.zeros(len(DIGEST_NAMES) + 1, np.uint64)
    with np.errstate(over="ignore"):
        python(digesting(MoreWorld, *plain_digest()))(run.world, out)
    return out


def plain_digest() -> tuple[Any, list[Any]]:
    return python(digest.add_value), [python(value) for value in digest.VALUES]


def test_one_more_field_is_hidden_and_shown() -> None:
    run = with_moods("information.radius=1")
    robots, seen = run.world.robots, run.visible_world.robots
    python(showing(MoreRobots, "n"))(seen, robots, 1)
    assert seen.mood.tolist() == [0, 6, 0, 0]
    python(hiding(MoreRobots, "n"))(seen, 1)
    assert seen.mood.tolist() == [0, 0, 0, 0]


def test_one_more_field_is_kept_in_memory_and_carried_to_a_branch() -> None:
    run, branch = with_moods(), with_moods()
    kept = Keyframes(run.world, run.observation)
    run.world.robots.mood[:] = 9
    take_over(branch.world, branch.observation, run.world, run.observation)
    assert branch.world.robots.mood.tolist() == [9] * 4
    kept.restore(0, run.world, run.observation)
    assert run.world.robots.mood.tolist() == [5, 6, 7, 8]


def test_one_more_field_is_in_recorded_keyframes_and_snapshots() -> None:
    assert "mood" in MoreRobots.fields_where(attrgetter("in_keyframe"))
    assert "mood" in by_robot(MoreRobots)


def test_one_more_field_is_in_the_text_picture() -> None:
    run = with_moods()
    line = robot_line(run.world, run.resolved.floor_plan, 3)
    assert "mood 8" in line
    assert read_robot(line, 0, MoreRobots).facts["mood"] == 8


# Nothing of the state is left out by oversight.


def all_fields(struct: type[Struct], path: str = "") -> Iterator[tuple[str, Field]]:
    """The fields of a struct and of the structs in it."""
    for name, declared in struct._declared.items():
        part = struct.struct_classes().get(name)
        if part is not None:
            yield from all_fields(part, f"{path}{name}.")
        else:
            yield path + name, declared


def test_each_field_of_the_state_has_a_role() -> None:
    fields = dict(all_fields(World)) | dict(all_fields(Observation))
    assert [name for name, declared in fields.items() if not declared.role] == []
    undigested = {name for name, one in fields.items() if one.role == STATE and one.digest is None}
    assert {name.rpartition(".")[0] for name in undigested} == {"service_zones.design"}


def arrays(struct: Struct, path: str = "") -> Iterator[tuple[str, Field, Array]]:
    for name, declared in struct._declared.items():
        value = struct.array(name)
        if isinstance(value, Struct):
            yield from arrays(value, f"{path}{name}.")
        elif declared.is_array:
            yield path + name, declared, value


@cache
def played(name: str) -> tuple[Simulation, dict[str, Array]]:
    """A run after some ticks, and its arrays at the start."""
    run = Simulation(resolve(name, ()), seed=7)
    start = {name: array.copy() for name, _, array in arrays(run.world)}
    run.run(until=60)
    return run, start


RUNS = ("tabletop-mini", "crossing", "factory")


@pytest.mark.parametrize("name", RUNS)
def test_what_a_run_changes_is_not_called_static(name: str) -> None:
    run, start = played(name)
    assert unlike_declared(run, start) == set()


def unlike_declared(run: Simulation, start: dict[str, Array]) -> set[str]:
    """What changed and is neither carried to a branch nor scratch."""
    changed = [(n, one) for n, one, array in arrays(run.world) if (array != start[n]).any()]
    return {n for n, one in changed if one.role not in (*CARRIED, SCRATCH, BY_ENTRY)}


def test_without_its_role_each_field_that_changes_is_missed(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    tried = set()
    for run, start in map(played, RUNS):
        for name, declared, array in list(arrays(run.world)):
            if declared.role in CARRIED and (array != start[name]).any():
                with monkeypatch.context() as patch:
                    patch.setattr(declared, "role", STATIC)
                    assert unlike_declared(run, start) == {name}
                tried.add(name)
    assert {"robots.cell", "orders.state", "slots.content", "tally.operations"} <= tried


def test_without_its_number_each_field_is_missed(monkeypatch: pytest.MonkeyPatch) -> None:
    *others, _ = digested_fields(World).values()  # the last one is the tick
    for _, _, declared in others:
        with monkeypatch.context() as patch:
            patch.setattr(declared, "digest", None)
            with pytest.raises(TypeError, match="each with its own number"):
                digest_names(World)


# What is known of each robot, order, station and job whatever the sight.
KNOWN = {
    (Robots, "n"): {"identity", "at_index", "type"},
    (Tally, "n"): set(),
    (ServiceZones, "n"): set(),
    (ServiceZones, "m"): set(),
    (Orders, "m"): set(),
    (Stations, "k"): {"slot"},
    (Stations, "j"): {"station", "processing_time", "part", "releases_order"},
}
HIDDEN = [
    (struct, extent, name)
    for (struct, extent), known in KNOWN.items()
    for name, declared in struct._declared.items()
    if declared.extents[:1] == (extent,) and name not in known
]


def unlike_seen(struct: type[Struct], extent: str) -> set[str]:
    """The arrays along an extent that are not hidden, or not shown as they are, as declared now."""
    world, seen = filled(struct, 5), filled(struct, 7)
    names = {name for *where, name in HIDDEN if where == [struct, extent]}
    python(showing(struct, extent))(seen, world, 1)
    unlike = {name for name in names if (getattr(seen, name)[1] != getattr(world, name)[1]).any()}
    python(hiding(struct, extent))(seen, 1)
    return unlike | {
        name for name in names if (getattr(seen, name)[1] == getattr(world, name)[1]).any()
    }


def filled(struct: type[Struct], value: int) -> Struct:
    """A struct of three robots, orders and so on, with a value that nothing hidden has."""
    parts = {name: filled(part, value) for name, part in struct.struct_classes().items()}
    extents = {extent for one in struct._declared.values() for extent in one.extents}
    made = struct.sized(dict.fromkeys(filter(str.isidentifier, extents), 3), **parts)
    for name, declared in struct._declared.items():
        if declared.is_array:
            made.array(name)[...] = value
    for declared in struct._declared.values():
        if declared.used:
            getattr(made, declared.used)[:] = 3
    return made


@pytest.mark.parametrize(("struct", "extent"), KNOWN)
def test_each_field_is_hidden_and_shown(struct: type[Struct], extent: str) -> None:
    assert unlike_seen(struct, extent) == set()


@pytest.mark.parametrize(("struct", "extent", "name"), HIDDEN)
def test_what_is_not_hidden_or_shown_is_missed(
    struct: type[Struct], extent: str, name: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(struct._declared[name], "_hidden", VISIBLE)
    assert unlike_seen(struct, extent) == {name}
