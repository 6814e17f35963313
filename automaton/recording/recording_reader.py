"""Read the file of a recording: its chain and its header at once, frames on request.

Before any other use, the header is checked for consistency with itself, its floor and the rules for
scenarios, and each frame against the header. A title names the run.
"""

from __future__ import annotations

import os
import stat
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any, BinaryIO, Final, NamedTuple

import msgspec
import numpy as np

from automaton.engine.record_codes import KEYFRAME_TICKS
from automaton.errors import InputError, refuse
from automaton.floor.floor_plan import (
    CELL_KINDS,
    DIRECTION_VECTORS,
    NIL,
    SHELF,
    STATION,
    STORAGE,
    FloorPlan,
    bays_of,
)
from automaton.recording.contents import (
    CONDITIONS_ARRAYS,
    FRAME_KIND_CONDITIONS,
    FRAME_KIND_END,
    FRAME_KIND_HEADER,
    FRAME_KIND_KEYFRAME,
    FRAME_KIND_TICKS,
    FRAME_TICKS,
    HEADER_ARRAYS,
    MAX_BYTES,
    OF_SKUS,
    Content,
    InvalidFrameError,
    check_arrays,
    check_changes,
    check_keyframe,
    refusal,
)
from automaton.recording.frames import (
    FRAME,
    MAGIC,
    PREAMBLE,
    RECORDING_FORMAT,
    Chain,
    Payload,
    Recording,
    StoredFrames,
    decode,
    floor_plan_of,
    own_allocation_of,
    tick_of,
)
from automaton.scenario.floor_section import Floor, generator_type, is_shipped
from automaton.scenario.order_lines import carries_pods, plain_data
from automaton.scenario.orders import MAX_DRAWN_LINES, MAX_STOPS, LineDemand
from automaton.scenario.schema import LAYER_NAMES, Scenario
from automaton.scenario.validation import validated
from automaton.strategy import lookup
from automaton.world.feasibility import check_energy, feasible_fleet
from automaton.world.floor_parts import check_speed_limits
from automaton.world.resolve import CHANGEABLE, Resolved, choose_strategies, choose_strategy
from automaton.world.task_lists import order_count


def read_recording(path: str | Path) -> Recording:
    """Open a recording: check the chain of its frames and the header now, other frames when read.

    Raises InputError for a file that is not a recording, has another format, or is damaged. A file
    cut short is read up to its last whole frame.
    """
    file = str(path)
    try:
        if not stat.S_ISREG(os.stat(path).st_mode):
            raise InputError("cannot read the recording: this is not a regular file", file)
        with open(path, "rb") as stream:
            _check_preamble(stream.read(PREAMBLE.size), file)
            payloads = list(_frames_of(stream, os.stat(path).st_size, file))
    except OSError as error:
        raise InputError(f"cannot read the recording: {error.strerror}", file) from None
    if not payloads:
        raise InputError("the recording is cut short before its first frame ends", file)
    admission = Admission(file, payloads[0])
    frames = StoredFrames(payloads[1:], admission.content)
    return Recording(admission.header, frames, complete=payloads[-1].kind == FRAME_KIND_END)


def _check_preamble(data: bytes, file: str) -> None:
    if not data:
        raise InputError("the file is empty, not a recording", file)
    if data[: len(MAGIC)] != MAGIC[: len(data)]:
        raise InputError("this is not a recording of automaton", file)
    if len(data) < PREAMBLE.size:
        raise InputError("the recording is cut short before its first frame ends", file)
    version = PREAMBLE.unpack(data)[1]
    if version != RECORDING_FORMAT:
        raise InputError(
            f"the recording has format {version}, but this version of automaton reads format "
            f"{RECORDING_FORMAT}",
            file,
        )


def _frames_of(stream: BinaryIO, size: int, file: str) -> Iterator[Payload]:
    """The frames of a file after its preamble. Raises InputError for damage."""
    chain, sequence = Chain(), Sequel()
    at, number = PREAMBLE.size, 0

    def damaged(why: str) -> InputError:
        kept = (
            f"; ticks 0 to {sequence.tick:,} before it are intact; `head -c {at} FILE > NEW` "
            "saves them"
        )
        text = f"damaged: frame {number} at byte {at:,} {why}"
        return InputError(text + (kept if sequence.keyframe >= 0 else ""), file)

    while len(head := stream.read(FRAME.size)) == FRAME.size:
        kind, length, tick, _, _ = FRAME.unpack(head)
        if not chain.leads_to(head):
            raise damaged("does not continue the chain of the previous frame")
        if length > MAX_BYTES.get(kind, 0):
            raise damaged(f"has an invalid length of {length:,} bytes")
        if at + FRAME.size + length > size:
            return  # cut short
        data = stream.read(length)
        if not chain.follow(head, data):
            raise damaged("has a wrong checksum")
        before = sequence.tick
        if why := sequence.check_scenario(kind, tick):
            raise damaged(why)
        yield Payload(kind, tick, data, at, before)
        at, number = at + FRAME.size + length, number + 1
    if sequence.ended and head:
        raise damaged("follows the end frame")


class Sequel:
    """Check of the sequence of frames, by kinds and ticks only."""

    def __init__(self) -> None:
        self.tick = 0
        self.keyframe = -1  # tick of the last keyframe
        self.ended = False
        self._number = 0
        self._conditions = 0  # last tick with changed conditions

    def check_scenario(self, kind: int, tick: int) -> str:
        """The fault of the next frame, or ""; advances."""
        first = (FRAME_KIND_HEADER, FRAME_KIND_CONDITIONS, FRAME_KIND_KEYFRAME)
        number, self._number = self._number, self._number + 1
        if number < len(first) or kind == FRAME_KIND_HEADER:
            wrong = number >= len(first) or kind != first[number] or tick != 0
            self.keyframe = 0 if number == len(first) - 1 else -1
            return "is out of sequence" if wrong else ""
        if self.ended:
            return "follows the end frame"
        if kind == FRAME_KIND_TICKS:
            return self._ticks(tick)
        if tick != self.tick:
            return f"has tick {tick:,} after tick {self.tick:,}"
        if kind == FRAME_KIND_KEYFRAME:
            wrong = self.keyframe == tick
            self.keyframe = tick
            return f"is a second keyframe of tick {tick:,}" if wrong else ""
        if kind == FRAME_KIND_CONDITIONS:
            wrong = self.keyframe == tick and tick % KEYFRAME_TICKS > 0
            wrong |= self._conditions == tick > 0
            self._conditions = tick
            return f"changes the conditions of tick {tick:,} twice" if wrong else ""
        self.ended = True
        return "" if self.keyframe == tick else f"is an end without a keyframe of tick {tick:,}"

    def _ticks(self, tick: int) -> str:
        before, self.tick = self.tick, tick
        if not before < tick <= before + FRAME_TICKS:
            return f"holds ticks up to {tick:,} after tick {before:,}"
        if before % KEYFRAME_TICKS == 0 and self.keyframe != before:
            return f"continues without a keyframe of tick {before:,}"
        if self.keyframe == before and before % KEYFRAME_TICKS:
            return f"continues after the last keyframe, of tick {before:,}"
        if before // KEYFRAME_TICKS != (tick - 1) // KEYFRAME_TICKS:
            return f"continues past tick {(before // KEYFRAME_TICKS + 1) * KEYFRAME_TICKS:,}"
        return ""


# Checks of the header by itself, of its floor and scenario, and of each frame.


MAX_CELLS = 200_000_000
MAX_DIGEST_INTERVAL = 64  # ticks
DIGEST_DIGITS = 16


class Admission:
    """The check of one file: its header now, other frames when read."""

    def __init__(self, file: str, first: Payload) -> None:
        """Raises InputError if the header is invalid."""
        self.file = file
        self.sizes: dict[str, int] = {}
        try:
            self.header = decode(FRAME_KIND_HEADER, first.data)
            self._admit_header(self.header)
        except InvalidFrameError as error:
            raise refusal(error, file, 0, FRAME_KIND_HEADER, first.at) from None
        except InputError as error:
            raise refusal(
                InvalidFrameError(error.message), file, 0, FRAME_KIND_HEADER, first.at
            ) from None

    def content(self, index: int, payload: Payload) -> Content:
        """The content of a frame after the header. Raises InputError if it is invalid."""
        kind = payload.kind
        try:
            content = decode(kind, payload.data, self.sizes)
            self._admit(kind, content)
            check_ticks(payload, content)
            return content
        except InvalidFrameError as error:
            raise refusal(error, self.file, index + 1, kind, payload.at) from None
        except InputError as error:
            raise refusal(
                InvalidFrameError(error.message), self.file, index + 1, kind, payload.at
            ) from None

    def _admit(self, kind: int, content: Content) -> None:
        if kind == FRAME_KIND_TICKS:
            check_changes(content["changes"], self.sizes)
        elif kind == FRAME_KIND_KEYFRAME:
            check_keyframe(content, self.sizes)
        elif kind == FRAME_KIND_CONDITIONS:
            self._admit_conditions(content)
        elif kind == FRAME_KIND_END:
            check_digest(content["digest"])

    def _admit_header(self, header: Content) -> None:
        floor, sizes = header["floor"], self.sizes
        width, height = floor["width"], floor["height"]
        if not (width > 0 and height > 0 and (width + 2) * (height + 2) <= MAX_CELLS):
            raise InvalidFrameError(f"invalid floor of {width:,} x {height:,} cells")
        if not 0 <= header["seed"] < 1 << 63:
            raise InvalidFrameError(f"invalid seed {header['seed']}")
        if not 1 <= header["digest_every"] <= MAX_DIGEST_INTERVAL:
            raise InvalidFrameError(f"invalid digest interval of {header['digest_every']:,} ticks")
        sizes |= {"rows": height + 2, "columns": width + 2, "cells": (width + 2) * (height + 2)}
        sizes |= {"spare": header["slots"]["first_spare"], "names": len(header["digest_names"])}
        self.scenario = scenario_of(header["scenario"])
        header["scenario"] = plain_data(self.scenario)
        check_layout(self.scenario.layout)
        sizes["robots"] = self.scenario.fleet.robots
        wanted = self.scenario.orders.lines is not None
        there = [name in header for name in ("pods", "pod_stations", "lines")]
        if there[0] != there[1] or there[2] != wanted or there[2] > there[0]:
            raise InvalidFrameError("its pods, lines or stations do not match its scenario")
        if not wanted:
            sizes["rules"] = sizes["cells"]  # rules of handling; unused without lines
        if ("gates" in header) and not self.scenario.floor.closed:
            raise InvalidFrameError("it has closed cells, but its scenario has none")
        check_arrays(header, HEADER_ARRAYS, sizes)
        if "observed" in header:
            check_changes(header["observed"]["first"], sizes)
        self._check_stops(header)
        self._check_trips(header)
        self.floor_plan = floor_plan_of(floor)
        check_plan(self.floor_plan)
        if there[0] != carries_pods(self.scenario, self.floor_plan):
            raise InvalidFrameError("its pods, lines or stations do not match its scenario")
        self._check_slots(header)
        refuse(check_speed_limits(self.scenario, self.floor_plan))
        start = feasible_fleet(self.scenario, Floor(self.floor_plan)).start
        if start != (
            header["start"] if isinstance(header["start"], str) else tuple(header["start"])
        ):
            raise InvalidFrameError("the start cells of its robots do not match its scenario")
        self._check_strategies(self.scenario, header["strategies"])
        self._check_counts(header)

    def _check_slots(self, header: Content) -> None:
        cells, spare = header["slots"]["cell"], self.sizes["spare"]
        if not 0 <= spare <= len(cells) or not np.array_equal(cells[:spare], self.floor_plan.slots):
            raise InvalidFrameError("its slots do not match its floor")
        stations = header.get("pod_stations", {}).get("cell", self.floor_plan.stations)
        if not np.array_equal(stations, self.floor_plan.stations):
            raise InvalidFrameError("its stations do not match its floor")

    def _check_stops(self, header: Content) -> None:
        """Each order has a load or stops, or both; stops are in the sequence of their orders."""
        orders, sizes = header["orders"], self.sizes
        sizes.setdefault("stops", 0)
        first = orders.get("first_stop")
        if first is None:
            first = np.zeros(sizes["orders"] + 1, np.int32)
        ends = len(first) == sizes["orders"] + 1 and (first[0], first[-1]) == (0, sizes["stops"])
        count = np.diff(first)
        if not ends or (count < 0).any() or (count > MAX_STOPS).any():
            raise InvalidFrameError("its stops do not match its orders")
        without = orders["source"] == NIL
        nowhere = orders["target"] == NIL
        if "pods" in header:  # an order with a pod may end in any storage cell
            nowhere &= ~np.isin(orders["source"], header["pods"]["slot"])
        if not np.array_equal(nowhere, without) or (count[without] == 0).any():
            raise InvalidFrameError("it has an order with neither a load nor stops")

    def _check_trips(self, header: Content) -> None:
        """With lines, there are as many trips as lines, and no trip is released yet."""
        cells = header["stops"]["cell"] if "stops" in header else np.zeros(0, np.int32)
        if self.scenario.orders.lines is None:
            if (cells == NIL).any():
                raise InvalidFrameError("a stop of its orders has no cell")
            if "pods" in header:
                self._check_pods(header)
            return
        orders, sizes = header["orders"], self.sizes
        stops = sizes["lines"] * self.scenario.pods.max_stops
        first = np.arange(0, stops + 1, self.scenario.pods.max_stops)
        if sizes["orders"] != sizes["lines"] or not np.array_equal(orders.get("first_stop"), first):
            raise InvalidFrameError("its trips do not match its lines")
        if (orders["source"] != NIL).any() or (cells != NIL).any():
            raise InvalidFrameError("a trip is released before its lines")
        self._check_pods(header)
        self._check_skus(header)

    def _check_pods(self, header: Content) -> None:
        """Each cell has at most one pod, and listed orders carry existing pods."""
        slots, source = header["pods"]["slot"], header["orders"]["source"]
        if len(np.unique(slots)) != len(slots):
            raise InvalidFrameError("two of its pods stand in one cell")
        if not np.isin(source[source != NIL], slots).all():
            raise InvalidFrameError("an order of its list has no pod")

    def _check_skus(self, header: Content) -> None:
        """Each line needs a pod, or a SKU that some pod holds."""
        there = [name in header[part] for part, arrays in OF_SKUS.items() for name in arrays]
        wants_any = header["lines"]["pod"] == NIL
        if not any(there) and not wants_any.any():
            return
        if not all(there):
            raise InvalidFrameError("arrays for its lines by SKU are missing")
        first, held, wanted = (
            header["pods"]["sku_first"],
            header["pods"]["sku_pod"],
            header["lines"]["sku"][wants_any],
        )
        ends = len(first) > 1 and (first[0], first[-1]) == (0, len(held))
        if not ends or (np.diff(first) < 1).any():
            raise InvalidFrameError("a SKU is in none of its pods")
        if ((wanted < 0) | (wanted >= len(first) - 1)).any():
            raise InvalidFrameError("a line needs a SKU that no pod holds")
        ticks = header["pod_stations"]["ticks_from"]
        if ticks.shape != (self.sizes["stations"], self.sizes["spare"]):
            raise InvalidFrameError("its distances from slots to stations do not match its floor")

    def _check_counts(self, header: Content) -> None:
        """Check the numbers of orders and jobs against the scenario before building a world."""
        orders, jobs = counted(self.scenario, self.floor_plan)
        for name, wanted in (("orders", orders), ("jobs", jobs)):
            is_fewer = self.scenario.orders.has_random_count and self.sizes[name] < wanted
            if self.sizes[name] != wanted and not is_fewer:
                raise InvalidFrameError(
                    f"it has {self.sizes[name]:,} {name}, but its scenario has {wanted:,}"
                )
        coming = header["orders"].get("release_sequence")
        if self.scenario.orders.in_system(self.scenario.fleet.robots) and (
            coming is None or not np.array_equal(np.sort(coming), np.arange(len(coming)))
        ):
            raise InvalidFrameError("the release sequence of its orders is not a permutation")

    def _check_strategies(self, scenario: Scenario, recorded: Content) -> None:
        """Recorded strategies match the names in the scenario; parameters of plug-ins are unknown."""
        given = recorded_strategies(recorded)
        specs = {layer: getattr(scenario.strategy, layer) for layer in LAYER_NAMES}
        for kind in scenario.fleet.types:
            if kind.strategy.allocation is not None:
                specs[own_allocation_of(kind.name)] = kind.strategy.allocation
        if list(given) != list(specs):
            raise InvalidFrameError(f"it has strategies for {', '.join(given) or 'nothing'}")
        for key, spec in specs.items():
            name = spec.get("name") if isinstance(spec, dict) else spec
            if given[key].name != name:
                raise InvalidFrameError(
                    f"strategy.{key} is {name} in the scenario but recorded as {given[key].name}"
                )
        known = [layer for layer in LAYER_NAMES if lookup.is_built_in(layer, given[layer].name)]
        choices = choose_strategies(scenario, self.floor_plan, known)
        for key, spec in specs.items():
            if key not in LAYER_NAMES and lookup.is_built_in("allocation", given[key].name):
                choices[key] = choose_strategy(scenario, "allocation", spec, (key,))
        for key, strategy in choices.items():
            if _as_stored(strategy.parameters) != given[key].parameters:
                raise InvalidFrameError(
                    f"the parameters of strategy.{key} do not match its scenario"
                )

    def _admit_conditions(self, content: Content) -> None:
        check_arrays(content, CONDITIONS_ARRAYS, {})
        scenario = scenario_of(content["scenario"])
        content["scenario"] = plain_data(scenario)
        for name in Scenario.__struct_fields__:
            same = getattr(scenario, name) == getattr(self.scenario, name)
            if not same and (
                name not in CHANGEABLE or not (content["tick"] or content["settings"])
            ):
                raise InvalidFrameError(f"{name} differs from the header")
        refuse(check_energy(scenario, self.floor_plan))
        self._check_strategies(scenario, content["strategies"])


class _RecordedStrategy(msgspec.Struct, forbid_unknown_fields=True):
    name: str
    parameters: dict[str, Any]


def recorded_strategies(recorded: Content) -> dict[str, _RecordedStrategy]:
    """The recorded strategies by layer, then by robot type. Raises InvalidFrameError."""
    try:
        return msgspec.convert(recorded, dict[str, _RecordedStrategy])
    except msgspec.ValidationError as error:
        raise InvalidFrameError(f"its strategies are not valid: {error}") from None


def _as_stored(parameters: msgspec.Struct) -> Any:
    return msgspec.msgpack.decode(msgspec.msgpack.encode(msgspec.to_builtins(parameters)))


def scenario_of(given: Content) -> Scenario:
    """A recorded scenario as a struct. Raises InvalidFrameError."""
    try:
        return msgspec.convert(given, Scenario)
    except msgspec.ValidationError as error:
        raise InvalidFrameError(f"its scenario is not valid: {error}") from None


def counted(scenario: Scenario, floor_plan: FloorPlan) -> tuple[int, int]:
    """The numbers of orders and of jobs at stations in a scenario; the greatest one if it is random."""
    orders = scenario.orders
    if orders.has_random_count:
        return orders.count or MAX_DRAWN_LINES, 0
    if orders.parts is not None:
        jobs = sum(kind.count * len(kind.route) for kind in orders.parts)
        return jobs - sum(kind.count for kind in orders.parts), jobs
    if orders.listed is not None:
        return len(orders.listed), 0
    if orders.lines is not None:
        return orders.lines.drawn if isinstance(orders.lines, LineDemand) else len(orders.lines), 0
    if orders.count is not None or orders.tasks is not None:
        return order_count(scenario, floor_plan), 0
    shelves = floor_plan.kind == SHELF
    drawn = shelves & (floor_plan.loads == 1) if orders.generator == "picture-loads" else shelves
    return int(np.count_nonzero(drawn)), 0


def check_layout(layout: Content) -> None:
    """Check the parameters of a built-in generator. Raises InputError."""
    if is_shipped(layout):
        parameters = {key: value for key, value in layout.items() if key != "generator"}
        validated(parameters, generator_type(layout["generator"]), ("layout",))


def check_plan(floor_plan: FloorPlan) -> None:
    """Check that a generator may have built a floor: no robot can drive off it. Raises
    InvalidFrameError, InputError.
    """
    kinds = np.array([kind.drivable for kind in CELL_KINDS])
    drivable = kinds[floor_plan.kind]
    inside = np.zeros_like(drivable)
    inside[1:-1, 1:-1] = True
    if drivable[~inside].any():
        raise InvalidFrameError("its floor has drivable cells at its edge")
    for direction, (x, y) in enumerate(DIRECTION_VECTORS):
        leads = floor_plan.exits >> direction & 1 == 1
        if (leads & ~(drivable & np.roll(drivable, (-y, -x), (0, 1)))).any():
            raise InvalidFrameError(
                "a cell of its floor has an exit to a cell that is not drivable"
            )
    if not np.array_equal(floor_plan.bays, bays_of(floor_plan.kind)):
        raise InvalidFrameError("its parking bays do not match its floor")
    cells = drivable.reshape(-1)
    if not all(0 <= cell < cells.size and cells[cell] for cell in floor_plan.starts):
        raise InvalidFrameError("its floor has robots on cells that are not drivable")
    stations = np.flatnonzero(floor_plan.kind == STATION).tolist()
    if floor_plan.numbered and sorted(floor_plan.numbered) != stations:
        raise InvalidFrameError("its stations do not match its floor")
    holds = np.isin(floor_plan.kind, (SHELF, STORAGE))
    if (floor_plan.loads[~holds] != 0).any():
        raise InvalidFrameError("its floor has a load on a cell that is not a shelf")


def check_ticks(payload: Payload, content: Content) -> None:
    """Check that a frame holds the ticks named in the file. Raises InvalidFrameError."""
    last = tick_of(payload.kind, content)
    first = content["first"] if payload.kind == FRAME_KIND_TICKS else payload.before + 1
    if (first, last) != (payload.before + 1, payload.tick):
        raise InvalidFrameError(f"it holds ticks up to {last:,} instead of {payload.tick:,}")


def check_digest(text: str) -> None:
    """Raises InvalidFrameError if a value is not a digest."""
    if len(text) != DIGEST_DIGITS or set(text) - set("0123456789abcdef"):
        raise InvalidFrameError("its digest is not 16 hex digits")


# Titles of runs: scenario, fleet, seed and settings; next to another run, differences come first.
#
# tabletop-mini, 3 robots, seed 1, right_of_way=wait, from tick 140 right_of_way=retreat


MAX_TITLE_LENGTH: Final = 24  # longest value; pictures of floors are values too


class Head(NamedTuple):
    """Titles above two maps."""

    own: str  # differences from the other run
    common: str  # what both runs share


def title_of(resolved: Resolved, seed: int, frames: StoredFrames | None = None) -> str:
    """A short title of a run; `frames` tell where it was branched off."""
    branches = () if frames is None else branches_of(frames)
    return ", ".join((*_parts(resolved, seed), *branches))


def branches_of(frames: StoredFrames) -> tuple[str, ...]:
    """The ticks from which settings changed, with these settings. Raises InputError."""
    said: list[str] = []
    tick: int | None = 0
    while tick is not None:
        settings = frames.rules_at(tick)["settings"]
        if settings:
            said.append(f"from tick {tick:,} {' '.join(short(one) for one in settings)}")
        tick = frames.next_rules(tick)
    return tuple(said)


def heads_of(
    names: Sequence[str], recordings: Sequence[Recording], resolved: Sequence[Resolved]
) -> tuple[Head, ...]:
    """The titles of two recordings."""
    seeds = [recording.header["seed"] for recording in recordings]
    branches = [branches_of(recording.stored()) for recording in recordings]
    settings = _differing(recordings)
    parts = [_parts(one, seed) for one, seed in zip(resolved, seeds, strict=True)]
    heads = []
    for side, (name, recording) in enumerate(zip(names, recordings, strict=True)):
        own = list(settings[side])
        own += [f"seed {seeds[side]}"] if len(set(seeds)) > 1 else []
        own += branches[side] if len(set(branches)) > 1 else ()
        own += [] if recording.complete else ["cut short"]
        common = [part for part in parts[side] if part in parts[1 - side]]
        common += branches[side] if len(set(branches)) == 1 else ()
        heads.append(Head(f"{name}: {', '.join(own)}" if own else name, ", ".join(common)))
    return tuple(heads)


def live_heads(one: Resolved, other: Resolved) -> tuple[Head, ...]:
    """The titles of two live runs."""
    resolved = (one, other)
    scenarios = [_flat("", plain_data(each.scenario)) for each in resolved]
    settings = _different(scenarios, scenarios)
    parts = [_parts(each, each.scenario.seed) for each in resolved]
    common = ", ".join(part for part in parts[0] if part in parts[1])
    seeds = [each.scenario.seed for each in resolved]
    heads = []
    for own, seed in zip(settings, seeds, strict=True):
        own += [f"seed {seed}"] if len(set(seeds)) > 1 else []
        heads.append(Head(", ".join(own) or "the same", common))
    return tuple(heads)


def short(setting: str) -> str:
    """The short name of a setting."""
    return setting.removeprefix("strategy.")


def _parts(resolved: Resolved, seed: int) -> tuple[str, ...]:
    robots = resolved.scenario.fleet.robots
    crew = f"{robots:,} robot{'s' if robots != 1 else ''}"
    overrides = (short(one) for one in resolved.overrides)
    return (resolved.scenario.name, crew, f"seed {seed}", *overrides)


def _differing(recordings: Sequence[Recording]) -> list[list[str]]:
    """The settings at the start that differ then or at the end."""
    starts = [_flat("", recording.header["scenario"]) for recording in recordings]
    ends = [_flat("", _last_scenario(recording.stored())) for recording in recordings]
    return _different(starts, ends)


def _different(starts: list[dict[str, str]], ends: list[dict[str, str]]) -> list[list[str]]:
    keys = [
        key
        for key in dict.fromkeys(key for settings in starts for key in settings)
        if key != "seed" and any(len({s.get(key) for s in both}) > 1 for both in (starts, ends))
    ]
    return [[f"{short(key)}={start.get(key, 'none')}" for key in keys] for start in starts]


def _last_scenario(frames: StoredFrames) -> Content:
    scenario: Content = frames.rules_at(frames.last_tick)["scenario"]
    return scenario


def _flat(key: str, value: Any) -> dict[str, str]:
    if isinstance(value, dict):
        prefix = f"{key}." if key else ""
        flat: dict[str, str] = {}
        for name, inner in value.items():
            flat |= _flat(f"{prefix}{name}", inner)
        return flat
    text = " ".join(str(value).split())
    return {key: text if len(text) <= MAX_TITLE_LENGTH else f"{text[: MAX_TITLE_LENGTH - 3]}..."}
