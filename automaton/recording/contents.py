"""Contents of frames: type, shape and range of every value, checked before any other use.

Sizes are limited before allocation, and arrays are checked before they index others.
"""

from __future__ import annotations

import zlib
from collections.abc import Mapping
from operator import attrgetter
from typing import Annotated, Any, Final, NamedTuple

import msgspec
import numpy as np
from msgspec import UNSET, Meta, UnsetType, defstruct
from numpy.typing import NDArray

from automaton.engine.facilities import Gates, Lines, Pods, PodStations, Slots, Stations, Stops
from automaton.engine.record_codes import (
    ACTION_MASK,
    CHANGE_DELAYED,
    CHANGE_DROPPED,
    CHANGE_DURATION,
    CHANGE_LOAD_LEFT,
    CHANGE_ORDER_RESERVED,
    CHANGE_PICKED,
    CHANGE_SEEN_CELL,
    CHANGE_SEEN_CHARGE,
    CHANGE_SEEN_GOAL,
    CHANGE_SEEN_HEADING,
    CHANGE_SEEN_LOAD,
    CHANGE_SEEN_ORDER,
    CHANGE_SLOT_RESERVED,
    CHANGE_STATUS,
    CHANGE_VISITED,
    CHANGE_ZONE,
    EXECUTED_CODES,
    EXECUTED_VALUES,
)
from automaton.engine.state import BATTERY_FULL, STRATEGY_COUNT, Orders, Robots, World
from automaton.errors import InputError
from automaton.floor.floor_plan import ALL_EXITS, CELL_KINDS
from automaton.printable import cleaned

FRAME_KIND_HEADER: Final = 1  # the inputs of the run
# decisions, committed actions, changes and digests of consecutive ticks
FRAME_KIND_TICKS: Final = 2
FRAME_KIND_KEYFRAME: Final = 3  # the state after a tick
FRAME_KIND_END: Final = 4  # the end of the run; a recording without it was cut short
# rules from the next tick on: at tick 0, and where a run was branched off
FRAME_KIND_CONDITIONS: Final = 5

Content = dict[str, Any]
Array = NDArray[Any]


class DecodedFrame(NamedTuple):
    """A decoded frame."""

    kind: int
    content: Content


MIB: Final = 1 << 20
MAX_BYTES: Final = {
    FRAME_KIND_HEADER: 192 * MIB,  # 95 MiB for 1,000,000 lines of trips with two stops
    FRAME_KIND_TICKS: 256 * MIB,
    FRAME_KIND_KEYFRAME: 256 * MIB,
    FRAME_KIND_END: MIB,
}
MAX_BYTES[FRAME_KIND_CONDITIONS] = 64 * MIB  # 36 MiB for as many lines
MAX_TEXT: Final = 24 * MIB  # bytes of a scenario
MAX_LISTS: Final = 1_000_000  # lists and mappings in it: 1 byte each takes 64 in memory
MAX_NESTING: Final = 40  # nested lists and mappings, as in the file of a scenario
# listed starts and stations: 1 byte each in the file takes 8 or more in memory
MAX_PLACES: Final = 1_000_000
MAX_LABELS: Final = 10_000  # settings, files, versions, names of digests
MAX_EMPTY: Final = 1 << 16  # rows or columns of an empty array, which takes no bytes

FRAME_TICKS: Final = 256  # most ticks in a FRAME_KIND_TICKS frame
MAX_ROWS: Final = 64  # most changes of a robot in a tick
MAX_CHANGES: Final = 4_000_000  # most changes in a FRAME_KIND_TICKS frame
LAST_TICK: Final = 2_000_000_000
MAX_NUMBER: Final = 1 << 31
MAX_HANDLING: Final = 65_536_000_000  # millionths of a tick for a line or a visit

IN_HEADER: Final = attrgetter("in_header")  # selects declarations of fields

# Routes are left out: they are most of a state, and committed actions do not need them.
KEYFRAME_ARRAYS: Final = {
    part: arrays
    for part, struct in World.struct_classes().items()
    if (arrays := struct.fields_where(attrgetter("in_keyframe")))
}


def _part(name: str, arrays: tuple[str, ...], *others: Any) -> type[msgspec.Struct]:
    fields = [(array, np.ndarray) for array in arrays]
    return defstruct(name, [*fields, *others], forbid_unknown_fields=True)


_MAYBE = np.ndarray | UnsetType
_Places = Annotated[tuple[int, ...], Meta(max_length=MAX_PLACES)]
_Labels = Annotated[tuple[str, ...], Meta(max_length=MAX_LABELS)]
_Named = Annotated[dict[str, str], Meta(max_length=MAX_LABELS)]
_Text = Annotated[str, Meta(max_length=MAX_TEXT)]
_Columns = Annotated[dict[str, np.ndarray], Meta(max_length=20)]
_Name = Annotated[str, Meta(max_length=MAX_TEXT)] | int
_Names = Annotated[
    dict[str, Annotated[list[_Name], Meta(max_length=MAX_PLACES)]], Meta(max_length=4)
]
_FLOOR = _part(
    "Floor",
    ("kind", "exits", "capacity", "bays", "loads", "opens"),
    ("width", int),
    ("height", int),
    ("starts", _Places),
    ("numbered", _Places),
)
# Arrays that a header may leave out.
_OPTIONAL: Final = ("release_sequence", "weight", "priority", "due", "first_stop")
OF_SKUS: Final = {
    "pods": ("sku_first", "sku_pod"),
    "lines": ("sku",),
    "pod_stations": ("ticks_from",),
}


def _part_of(struct: Any, optional: tuple[str, ...]) -> type[msgspec.Struct]:
    """The arrays of a struct in a header, some of them optional."""
    always = tuple(name for name in struct.fields_where(IN_HEADER) if name not in optional)
    return _part(struct.__name__, always, *((name, _MAYBE, UNSET) for name in optional))


_ORDERS = _part_of(Orders, _OPTIONAL)
_PODS = _part_of(Pods, ("weight", *OF_SKUS["pods"]))
_LINES = _part_of(Lines, OF_SKUS["lines"])
_POD_STATIONS = _part_of(PodStations, OF_SKUS["pod_stations"])


class _Frame(msgspec.Struct, forbid_unknown_fields=True):
    pass


class _Observed(_Frame):
    """Only observed runs have it: what messages of real robots showed, not a simulation."""

    first: np.ndarray  # changes that make the state at tick 0
    robots: _Labels  # their names
    log: _Labels  # what was read and what was wrong with it
    gap: Annotated[int, Meta(ge=1, le=1_000_000)]  # ticks by which positions may be wrong


class _Header(_Frame):
    scenario: msgspec.Raw
    seed: int
    strategies: msgspec.Raw
    start: _Text | _Places
    overrides: _Labels
    text: _Text
    sources: _Named
    versions: _Named
    digest_names: _Labels
    digest_every: int
    floor: _FLOOR  # type: ignore[valid-type]
    robots: _part("Robots", Robots.fields_where(IN_HEADER))  # type: ignore[valid-type]
    orders: _ORDERS  # type: ignore[valid-type]
    jobs: _part("Jobs", Stations.fields_where(IN_HEADER))  # type: ignore[valid-type]
    slots: _part("Slots", Slots.fields_where(IN_HEADER), ("first_spare", int))  # type: ignore[valid-type]
    files: _Named | UnsetType = UNSET
    stops: _part("Stops", Stops.fields_where(IN_HEADER)) | UnsetType = UNSET  # type: ignore[valid-type]
    listed: _Columns | UnsetType = UNSET
    listed_lines: _Columns | UnsetType = UNSET
    line_names: _Names | UnsetType = UNSET
    pods: _PODS | UnsetType = UNSET  # type: ignore[valid-type]
    lines: _LINES | UnsetType = UNSET  # type: ignore[valid-type]
    pod_stations: _POD_STATIONS | UnsetType = UNSET  # type: ignore[valid-type]
    gates: _part("Gates", Gates.fields_where(IN_HEADER)) | UnsetType = UNSET  # type: ignore[valid-type]
    observed: _Observed | UnsetType = UNSET


class _Conditions(_Frame):
    tick: int
    settings: _Labels
    scenario: msgspec.Raw
    strategies: msgspec.Raw
    period: np.ndarray
    wait: np.ndarray
    steered: np.ndarray
    watches_chargers: np.ndarray
    files: _Named | UnsetType = UNSET
    listed: _Columns | UnsetType = UNSET
    listed_lines: _Columns | UnsetType = UNSET
    line_names: _Names | UnsetType = UNSET


class _Ticks(_Frame):
    first: int
    executed: np.ndarray
    decisions: np.ndarray
    changes: np.ndarray
    due: np.ndarray
    digests: np.ndarray


class _End(_Frame):
    ticks: int
    finished: bool
    digest: str
    metrics: dict[str, int | float]


_KEYFRAME = defstruct(
    "Keyframe",
    [("tick", int), *((name, _part(name, arrays)) for name, arrays in KEYFRAME_ARRAYS.items())],
    forbid_unknown_fields=True,
)

_FRAMES: Final[dict[int, Any]] = {
    FRAME_KIND_HEADER: _Header,
    FRAME_KIND_TICKS: _Ticks,
    FRAME_KIND_KEYFRAME: _KEYFRAME,
    FRAME_KIND_END: _End,
    FRAME_KIND_CONDITIONS: _Conditions,
}


class InvalidFrameError(ValueError):
    """The content of a frame is invalid; the text says why, without naming file and frame."""


def read_content(kind: int, payload: bytes | memoryview) -> Content:
    """Decode a frame: checks types, but not shapes and ranges. Raises InvalidFrameError."""
    data = inflated(payload, MAX_BYTES[kind])
    try:
        frame = msgspec.msgpack.decode(data, type=_FRAMES[kind], ext_hook=_array_in)
    except msgspec.MsgspecError as error:
        raise InvalidFrameError(f"its content cannot be read: {error}") from None
    return _as_content(frame) if kind == FRAME_KIND_TICKS else cleaned(_as_content(frame))


def inflated(payload: bytes | memoryview, most: int) -> bytes:
    """Decompress at most `most` bytes. Raises InvalidFrameError."""
    unpacking = zlib.decompressobj()
    try:
        data = unpacking.decompress(payload, most + 1)
    except zlib.error as error:
        raise InvalidFrameError(f"its content cannot be decompressed: {error}") from None
    if len(data) > most:
        raise InvalidFrameError(f"its content has more than {most:,} bytes")
    if not unpacking.eof or unpacking.unused_data:
        raise InvalidFrameError("its content is not a single compressed stream")
    return data


def _as_content(frame: msgspec.Struct) -> Content:
    found: Content = {}
    for name in frame.__struct_fields__:
        value = getattr(frame, name)
        if isinstance(value, msgspec.Raw):
            found[name] = _mapping(name, bytes(value))
        elif isinstance(value, msgspec.Struct):
            found[name] = _as_content(value)
        elif value is not UNSET:
            found[name] = value
    return found


def _mapping(name: str, data: bytes) -> Content:
    if len(data) > MAX_TEXT:
        raise InvalidFrameError(f"{name} has more than {MAX_TEXT:,} bytes")
    heads = np.frombuffer(data, np.uint8)
    lists = np.count_nonzero((heads >> 5 == 4) | (heads >> 2 == 0xDC >> 2))
    if lists > MAX_LISTS:
        raise InvalidFrameError(f"{name} has more than {MAX_LISTS:,} lists and mappings")
    try:
        found: Content = msgspec.msgpack.decode(data, type=dict[str, Any])
    except RecursionError:
        raise _too_deep(name) from None
    except (msgspec.MsgspecError, ValueError) as error:
        raise InvalidFrameError(f"{name} cannot be read: {error}") from None
    level: list[Any] = [found]
    for _ in range(MAX_NESTING):
        level = [value for part in level for value in _nested_in(part)]
    if level:
        raise _too_deep(name)
    return found


def _nested_in(holder: Any) -> list[Any]:
    """The lists and mappings directly in `holder`; a type check skips long lists of numbers."""
    parts = [*holder, *holder.values()] if isinstance(holder, dict) else holder
    if _NESTING.isdisjoint(map(type, parts)):
        return []
    return [value for value in parts if type(value) in _NESTING]


def _too_deep(name: str) -> InvalidFrameError:
    return InvalidFrameError(f"{name} is nested more than {MAX_NESTING} levels deep")


_NESTING: Final = frozenset((dict, list, tuple))  # types that msgpack nests
ARRAY_CODE: Final = 1  # msgpack extension: (dtype, shape, bytes)
_DTYPES: Final = {
    np.dtype(kind).newbyteorder("<").str: np.dtype(kind).newbyteorder("<")
    for kind in ("u1", "i2", "u2", "i4", "i8", "u8")
}
_DESCRIBED = msgspec.msgpack.Decoder(tuple[str, tuple[int, ...], memoryview])


def array_out(value: Any) -> Any:
    """Encode an array, or a NumPy number, for msgpack."""
    if isinstance(value, np.generic):
        return value.item()
    little = np.ascontiguousarray(value, value.dtype.newbyteorder("<"))
    described = (little.dtype.str, little.shape, little.tobytes())
    return msgspec.msgpack.Ext(ARRAY_CODE, msgspec.msgpack.encode(described))


def _array_in(code: int, data: memoryview) -> Array:
    if code != ARRAY_CODE:
        raise InvalidFrameError(f"it has an unknown extension {code}")
    try:
        name, shape, content = _DESCRIBED.decode(data)
    except msgspec.MsgspecError as error:
        raise InvalidFrameError(f"one of its arrays cannot be read: {error}") from None
    dtype = _DTYPES.get(name)
    if dtype is None:
        raise InvalidFrameError(f"one of its arrays has the type {name[:20]!r}")
    count = 1
    for extent in shape:
        if not 0 <= extent < MAX_NUMBER:
            raise InvalidFrameError(f"one of its arrays has an extent of {extent}")
        count *= extent
    if not count and max(shape) > MAX_EMPTY:
        raise InvalidFrameError(f"one of its arrays is empty but has an extent of {max(shape):,}")
    if len(shape) > 2 or count * dtype.itemsize != len(content):
        raise InvalidFrameError("the size of one of its arrays does not match its shape")
    array: Array = np.frombuffer(content, dtype).reshape(shape)
    return array


class Range(NamedTuple):
    """The constraints on an array; text in shape and bounds names a size."""

    dtype: str
    shape: tuple[str | int, ...]  # an unknown size is set to the extent found
    least: int
    below: str | int


# Arrays that define sizes come first.
HEADER_ARRAYS: Final = {
    "floor.kind": Range("u1", ("rows", "columns"), 0, len(CELL_KINDS)),
    "floor.exits": Range("u1", ("rows", "columns"), 0, ALL_EXITS + 1),
    "floor.capacity": Range("u1", ("rows", "columns"), 0, 3),
    "floor.loads": Range("u1", ("rows", "columns"), 0, 2),
    "floor.opens": Range("u1", ("rows", "columns"), 0, ALL_EXITS + 1),
    "floor.bays": Range("i4", ("bays", 2), 0, "cells"),
    "robots.home": Range("i4", ("robots",), 0, "cells"),
    "robots.bay": Range("i4", ("robots",), -1, "cells"),
    "robots.cell": Range("i4", ("robots",), -1, "cells"),
    "robots.heading": Range("u1", ("robots",), 0, 4),
    "robots.charge": Range("i4", ("robots",), 0, 1_000_000_001),
    "slots.cell": Range("i4", ("slots",), -1, "cells"),
    "orders.source": Range("i4", ("orders",), -1, "spare"),
    "orders.target": Range("i4", ("orders",), -1, "spare"),
    "orders.release_tick": Range("i4", ("orders",), 0, MAX_NUMBER),
    "orders.release_sequence": Range("i4", ("orders",), -1, "orders"),
    "orders.weight": Range("i4", ("orders",), 0, MAX_NUMBER),
    "orders.priority": Range("i2", ("orders",), -100, 101),
    "orders.due": Range("i4", ("orders",), -LAST_TICK, MAX_NUMBER),
    "orders.first_stop": Range("i4", ("orders and one",), 0, MAX_NUMBER),
    "stops.cell": Range("i4", ("stops",), -1, "cells"),
    "stops.ticks": Range("i4", ("stops",), 0, 65_536),
    "jobs.processing_time": Range("i4", ("jobs",), 0, MAX_NUMBER),
    "jobs.arrival_tick": Range("i4", ("jobs",), -1, MAX_NUMBER),
    "pods.slot": Range("i4", ("pods",), 0, "spare"),
    "pod_stations.cell": Range("i4", ("stations",), 0, "cells"),
    "pod_stations.places": Range("i4", ("stations",), -1, MAX_NUMBER),
    "pod_stations.visit": Range("i8", ("stations",), 0, MAX_HANDLING),
    "lines.handling": Range("i8", ("rules", "lines"), 0, MAX_HANDLING),
    "pod_stations.rule": Range("i4", ("stations",), 0, "rules"),
    "lines.order": Range("i4", ("lines",), 0, "lines"),
    "pods.weight": Range("i4", ("pods",), 1, MAX_NUMBER),
    "pods.sku_first": Range("i4", ("skus and one",), 0, MAX_NUMBER),
    "pods.sku_pod": Range("i4", ("held",), 0, "pods"),
    "pod_stations.ticks_from": Range("i4", ("rows of ticks", "slots of ticks"), 0, MAX_NUMBER + 1),
    "lines.pod": Range("i4", ("lines",), -1, "pods"),
    "lines.sku": Range("i4", ("lines",), -1, MAX_NUMBER),
    "lines.station": Range("i4", ("lines",), -1, "stations"),
    "lines.release_tick": Range("i4", ("lines",), 0, MAX_NUMBER),
    "lines.due": Range("i4", ("lines",), 0, MAX_NUMBER),
    "lines.priority": Range("i2", ("lines",), -100, 101),
    "gates.first_closing": Range("i4", ("gates and one",), 0, MAX_NUMBER),
    "gates.closings": Range("i8", ("closings", 2), 0, 2 * MAX_NUMBER),
    "observed.first": Range("i8", ("first changes", 4), -1, MAX_NUMBER),
}
CONDITIONS_ARRAYS: Final = {
    "period": Range("i4", (STRATEGY_COUNT,), 0, MAX_NUMBER),
    "wait": Range("i4", (5,), 1, 10_001),
    "steered": Range("u1", (1,), 0, 2),
    "watches_chargers": Range("u1", (1,), 0, 2),
}
# Only the validator reads states as numbers; `verify` compares them with the repeated run.
STATE_SIZES: Final = {name: name for name in ("robots", "orders", "slots", "stops")}


def check_arrays(content: Content, wanted: Mapping[str, Range], sizes: dict[str, int]) -> None:
    """Check arrays by dotted names; adds unknown sizes to `sizes`. Raises InvalidFrameError."""
    for name, (dtype, shape, least, below) in wanted.items():
        *path, last = name.split(".")
        part = content
        for key in path:
            part = part.get(key, {})
        if last not in part:
            continue
        array = part[last]
        if array.dtype != np.dtype(dtype):
            raise InvalidFrameError(f"{name} has the type {array.dtype}, not {np.dtype(dtype)}")
        _check_shape(name, array, shape, sizes)
        most = sizes[below] if isinstance(below, str) else below
        if array.size and not (int(array.min()) >= least and int(array.max()) < most):
            found = int(array.min()) if int(array.min()) < least else int(array.max())
            raise InvalidFrameError(
                f"{name} has the value {found}; {least} to {most - 1} are allowed"
            )


def _check_shape(
    name: str, array: Array, shape: tuple[str | int, ...], sizes: dict[str, int]
) -> None:
    if array.ndim != len(shape):
        raise InvalidFrameError(f"{name} has {array.ndim} dimensions, not {len(shape)}")
    for extent, size in zip(array.shape, shape, strict=True):
        expected = sizes.setdefault(size, extent) if isinstance(size, str) else size
        if extent != expected:
            raise InvalidFrameError(f"{name} has {extent:,} rows or columns, not {expected:,}")


def check_keyframe(content: Content, sizes: dict[str, int]) -> None:
    """Check the shapes of a state. Raises InvalidFrameError."""
    for part, arrays in KEYFRAME_ARRAYS.items():
        for name in arrays:
            array = content[part][name]
            if array.ndim != 1:
                raise InvalidFrameError(f"{part}.{name} has {array.ndim} dimensions, not 1")
            if part in STATE_SIZES and len(array) != sizes[STATE_SIZES[part]]:
                text = f"{len(array):,} {part}, not {sizes[STATE_SIZES[part]]:,}"
                raise InvalidFrameError(f"{part}.{name} has {text}")


def unpacked_ticks(content: Content, known: Mapping[str, int]) -> Content:
    """Expand the content of a FRAME_KIND_TICKS frame: one row per tick.

    `known`: the numbers of robots and of digest names, if known. Raises InvalidFrameError if parts
    do not fit these or each other.
    """
    ticks = content["executed"].shape[1] if content["executed"].ndim == 2 else 0
    sizes = {**known, "ticks": ticks}
    if not 0 < ticks <= FRAME_TICKS or not 0 < content["first"] <= LAST_TICK:
        raise InvalidFrameError(f"it holds {ticks} ticks from tick {content['first']} on")
    most = MAX_ROWS * (len(content["executed"]) + 1)  # in a tick
    if content["changes"].ndim == 2 and content["changes"].shape[1] > min(
        MAX_CHANGES, most * ticks
    ):
        raise InvalidFrameError(f"it has more than {min(MAX_CHANGES, most * ticks):,} changes")
    check_arrays(
        content,
        {
            "executed": Range("u2", ("robots", "ticks"), 0, EXECUTED_VALUES),
            "decisions": Range("i8", ("words",), -(1 << 63), 1 << 63),
            "changes": Range("i4", (4, "changes"), -MAX_NUMBER, MAX_NUMBER),
            "due": Range("i4", ("due",), 0, "ticks"),
            "digests": Range("u8", ("names", "due"), 0, 1 << 64),
        },
        sizes,
    )
    if (content["executed"] & ACTION_MASK >= EXECUTED_CODES).any():
        raise InvalidFrameError("it has an unknown action")
    due, changes = content["due"], content["changes"].T.astype(np.int64)
    if (np.diff(due) <= 0).any():
        raise InvalidFrameError("its digests are not ordered by tick")
    if len(changes) and (
        (np.diff(changes[:, 0]) < 0).any() or changes[0, 0] < 0 or changes[-1, 0] >= ticks
    ):
        raise InvalidFrameError("its changes are not ordered by tick")
    if np.bincount(changes[:, 0], minlength=1).max() > most:
        raise InvalidFrameError(f"it has more than {most:,} changes in a tick")
    changes[:, 0] += content["first"]
    digests = np.zeros((ticks, len(content["digests"])), np.uint64)
    digests[due] = np.bitwise_xor.accumulate(content["digests"].T, axis=0)
    return {
        "first": content["first"],
        "executed": np.ascontiguousarray(content["executed"].T),
        "decisions": content["decisions"],
        "changes": changes,
        "digests": digests,
    }


def check_changes(changes: Array, sizes: Mapping[str, int]) -> None:
    """Check that changes name existing robots, orders and slots. Raises InvalidFrameError."""
    robots, orders, slots, cells = (sizes[name] for name in ("robots", "orders", "slots", "cells"))
    limits = {
        CHANGE_ORDER_RESERVED: (orders, -1, robots),
        CHANGE_SLOT_RESERVED: (slots, -1, robots),
        CHANGE_DURATION: (robots, 0, MAX_NUMBER),
        CHANGE_PICKED: (robots, 0, orders),
        CHANGE_DROPPED: (robots, 0, slots),
        CHANGE_ZONE: (robots, -1, MAX_NUMBER),
        CHANGE_LOAD_LEFT: (robots, 0, slots),
        CHANGE_STATUS: (robots, 0, 7),
        CHANGE_VISITED: (robots, 0, orders),
        CHANGE_DELAYED: (robots, 1, MAX_NUMBER),
        CHANGE_SEEN_CELL: (robots, -1, cells),
        CHANGE_SEEN_HEADING: (robots, 0, 4),
        CHANGE_SEEN_CHARGE: (robots, 0, BATTERY_FULL + 1),
        CHANGE_SEEN_ORDER: (robots, -1, orders),
        CHANGE_SEEN_LOAD: (robots, -1, orders),
        CHANGE_SEEN_GOAL: (robots, -1, cells),
    }
    table = np.array([limits.get(code, (0, 0, 0)) for code in range(max(limits) + 1)], np.int64)
    code, subject, value = changes[:, 1:].T
    known = (code > 0) & (code < len(table))
    subjects, least, values = table[np.where(known, code, 0)].T
    wrong = ~known | (subject < 0) | (subject >= subjects) | (value < least) | (value >= values)
    if wrong.any():
        tick, *row = changes[int(wrong.argmax())].tolist()
        raise InvalidFrameError(f"it has an invalid change in tick {tick}: {row}")


def refusal(error: InvalidFrameError, file: str, number: int, kind: int, at: int) -> InputError:
    """The sentence about an invalid frame."""
    name = {
        FRAME_KIND_HEADER: "the header",
        FRAME_KIND_TICKS: "ticks",
        FRAME_KIND_KEYFRAME: "a state",
        FRAME_KIND_END: "the end",
    }.get(kind, "conditions")
    text = " ".join(str(error).split())
    return InputError(f"damaged or altered: frame {number} at byte {at:,} ({name}): {text}", file)
