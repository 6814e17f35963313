"""The lines of a log of robots as rows.

    {"headerId": 7, "timestamp": "2026-03-02T06:00:07Z", "serialNumber": "3", "agvPosition": ...}
    {"topic": "uagv/v2/acme/3/state", "time": ..., "payload": {"headerId": 7, ...}}
    robot,time,x,y,theta,load,charge,state

JSON lines are messages of VDA 5050, versions 2.1 and 3.0, bare or in the envelope of a tool that writes
MQTT messages down; further keys are ignored. CSV files have the columns of the third line, of which the
first four are required. Sources: VDA 5050, versions 2.1.0 and 3.0.0, topic `state`.
"""

from __future__ import annotations

import contextlib
import csv
import datetime
import gzip
import itertools
import math
import re
import zlib
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Annotated, Any, Final

import msgspec

from automaton.errors import InputError, alternatives, nearest

Row = tuple[Any, ...]
Stamp = datetime.datetime | float  # seconds, or milliseconds from MILLISECONDS_FROM on

ROW_FIELDS: Final = (
    *("robot", "time", "x", "y", "theta", "load", "charge", "charging", "driving"),
    *("action", "action_id", "order", "down", "header"),
)
UNKNOWN: Final = -1
NOT_NUMBERED: Final = -1  # header of a message without a number
NAN: Final = math.nan
UNIX_EPOCH: Final = datetime.datetime(1970, 1, 1, tzinfo=datetime.UTC)
MILLISECOND: Final = datetime.timedelta(milliseconds=1)
MILLISECONDS_FROM: Final = 1e11  # numbers from here on are milliseconds, smaller ones seconds
MAX_LINE_BYTES: Final = 1 << 24
MAX_STAMP: Final = 1e15  # milliseconds, some 30,000 years
RUNNING: Final = frozenset(("RUNNING", "INITIALIZING", "PAUSED"))
REQUIRED: Final = ("robot", "time", "x", "y")
CSV_COLUMNS: Final = (*REQUIRED, "theta", "load", "charge", "state")
STATES: Final = {  # what a state in a CSV file says: driving, charging, down
    **dict.fromkeys(("idle", "stopped", "standing"), (0, 0, False)),
    **dict.fromkeys(("waiting", "parked"), (0, 0, False)),
    **dict.fromkeys(("driving", "moving", "executing"), (1, 0, False)),
    "charging": (0, 1, False),
    **dict.fromkeys(("down", "error", "fault", "failed", "fatal", "depleted"), (0, 0, True)),
}
STATE_UNKNOWN: Final = (UNKNOWN, UNKNOWN, False)
NO_LOAD: Final = ("", "0", "-", "none", "no", "false")
CSV_NUMBERS: Final = ("x", "y", "theta", "charge")
SEPARATORS: Final = (";", "\t", ",")  # the first of these in the header wins
MAX_SHOWN: Final = 20  # columns, in an error
LONGEST_HEAD: Final = 10_000  # bytes of the first line of CSV
SEPARATED: Final = re.compile(rb"[,;\t]")
GZIP: Final = b"\x1f\x8b"
BARE: Final = msgspec.Raw()  # the payload of a message without an envelope
BYTE_ORDER_MARK: Final = b"\xef\xbb\xbf"


class _Position(msgspec.Struct):
    """Where a robot is."""

    x: float
    y: float
    theta: float | None = None
    positionInitialized: bool = True
    localized: bool = True


class _Power(msgspec.Struct):
    """The battery of a robot."""

    batteryCharge: float | None = None
    stateOfCharge: float | None = None
    charging: bool | None = None


class _Action(msgspec.Struct):
    """An action of a robot."""

    actionId: str = ""
    actionType: str = ""
    actionStatus: str = ""


class _Load(msgspec.Struct):
    """A load on a robot."""

    loadId: str | None = None
    loadType: str | None = None


class _Error(msgspec.Struct):
    """An error of a robot."""

    errorLevel: str = ""


class _Message(msgspec.Struct):
    """A state message, or the envelope of one."""

    headerId: Annotated[int, msgspec.Meta(ge=0, lt=1 << 62)] | None = None
    timestamp: Stamp | None = None
    version: str = ""
    serialNumber: str | int | None = None
    orderId: str = ""
    agvPosition: _Position | None = None
    mobileRobotPosition: _Position | None = None
    driving: bool | None = None
    actionStates: list[_Action] = []
    loads: list[_Load] | None = None
    batteryState: _Power | None = None
    powerSupply: _Power | None = None
    errors: list[_Error] = []
    topic: str | None = None
    payload: msgspec.Raw = BARE
    time: Stamp | None = None
    tst: datetime.datetime | None = None  # as mosquitto_sub writes it


DECODER: Final = msgspec.json.Decoder(_Message)
TEXT_DECODER: Final = msgspec.json.Decoder(str)


class Numbers(dict[Any, int]):
    """A number from 1 on for each name, in the order of their first use."""

    def __missing__(self, name: Any) -> int:
        number = self[name] = len(self) + 1
        return number


class LogNames:
    """The names in a log."""

    def __init__(self) -> None:
        self.robots, self.loads, self.actions, self.orders = (Numbers() for _ in range(4))
        self.action_ids = Numbers()


class LineReader:
    """Reads files line by line, and counts what it skips."""

    def __init__(self, names: LogNames, columns: Mapping[str, str]) -> None:
        self.names = names
        self.columns = columns
        self.lines = 0
        self.messages = 0
        self.skipped: Counter[str] = Counter()
        self.versions: Counter[str] = Counter()
        self.first_reason = ""  # why the first skipped line of a file is not a message
        self.counts_actions = False  # a file does not number its actions

    def rows(self, path: Path) -> Iterator[Row]:
        """Yield the messages of a file as values of ROW_FIELDS. Raises InputError."""
        self.first_reason = ""
        try:
            with path.open("rb") as raw, contextlib.ExitStack() as stack:
                is_packed = raw.peek(2)[:2] == GZIP
                stream = stack.enter_context(gzip.open(raw)) if is_packed else raw
                first = next(_lines(stream), b"")
                if not first:
                    raise InputError("is empty", str(path))
                is_json = first.lstrip(BYTE_ORDER_MARK + b" ")[:1] in (b"{", b"[")
                if not is_json and len(first) < LONGEST_HEAD and not SEPARATED.search(first):
                    text = "is not a log: neither JSON objects nor a CSV file with robot,time,x,y"
                    raise InputError(text, str(path), 1)
                read = self._json_rows if is_json else self._csv_rows
                for row in read(itertools.chain([first], _lines(stream)), str(path)):
                    self.messages += 1
                    yield row
        except (OSError, EOFError, zlib.error) as error:
            reason = getattr(error, "strerror", None) or str(error)
            raise InputError(f"cannot be read: {reason.lower()}", str(path)) from None

    def _skip(self, reason: str, line: int) -> None:
        if not self.first_reason:
            self.first_reason = f"; line {line:,} is skipped: {reason}"
        self.skipped[reason] += 1

    def _json_rows(self, lines: Iterable[bytes], file: str) -> Iterator[Row]:
        for number, line in enumerate(lines, 1):
            if line.isspace():
                continue
            self.lines += 1
            try:
                message = DECODER.decode(line.lstrip(BYTE_ORDER_MARK))
                sent = message.timestamp or message.time or message.tst
                if message.payload is not BARE:
                    if message.topic is not None and not message.topic.endswith("state"):
                        self._skip("other topic", number)
                        continue
                    message = _unpacked(message.payload)
                    sent = message.timestamp or sent
            except (msgspec.MsgspecError, ValueError, RecursionError):
                is_cut = not line.endswith(b"\n")
                self._skip("line cut short" if is_cut else "unreadable", number)
                continue
            if message.driving is None:
                self._skip("other message", number)
            elif message.serialNumber is None:
                self._skip("no robot", number)
            elif sent is None or (isinstance(sent, float) and not abs(sent) < MAX_STAMP):
                self._skip("no time", number)
            else:
                self.versions[message.version] += 1
                yield self._row(message, _milliseconds(sent))

    def _row(self, message: _Message, stamp: int) -> Row:
        names = self.names
        robot = names.robots[str(message.serialNumber)]
        place = message.agvPosition or message.mobileRobotPosition
        power = message.batteryState or message.powerSupply
        x = y = theta = charge = NAN
        if place is not None and place.positionInitialized and place.localized:
            x, y = place.x, place.y
            theta = NAN if place.theta is None else place.theta
        charging = UNKNOWN
        if power is not None:
            level = power.stateOfCharge if power.batteryCharge is None else power.batteryCharge
            charge = NAN if level is None else level
            charging = UNKNOWN if power.charging is None else power.charging
        action = action_id = 0
        for one in message.actionStates:
            if one.actionStatus in RUNNING:
                action = names.actions[one.actionType]
                action_id = names.action_ids[robot, one.actionId]
                break
        load = 0
        if message.loads is None:
            load = UNKNOWN
        elif message.loads:
            load = names.loads[message.loads[0].loadId or message.loads[0].loadType or ""]
        return (
            *(robot - 1, stamp, x, y, theta, load, charge, charging),
            *(message.driving, action, action_id),
            names.orders[message.orderId] if message.orderId else 0,
            any(error.errorLevel == "FATAL" for error in message.errors),
            NOT_NUMBERED if message.headerId is None else message.headerId,
        )

    def _csv_rows(self, lines: Iterable[bytes], file: str) -> Iterator[Row]:
        texts = (line.decode("utf-8", "replace") for line in lines)
        first = next(texts, "").lstrip("\ufeff")
        separator = next((sign for sign in SEPARATORS if sign in first), ",")
        reader = csv.reader(itertools.chain([first], texts), delimiter=separator)
        try:
            places = self._places([name.strip() for name in next(reader, [])], file)
            width = max(places.values()) + 1
            for cells in reader:
                if not any(cells):
                    continue
                self.lines += 1
                if len(cells) < width:
                    self._skip("too few values", reader.line_num)
                    continue
                values = {name: cells[place].strip() for name, place in places.items()}
                try:
                    row = self._csv_row(values, separator == ";")
                except (ValueError, OverflowError):
                    self._skip("time, position or charge unreadable", reader.line_num)
                    continue
                self.versions[""] += 1
                yield row
        except csv.Error as error:
            raise InputError(f"is neither JSON nor CSV: {error}", file, reader.line_num) from None
        self.counts_actions = True

    def _places(self, head: Sequence[str], file: str) -> dict[str, int]:
        """The place of each field in the rows of a CSV file. Raises InputError."""
        unknown = next((name for name in self.columns if name not in CSV_COLUMNS), None)
        if unknown is not None:
            hint = nearest(unknown, CSV_COLUMNS)
            raise InputError(
                f"--column {unknown}=... is not possible{hint}; use {alternatives(CSV_COLUMNS)}"
            )
        columns = {name: self.columns.get(name, name) for name in CSV_COLUMNS}
        alike = {one.lower(): one for one in reversed(head)}
        columns = {
            name: one if one in head else alike.get(one.lower(), one)
            for name, one in columns.items()
        }
        for name, column in columns.items():
            if column not in head and (name in REQUIRED or name in self.columns):
                known = [one for one in head if one.isprintable()][:MAX_SHOWN]
                hint = "" if name in self.columns else f"; use --column {name}=NAME"
                text = f"there is no column '{column}'{nearest(column, known)}{hint}"
                raise InputError(f"{text}; the columns are {', '.join(known)}", file, 1)
        return {name: head.index(column) for name, column in columns.items() if column in head}

    def _csv_row(self, values: Mapping[str, str], is_comma_decimal: bool) -> Row:
        """A row from texts. Raises ValueError."""
        names, stamp = self.names, _milliseconds(_moment(values["time"]))
        numbers = {name: _number(values.get(name, ""), is_comma_decimal) for name in CSV_NUMBERS}
        state = values.get("state", "").lower()
        driving, charging, is_down = STATES.get(state, (0, 0, False) if state else STATE_UNKNOWN)
        action = names.actions[state] if state and state not in STATES else 0
        load = values.get("load")
        if not values["robot"]:
            raise ValueError("a row without a robot")
        return (
            names.robots[values["robot"]] - 1,
            stamp,
            *(numbers[name] for name in ("x", "y", "theta")),
            UNKNOWN if load is None else 0 if load.lower() in NO_LOAD else names.loads[load],
            *(numbers["charge"], charging, driving, action, 0, 0, is_down, NOT_NUMBERED),
        )


def _lines(stream: Any) -> Iterator[bytes]:
    """The lines of a file; longer ones are cut, so that memory stays bounded."""
    while line := stream.readline(MAX_LINE_BYTES):
        yield line


def _unpacked(payload: msgspec.Raw) -> _Message:
    """The message in an envelope, as an object or as its text. Raises MsgspecError."""
    data = bytes(payload)
    return DECODER.decode(TEXT_DECODER.decode(data) if data[:1] == b'"' else data)


def _milliseconds(stamp: Stamp) -> int:
    """Milliseconds since 1970. Raises ValueError for a number beyond all times."""
    if isinstance(stamp, datetime.datetime):
        zoned = stamp if stamp.tzinfo is not None else stamp.replace(tzinfo=datetime.UTC)
        return (zoned - UNIX_EPOCH) // MILLISECOND
    if not abs(stamp) < MAX_STAMP:
        raise ValueError("not a time")
    return round(stamp if stamp >= MILLISECONDS_FROM else 1000 * stamp)


def _moment(text: str) -> Stamp:
    """A time in a CSV file. Raises ValueError."""
    try:
        return float(text)
    except ValueError:
        return datetime.datetime.fromisoformat(text)


def _number(text: str, is_comma_decimal: bool) -> float:
    """A number in a CSV file, or NaN for none. Raises ValueError."""
    if not text:
        return NAN
    return float(text.replace(",", ".") if is_comma_decimal else text)
