"""The file of a recorded run: append-only frames, each sealed together with all before it.

    preamble   magic, format version
    frame      kind, length, last tick, CRC-32 of these, seal | payload: zlib(msgpack)
    ...        HEADER, CONDITIONS, KEYFRAME at tick 0, TICKS ..., KEYFRAME ..., END

The seal of a frame is a hash of the previous seal and of the frame; its CRC also begins with the
previous seal. So only a missing end is not detected as damage: such a file is *cut short*, and is
read to its last whole frame. Changed, missing or repeated frames are *damage*. Seals do not detect
tampering, since anyone can compute them: `verify` runs the recording again. Arrays are stored
little-endian, in a layout in which zlib finds repetition between ticks.
"""

from __future__ import annotations

import hashlib
import struct
import zlib
from array import array
from bisect import bisect_left
from collections.abc import Callable, Container, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from types import MappingProxyType
from typing import Any, Final, NamedTuple, Protocol

import msgspec
import numpy as np

from automaton.engine.jit.structs import Struct
from automaton.engine.state import NEVER, NIL
from automaton.errors import InputError
from automaton.floor.floor_plan import FloorPlan
from automaton.recording.contents import (
    FRAME_KIND_CONDITIONS,
    FRAME_KIND_END,
    FRAME_KIND_HEADER,
    FRAME_KIND_TICKS,
    IN_HEADER,
    OF_SKUS,
    Content,
    DecodedFrame,
    InvalidFrameError,
    array_out,
    read_content,
    unpacked_ticks,
)
from automaton.runs.provenance import file_hashes, loaded_sources, recorded_files, versions
from automaton.scenario.order_lines import plain_data
from automaton.scenario.schema import LAYER_NAMES, Scenario
from automaton.strategy import lookup
from automaton.strategy.lookup import AsRecorded
from automaton.world.floor_parts import with_limits_and_streets
from automaton.world.resolved import Resolved, StrategyChoice, in_fine_ticks

RECORDING_FORMAT: Final = 7
MAGIC: Final = b"\x93AUTOMATON\r\n"  # not text, and broken by transfers that change line ends
PREAMBLE: Final = struct.Struct("<12sH")  # magic, format
FRAME: Final = struct.Struct("<BIQI16s")  # kind, bytes of the payload, tick, CRC-32, seal
CHECKED: Final = struct.Struct("<BIQ")  # the part of FRAME that the CRC covers

DECODED: Final = 4  # FRAME_KIND_TICKS frames that stay decoded
COMPRESSION: Final = 5  # zlib level: 6 takes 1.7 times as long and saves 3 %


class Stored(Protocol):
    """A stored frame, wherever its bytes are."""

    @property
    def kind(self) -> int: ...

    @property
    def tick(self) -> int:
        """Its last tick."""

    @property
    def data(self) -> bytes | memoryview:
        """Compressed."""


class Payload(NamedTuple):
    """A stored frame with its bytes."""

    kind: int
    tick: int  # its last tick
    data: bytes | memoryview  # compressed
    at: int = 0  # its offset in the file
    before: int = 0  # the last tick of the previous frames


Reader = Callable[[int, Any], Content]  # (number of the frame behind the header, the frame)


class StoredFrames:
    """The checked frames of a file or of a current run, decoded one at a time on request.

    FRAME_KIND_TICKS frames can be found by tick; recently used ones stay decoded. `read`: decodes
    and checks; frames of this process need no check.
    """

    def __init__(self, payloads: Sequence[Stored], read: Reader | None = None) -> None:
        self.payloads = payloads
        self.read = read
        self._last = array("q")  # the last tick of each FRAME_KIND_TICKS frame
        self._index_of = array("q")
        self._rules: list[Content] = []
        self._indexed = 0
        self._decoded: dict[int, Content] = {}

    def __iter__(self) -> Iterator[DecodedFrame]:
        for index, payload in enumerate(self.payloads):
            yield DecodedFrame(payload.kind, self._content(index))

    @property
    def last_tick(self) -> int:
        """The last recorded tick."""
        self._index()
        return self._last[-1] if self._last else 0

    def rules_at(self, tick: int) -> Content:
        """The conditions in the tick after `tick`. Raises InputError if the frame is missing."""
        self._index()
        found = [rules for rules in self._rules if rules["tick"] <= tick]
        if not found:
            raise InputError("the recording is cut short before its first tick")
        return found[-1]

    def next_rules(self, tick: int) -> int | None:
        """The first tick after `tick` from which other rules apply; None if the rules stay."""
        self._index()
        return min((r["tick"] for r in self._rules if r["tick"] > tick), default=None)

    def ticks_with(self, tick: int) -> Content | None:
        """The FRAME_KIND_TICKS frame that holds a tick; None after the last one."""
        self._index()
        place = bisect_left(self._last, tick)
        if place == len(self._last):
            return None
        index = self._index_of[place]
        if index not in self._decoded:
            while len(self._decoded) >= DECODED:
                del self._decoded[next(iter(self._decoded))]
            self._decoded[index] = self._content(index)
        return self._decoded[index]

    def _content(self, index: int) -> Content:
        payload = self.payloads[index]
        if self.read is not None:
            return self.read(index, payload)
        return decode(payload.kind, payload.data)

    def _index(self) -> None:
        for index in range(self._indexed, len(self.payloads)):
            payload = self.payloads[index]
            if payload.kind == FRAME_KIND_TICKS:
                self._last.append(payload.tick)
                self._index_of.append(index)
            elif payload.kind == FRAME_KIND_CONDITIONS:
                self._rules.append(self._content(index))
        self._indexed = len(self.payloads)


@dataclass(frozen=True)
class Recording:
    """A recorded run, from a file or in memory; `frames` can be iterated repeatedly."""

    header: Content
    frames: Iterable[DecodedFrame]  # after the header
    complete: bool  # has a FRAME_KIND_END frame: it was not cut short

    @property
    def ticks(self) -> int:
        """Number of recorded ticks."""
        if isinstance(self.frames, StoredFrames):
            return self.frames.last_tick
        return max((tick_of(kind, content) for kind, content in self.frames), default=0)

    @property
    def is_observed(self) -> bool:
        """Whether it shows what real robots did: it has no decisions, and no rule applied."""
        return "observed" in self.header

    def check_simulated(self, what: str, file: object) -> None:
        """Raise InputError for an observed run; `what` needs the decisions of a simulated one."""
        check_simulated(self.header, what, file)

    def stored(self) -> StoredFrames:
        """The frames as a sequence that finds ticks."""
        if isinstance(self.frames, StoredFrames):
            return self.frames
        return StoredFrames([payload_of(kind, content) for kind, content in self.frames])


def check_simulated(header: Content, what: str, file: object = None) -> None:
    """Raise InputError for an observed run; `what` needs the decisions of a simulated one."""
    if "observed" in header:
        text = f"{what} needs the decisions of a simulated run; this run was observed"
        raise InputError(text, None if file is None else str(file))


def preamble() -> bytes:
    """The first bytes of every recording."""
    return PREAMBLE.pack(MAGIC, RECORDING_FORMAT)


def tick_of(kind: int, content: Content) -> int:
    """The last tick of a frame's content."""
    if kind == FRAME_KIND_HEADER:
        return 0
    if kind == FRAME_KIND_TICKS:
        return int(content["first"]) + len(content["executed"]) - 1
    return int(content["ticks" if kind == FRAME_KIND_END else "tick"])


def payload_of(kind: int, content: Content) -> Payload:
    """Encode a frame for storage."""
    packed = content
    if kind == FRAME_KIND_TICKS:
        packed = _pack_ticks(content)
    elif kind in (FRAME_KIND_HEADER, FRAME_KIND_CONDITIONS):
        packed = pack_listed(content)
    data = zlib.compress(msgspec.msgpack.encode(packed, enc_hook=array_out), COMPRESSION)
    return Payload(kind, tick_of(kind, content), data)


class Chain:
    """Ties each frame of a file to all those before it."""

    def __init__(self) -> None:
        self._seal = hashlib.blake2b(preamble(), digest_size=16).digest()

    def framed(self, payload: Payload) -> bytes:
        """The next frame as bytes of the file."""
        kind, tick, data = payload[:3]
        head = CHECKED.pack(kind, len(data), tick)
        crc = zlib.crc32(head, zlib.crc32(self._seal))
        self._seal = self._sealed(head, data)
        return FRAME.pack(kind, len(data), tick, crc, self._seal) + data

    def leads_to(self, head: bytes) -> bool:
        """Whether this is the head of the next frame."""
        checked = head[: CHECKED.size]
        return bool(zlib.crc32(checked, zlib.crc32(self._seal)) == FRAME.unpack(head)[3])

    def follow(self, head: bytes, data: bytes) -> bool:
        """Advance to the next frame; returns whether it is intact."""
        self._seal = self._sealed(head[: CHECKED.size], data)
        return bool(self._seal == FRAME.unpack(head)[4])

    def _sealed(self, head: bytes, data: bytes | memoryview) -> bytes:
        seal = hashlib.blake2b(self._seal, digest_size=16)
        seal.update(head)
        seal.update(data)
        return seal.digest()


def encoded(header: Content, frames: Iterable[DecodedFrame]) -> bytes:
    """A whole recording as the bytes of a file."""
    chain = Chain()
    parts = [DecodedFrame(FRAME_KIND_HEADER, header), *frames]
    return preamble() + b"".join(chain.framed(payload_of(*part)) for part in parts)


def decode(
    kind: int, payload: bytes | memoryview, sizes: Mapping[str, int] = MappingProxyType({})
) -> Content:
    """The content of a frame, checked for types and sizes. Raises Unsound."""
    content = read_content(kind, payload)
    return unpacked_ticks(content, sizes) if kind == FRAME_KIND_TICKS else unpack_listed(content)


def _pack_ticks(content: Content) -> Content:
    """One row per robot and per digest; digests as differences from the previous ones."""
    due = np.flatnonzero(content["digests"].any(axis=1)).astype(np.int32)
    digests = content["digests"][due]
    changed = digests.copy()
    changed[1:] ^= digests[:-1]
    changes = content["changes"].T.astype(np.int64)
    changes[0] -= content["first"]
    return {
        "first": content["first"],
        "executed": np.ascontiguousarray(content["executed"].T),
        "decisions": content["decisions"],
        "changes": changes.astype(np.int32),
        "due": due,
        "digests": np.ascontiguousarray(changed.T),
    }


# Long lists of orders and lines are stored as columns: a million would exceed the limits of a
# scenario.
#
# {"scenario": {"orders": {"list": [{"from": [0, 0], ...}, ...]}}}     in memory
# {"scenario": {"orders": {"list": null}}, "listed": {"from": (n, 2), "release": (n,), ...}}  in a file
#
# For lines, `listed_lines` has the columns and `line_names` the values of codes: numbers or texts.
# Due times at a tick are a separate column, `due at`.


MIN_PACKED: Final = 1000  # orders; shorter lists stay in the scenario
PAIRS_OF_CELLS: Final = ("from", "to")
NAMES: Final = ("order", "pod", "sku", "station")  # columns of lines: numbers and texts
DUE_AT: Final = "due at"
STORED_NULL: Final = -(2**31)  # stands for null
MAX_VALUE: Final = 2**31 - 1

Column = np.ndarray[Any, Any]


def pack_listed(content: Content) -> Content:
    """Return a header or conditions with long lists of transports or of lines as columns."""
    orders = content["scenario"].get("orders", {})
    listed, lines = orders.get("list"), orders.get("lines")
    if listed is not None and len(listed) >= MIN_PACKED:
        columns = _columns(listed)
        if columns is not None:
            content = {**_with_list(content, "list", None), "listed": columns}
    if isinstance(lines, list | tuple) and len(lines) >= MIN_PACKED:
        names: dict[str, list[Any]] = {name: [] for name in NAMES}
        columns = _columns(lines, names)
        if columns is not None:
            content = {**_with_list(content, "lines", None), "listed_lines": columns}
            content["line_names"] = names
    return content


def unpack_listed(content: Content) -> Content:
    """Return a header or conditions with its lists restored. Raises InvalidFrameError."""
    names = content.get("line_names", {})
    for key, form in (("listed", "list"), ("listed_lines", "lines")):
        columns = content.get(key)
        if columns is not None:
            rows = _rows(columns, names if form == "lines" else {})
            packed = (key, "line_names")
            content = {name: part for name, part in content.items() if name not in packed}
            content = _with_list(content, form, rows)
            names = {}
    return content


def _with_list(content: Content, form: str, rows: list[Any] | None) -> Content:
    scenario = content["scenario"]
    orders = scenario.get("orders")
    if not isinstance(orders, dict):
        raise InvalidFrameError("its scenario has no list of orders")
    return {**content, "scenario": {**scenario, "orders": {**orders, form: rows}}}


def _columns(
    rows: Sequence[Any], names: dict[str, list[Any]] | None = None
) -> dict[str, Column] | None:
    """The columns of a list; codes for columns in `names`, which is filled. None: it has other
    columns."""
    columns = {}
    for name in rows[0]:
        values = [row[name] for row in rows]
        if names is not None and name in names:
            values = _codes(values, names[name])
        if name == "due":
            at = [value["at"] if isinstance(value, dict) else None for value in values]
            values = [None if isinstance(value, dict) else value for value in values]
            if any(value is not None for value in at):
                columns[DUE_AT] = np.array([STORED_NULL if v is None else v for v in at], np.int32)
        column = _column(name, values)
        if column is None:
            return None
        columns[name] = column
    return columns


def _codes(values: list[Any], names: list[Any]) -> list[int | None]:
    """The index of each value in `names`; new values are added."""
    known: dict[Any, int] = {}
    codes = [None if value is None else known.setdefault(value, len(known)) for value in values]
    names += known
    return codes


def _column(name: str, values: list[Any]) -> Column | None:
    """(n,) or, for cells, (n, 2) int32; None if a value is not a cell, a number or None."""
    if name in PAIRS_OF_CELLS:
        if any(value is None for value in values):
            return None
        return np.array(values, np.int32).reshape(-1, 2)
    numbers = [STORED_NULL if value is None else value for value in values]
    if not all(type(number) is int and STORED_NULL <= number <= MAX_VALUE for number in numbers):
        return None
    return np.array(numbers, np.int32)


def _rows(columns: dict[str, Column], names: dict[str, list[Any]]) -> list[dict[str, Any]]:
    """The list that is stored as columns. Raises InvalidFrameError."""
    if len({len(column) for column in columns.values()}) != 1 or any(
        (name in PAIRS_OF_CELLS) != (column.ndim == 2) for name, column in columns.items()
    ):
        raise InvalidFrameError("its table of orders is not valid")
    values = {
        name: _named(name, column, names[name]) if name in names else _values(column)
        for name, column in columns.items()
    }
    if DUE_AT in values:
        ticks = zip(values.pop(DUE_AT), values.get("due", ()), strict=False)
        values["due"] = [due if at is None else {"at": at} for at, due in ticks]
    fields = list(values)
    return [dict(zip(fields, row, strict=True)) for row in zip(*values.values(), strict=False)]


def _named(name: str, column: Column, names: list[Any]) -> list[Any]:
    """The values of the codes in a column."""
    codes = _values(column)
    if any(code is not None and not 0 <= code < len(names) for code in codes):
        raise InvalidFrameError(f"its lines contain an unnamed {name}")
    return [None if code is None else names[code] for code in codes]


def _values(column: Column) -> list[Any]:
    values: list[Any] = column.tolist()
    return (
        [None if value == STORED_NULL else value for value in values]
        if column.ndim == 1
        else values
    )


# The header: the inputs of a run, and the data that a validator needs. Reading it needs no other file.

FLOOR_ARRAYS = ("kind", "exits", "capacity", "bays", "loads", "opens")


def header_of(resolved: Resolved, seed: int, world: Any, digest_names: tuple[str, ...]) -> Content:
    """The header of a run; `world` is its state at tick 0 with robots stored by identity."""
    floor_plan = resolved.floor_plan
    left_out = set() if world.rules.in_system else {"release_sequence"}
    if not (world.orders.weight != 1).any():
        left_out.add("weight")
    if not world.orders.priority.any():
        left_out.add("priority")
    if not (world.orders.due != NEVER).any():
        left_out.add("due")
    tours = len(world.stops.cell) > 0
    if not tours:
        left_out.add("first_stop")
    plugins = tuple(choice.name for _, choice in resolved.choices if ":" in choice.name)
    return {
        "scenario": plain_data(resolved.unrefined.scenario),
        "seed": seed,
        "strategies": _strategies(resolved),
        "start": resolved.start,
        "overrides": resolved.overrides,
        "text": resolved.source,
        "sources": loaded_sources(plugins),
        **recorded_files(resolved),
        "versions": versions(),
        "digest_names": digest_names,
        "floor": {
            "width": floor_plan.width,
            "height": floor_plan.height,
            "starts": floor_plan.starts,
            "numbered": floor_plan.numbered,
            **{name: getattr(floor_plan, name) for name in FLOOR_ARRAYS},
        },
        "robots": _copies(world.robots),
        "orders": _copies(world.orders, left_out),
        **({"stops": _copies(world.stops)} if tours else {}),
        **_of_pods(world),
        **({"gates": _copies(world.gates)} if len(world.gates.closings) else {}),
        "jobs": _copies(world.stations),
        "slots": {**_copies(world.slots), "first_spare": world.slots.first_spare},
    }


def _of_pods(world: Any) -> Content:
    """The fields of a header for pods, lines and their stations."""
    if not len(world.pods.slot):
        return {}
    left_out = {name: set(arrays) for name, arrays in OF_SKUS.items()}
    if (world.lines.sku != NIL).any():
        left_out = {part: set() for part in OF_SKUS}
    if not (world.pods.weight != 1).any():
        left_out["pods"] = {*left_out["pods"], "weight"}
    parts = OF_SKUS if len(world.lines.order) else ("pods", "pod_stations")
    return {name: _copies(getattr(world, name), left_out[name]) for name in parts}


def _copies(struct: Struct, left_out: Container[str] = ()) -> Content:
    """Copies of the arrays of a struct that belong in a header."""
    names = [name for name in struct.fields_where(IN_HEADER) if name not in left_out]
    return {name: getattr(struct, name).copy() for name in names}


def rules_of(simulation: Any, settings: tuple[str, ...] = ()) -> Content:
    """The conditions after the current tick of a simulation; `settings`: those changed here."""
    resolved, rules = simulation.resolved, simulation.world.rules
    return {
        "tick": simulation.tick,
        "settings": settings,
        "scenario": plain_data(resolved.unrefined.scenario),
        "strategies": _strategies(resolved),
        **file_hashes(resolved),
        "period": rules.period.copy(),
        "wait": rules.wait.copy(),
        "steered": rules.steered.copy(),
        "watches_chargers": rules.watches_chargers.copy(),
    }


def _strategies(resolved: Resolved) -> Content:
    """Strategies by layer, then the allocations of single robot types."""
    resolved = resolved.unrefined
    types = zip(resolved.scenario.fleet.types, resolved.own_allocations, strict=False)
    own = {own_allocation_of(kind.name): choice for kind, choice in types if choice is not None}
    return {
        key: {"name": choice.name, "parameters": msgspec.to_builtins(choice.parameters)}
        for key, choice in (resolved.strategies | own).items()
    }


def own_allocation_of(robot_type: str) -> str:
    """The key of the allocation of a single robot type, among recorded strategies."""
    return f"allocation of {robot_type}"


def changed(header: Content, rules: Content) -> Content:
    """The header with the scenario and the strategies that apply after a CONDITIONS frame."""
    return {**header, "scenario": rules["scenario"], "strategies": rules["strategies"]}


def resolved_of(header: Content, with_strategies: bool = True) -> Resolved:
    """The scenario of a recording, ready to run again.

    Raises InputError if a strategy is not installed or now takes other parameters. Without its
    strategies, which a replay does not need, plug-ins keep their recorded parameters.
    """

    def choice_of(layer: str, given: Content) -> StrategyChoice:
        if with_strategies or lookup.is_built_in(layer, given["name"]):
            return _strategy_choice(layer, **given)
        return StrategyChoice(given["name"], AsRecorded(given["parameters"]))

    start = header["start"]
    scenario = msgspec.convert(header["scenario"], Scenario)
    keys = (own_allocation_of(kind.name) for kind in scenario.fleet.types)
    recorded = [header["strategies"].get(key) for key in keys]
    own = tuple(one and choice_of("allocation", one) for one in recorded)
    drawn = floor_plan_of(header["floor"])
    resolved = Resolved(
        scenario=scenario,
        floor_plan=with_limits_and_streets(scenario, drawn, is_closed=True),
        strategies={layer: choice_of(layer, header["strategies"][layer]) for layer in LAYER_NAMES},
        own_allocations=own if any(own) else (),
        start=start if isinstance(start, str) else tuple(start),  # type: ignore[arg-type]
        source=header["text"],
        overrides=tuple(header["overrides"]),
        observed="observed" in header,
    )
    return in_fine_ticks(resolved)


def floor_plan_of(floor: Content) -> FloorPlan:
    """The floor of a header."""
    return FloorPlan(
        width=floor["width"],
        height=floor["height"],
        starts=tuple(floor["starts"]),
        numbered=tuple(floor["numbered"]),
        **{name: floor[name] for name in FLOOR_ARRAYS},
    )


def _strategy_choice(layer: str, name: str, parameters: Content) -> StrategyChoice:
    wanted = lookup.parameters_type(layer, name)
    try:
        return StrategyChoice(name, msgspec.convert(parameters, wanted))
    except msgspec.ValidationError as error:
        raise InputError(
            f"the recorded parameters of the {layer} strategy {name!r} are not valid for it now: "
            f"{error}"
        ) from None


def state_of(world: Any, names: dict[str, tuple[str, ...]]) -> Content:
    """Copies of arrays of a world, robots by identity: {"robots": {"cell": ...}, ...}."""
    state: Content = {}
    for part, fields in names.items():
        arrays = {name: getattr(getattr(world, part), name) for name in fields}
        if part == "robots":
            by_identity = world.robots.at_index
            arrays = {name: array[by_identity] for name, array in arrays.items()}
        state[part] = {name: np.array(array) for name, array in arrays.items()}
    return state
