"""Whether hostile recordings do harm: long trials, run by hand.

    python tests/helpers/recording_trials.py [MUTANTS [FLIPS [FIRST]]]

Recordings of shipped scenarios are taken apart, altered in values, types, shapes, lengths, depths
and sequence, and put together again with right seals; others have a bit flipped. Each is verified and
played to its end by a worker with 1 GB of memory and 10 s. It must end in one sentence that names the
file, or be what was recorded: verified with the same metrics, or found to differ. Prints what was
counted and exits with 1 if a worker crashes, hangs or raises anything else. The tests run it in small.
"""

from __future__ import annotations

import copy
import functools
import random
import resource
import signal
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Callable
from multiprocessing import get_context
from multiprocessing.connection import Connection
from pathlib import Path
from typing import Any

import msgspec
import numpy as np

from automaton.errors import InputError
from automaton.recording.contents import FRAME_KIND_END, FRAME_KIND_TICKS, array_out
from automaton.recording.frames import Chain, Payload, Recording, preamble, tick_of

SECONDS = 10
MEMORY = 1 << 30  # bytes that may be in use
SPACE = 8 << 30  # and of addresses: code that is compiled asks for far more than it uses
MUTANTS, FLIPS = 10_000, 2_000
CASES: dict[str, tuple[str, ...]] = {
    "tabletop-mini": ("stop.max_duration=120",),
    "crossing": (),
    "depots": ("stop.max_duration=100",),
    "factory": ("stop.max_duration=120",),
    "goods-mini": (),
    "factory-single": (
        "stop.max_duration=120",
        "faults={failure_probability: 0.01, tow_after: 20, repair_time: 20}",
    ),
}
NUMBERS = (
    -(2**63),
    -(2**31),
    -2,
    -1,
    0,
    1,
    2,
    3,
    7,
    63,
    255,
    256,
    2**16,
    2**31 - 1,
    2**32,
    2**63 - 1,
)
HOSTILE = (None, True, "", "x", "\x1b[2J", "a:B", 0.5, float("nan"), [], {}, b"", [[]], {"": 1})
Chance = random.Random


@functools.cache
def recorded(name: str) -> bytes:
    """A small recording of a shipped scenario; what verifies and plays it is compiled."""
    from automaton.recording.frames import encoded
    from automaton.recording.recorder import MemoryRecorder
    from automaton.runs.simulation import Simulation
    from automaton.world.resolve import resolve

    resolved = resolve(name, CASES[name])
    memory = MemoryRecorder(resolved)
    Simulation(resolved, on_record=memory).run()
    made = memory.recording()
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "good.rec"
        path.write_bytes(encoded(made.header, made.frames))
        assert outcome_of(path, figures_of(made)) == "verified"
        return path.read_bytes()


@functools.cache
def taken_apart(name: str) -> tuple[tuple[int, Any], ...]:
    """(kind, content as stored) of each frame."""
    from automaton.recording.contents import inflated
    from automaton.recording.frames import FRAME, PREAMBLE

    data, at, parts = recorded(name), PREAMBLE.size, []
    while at < len(data):
        kind, length, *_ = FRAME.unpack_from(data, at)
        at += FRAME.size + length
        raw = inflated(data[at - length : at], 1 << 30)
        parts.append((kind, msgspec.msgpack.decode(raw, ext_hook=_array)))
    return tuple(parts)


def _array(code: int, data: memoryview) -> Any:
    name, shape, content = msgspec.msgpack.decode(data)
    return np.frombuffer(content, np.dtype(name)).reshape(shape).copy()


def put_together(parts: list[tuple[int, Any]], chance: Chance | None = None) -> bytes:
    """The file of altered frames, all seals right; ticks in heads follow their contents."""
    import zlib

    chain, out = Chain(), [preamble()]
    for kind, content in parts:
        try:
            tick = tick_of(
                kind,
                {**content, "executed": content["executed"].T}
                if kind == FRAME_KIND_TICKS
                else content,
            )
            tick = tick if 0 <= tick < 2**64 else 0
        except (KeyError, TypeError, ValueError, AttributeError, OverflowError):
            tick = 0
        if chance is not None and chance.random() < 0.02:
            tick = abs(chance.choice(NUMBERS))
        data = zlib.compress(msgspec.msgpack.encode(content, enc_hook=array_out), 1)
        if chance is not None and chance.random() < 0.01:
            data = data[: chance.randrange(len(data))] + chance.randbytes(chance.randrange(4))
        out.append(chain.framed(Payload(kind, tick, data)))
    return b"".join(out)


def mutant(number: int) -> tuple[str, bytes]:
    """The scenario and the bytes of an altered recording; the same number gives the same."""
    chance = random.Random(number)
    name = chance.choice(sorted(CASES))
    parts = [(kind, copy.deepcopy(content)) for kind, content in taken_apart(name)]
    for _ in range(chance.choice((1, 1, 1, 2, 4))):
        chance.choice((_values, _values, _values, _values, _sequence, _sizes))(parts, chance)
    return name, put_together(parts, chance if chance.random() < 0.2 else None)


def _values(parts: list[tuple[int, Any]], chance: Chance) -> None:
    """Alter a value somewhere within a frame."""
    if not parts:
        return
    at = 0 if chance.random() < 0.4 else chance.randrange(len(parts))
    content = parts[at][1]
    holder: Any = content
    while isinstance(holder, dict | list) and holder:
        key = (
            chance.choice(list(holder))
            if isinstance(holder, dict)
            else chance.randrange(len(holder))
        )
        inner = holder[key]
        if isinstance(inner, dict | list) and inner and chance.random() < 0.9:
            holder = inner
            continue
        _alter(holder, key, inner, chance)
        return


def _alter(holder: Any, key: Any, value: Any, chance: Chance) -> None:
    if isinstance(value, np.ndarray) and chance.random() < 0.9:
        holder[key] = _altered(value, chance)
    elif isinstance(value, int) and not isinstance(value, bool) and chance.random() < 0.8:
        holder[key] = max(-(2**63), min(2**63, chance.choice((*NUMBERS, value + 1, value - 1))))
    elif isinstance(value, str) and chance.random() < 0.5:
        holder[key] = value[: chance.randrange(len(value) + 1)] + chance.choice("ax:/.-\x00é")
    elif isinstance(holder, dict) and chance.random() < 0.2:
        del holder[key]
    elif isinstance(holder, dict) and chance.random() < 0.2:
        holder[f"{key}x"] = value
    elif isinstance(holder, list) and chance.random() < 0.4:
        holder.insert(key, value)
    else:
        holder[key] = chance.choice((*HOSTILE, *NUMBERS))


def _altered(array: Any, chance: Chance) -> Any:
    what = chance.randrange(8)
    if what < 4 and array.size and array.dtype.kind in "iu":
        flat = array.reshape(-1)
        for _ in range(chance.choice((1, 1, 2, 10))):
            least, most = np.iinfo(array.dtype).min, np.iinfo(array.dtype).max
            near = int(flat[chance.randrange(array.size)]) + chance.choice((-1, 0, 1))
            wanted = chance.choice((*NUMBERS, near, near, near))
            flat[chance.randrange(array.size)] = max(least, min(most, wanted))
        return array
    if what == 4:
        return array.astype(chance.choice(("u1", "i2", "i4", "i8", "f4", "f8", "u8", "c8", "S3")))
    if what == 5:
        return array.reshape(-1)[: chance.randrange(array.size + 1)]
    if what == 6:
        return np.concatenate([array, array], axis=chance.randrange(max(1, array.ndim)))
    return array.T.copy() if array.ndim > 1 else array.reshape(1, -1)


def _sizes(parts: list[tuple[int, Any]], chance: Chance) -> None:
    """Make something long, wide or deep that packs to almost nothing."""
    content = chance.choice(parts)[1] if parts else {}
    holders = [content, *(part for part in content.values() if isinstance(part, dict))]
    holder = chance.choice(holders)
    if not holder:
        return
    key = chance.choice(list(holder))
    value = holder[key]
    many = chance.choice((300, 70_000, 3_000_000))
    if isinstance(value, np.ndarray):
        rows = chance.choice((many, 2**31 - 1, 2**28))
        shapes = ((many,), (4, many), (many, 2), (rows, 0), (0, rows), (rows, 0, 0))
        holder[key] = np.zeros(chance.choice(shapes), value.dtype)
    elif isinstance(value, str | list) and chance.random() < 0.7:
        holder[key] = chance.choice((["x"] * many, [1] * many, "\x00" * many, [[]] * many))
    elif isinstance(value, dict) and chance.random() < 0.5:
        holder[key] = {str(number): "" for number in range(min(many, 70_000))}
    else:
        for _ in range(chance.choice((39, 41, 300, 450))):
            value = [value] if chance.random() < 0.5 else {"a": value}
        holder[key] = value


def _sequence(parts: list[tuple[int, Any]], chance: Chance) -> None:
    """Drop, double, move or rename a frame."""
    if len(parts) < 2:
        return
    at, other = chance.randrange(len(parts)), chance.randrange(len(parts))
    what = chance.randrange(4)
    if what == 0:
        del parts[at]
    elif what == 1:
        parts.insert(other, copy.deepcopy(parts[at]))
    elif what == 2:
        parts.insert(other, parts.pop(at))
    else:
        parts[at] = (chance.choice((0, 1, 2, 3, 4, 5, 9, 255)), parts[at][1])


def flipped(number: int) -> tuple[str, bytes]:
    """The scenario and the bytes of a recording with one bit flipped."""
    chance = random.Random(f"flip {number}")
    name = chance.choice(sorted(CASES))
    data = bytearray(recorded(name))
    data[chance.randrange(len(data))] ^= 1 << chance.randrange(8)
    return name, bytes(data)


def outcome_of(path: Path, figures: Any) -> str:
    """What becomes of a file that is verified and played to its end; "" if that is well."""
    from automaton.history.watched_run import ReplayedRun
    from automaton.recording.recording_reader import read_recording
    from automaton.verification.verification import verify_recording

    said = []
    for use in ("verify", "play"):
        try:
            recording = read_recording(path)
            if use == "verify":
                found = verify_recording(recording)
                said.append("verified" if found.passed else "differs")
                if found.passed and recording.complete and figures_of(recording) != figures:
                    return "verified with other metrics"
            else:
                run = ReplayedRun(recording)
                before = -1
                while before < run.tick < run.head or before < 0:
                    before = run.tick
                    run.show(run.head, 1.0)
        except InputError as error:
            text = str(error)
            said.append("refused")
            if "\n" in text or (use == "verify" and not text):
                return f"no sentence: {text!r}"
    return "/".join(said)


def figures_of(recording: Recording) -> Any:
    return [frame.content["metrics"] for frame in recording.frames if frame.kind == FRAME_KIND_END]


def peak_memory() -> int:
    """Return the most bytes that this process has had; `ru_maxrss` counts those of its parent, too."""
    status = Path("/proc/self/status")
    if not status.exists():
        return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024
    lines = dict(line.split(":", 1) for line in status.read_text().splitlines())
    return int(lines["VmHWM"].split()[0]) * 1024


def work(pipe: Connection, path: str) -> None:
    """Try the files that are named, one after another, within bounds."""
    resource.setrlimit(resource.RLIMIT_AS, (SPACE, SPACE))
    while True:
        data, figures = pipe.recv()
        signal.alarm(SECONDS)
        try:
            Path(path).write_bytes(data)
            told = outcome_of(Path(path), figures)
        except MemoryError:
            told = "out of memory"
        except BaseException as error:  # what would be an internal error
            import traceback

            where = traceback.extract_tb(error.__traceback__)[-1]
            place = f"{Path(where.filename).name}:{where.lineno}"
            told = f"internal error: {type(error).__name__} at {place}: {str(error)[:90]}"
        signal.alarm(0)
        pipe.send((told, peak_memory()))


class Worker:
    """A process that tries files; restarted when it dies."""

    def __init__(self, folder: Path) -> None:
        self.path = folder / "trial.rec"
        self._begin()

    def _begin(self) -> None:
        context = get_context("spawn")
        self._pipe, theirs = context.Pipe()
        self._process = context.Process(target=work, args=(theirs, str(self.path)), daemon=True)
        self._process.start()
        theirs.close()

    def tried(self, data: bytes, figures: Any) -> tuple[str, int]:
        """(what became of it, most bytes of memory so far)"""
        try:
            self._pipe.send((data, figures))
            told: tuple[str, int] = self._pipe.recv()
            return told
        except (EOFError, BrokenPipeError, ConnectionResetError):
            self._process.join()
            code = self._process.exitcode
            self._begin()
            return ("hang" if code == -signal.SIGALRM else f"crash: exit code {code}"), 0

    def end(self) -> None:
        self._process.terminate()
        self._process.join()


def trials(
    make: Callable[[int], tuple[str, bytes]], numbers: range, worker: Worker
) -> tuple[Counter[str], list[str], int]:
    """(what became of them, what must not be, most bytes of memory)"""
    counts: Counter[str] = Counter()
    bad: list[str] = []
    peak = 0
    for number in numbers:
        name, data = make(number)
        figures = [
            content["metrics"] for kind, content in taken_apart(name) if kind == FRAME_KIND_END
        ]
        told, memory = worker.tried(data, figures)
        peak = max(peak, memory)
        counts[told.partition(":")[0]] += 1
        if told not in ALLOWED or memory > MEMORY:
            bad.append(f"{make.__name__} {number} ({name}): {told}, {memory >> 20} MiB")
    return counts, bad, peak


ALLOWED = {
    *("verified", "differs", "refused"),
    *("verified/refused", "differs/refused", "refused/refused"),
}


def main(arguments: list[str]) -> int:
    """Run the trials; 1 if one of them ended as it must not."""
    mutants, flips, first, *_ = [*map(int, arguments), *(MUTANTS, FLIPS, 0)[len(arguments) :]]
    begun = time.monotonic()
    for name in CASES:
        recorded(name)
    with tempfile.TemporaryDirectory() as folder:
        worker = Worker(Path(folder))
        failed = []
        for make, count in ((mutant, mutants), (flipped, flips)):
            counts, bad, peak = trials(make, range(first, first + count), worker)
            print(f"{make.__name__}: {dict(counts)}, at most {peak >> 20} MiB", flush=True)
            failed += bad
        worker.end()
    print("\n".join(failed[:40]))
    print(f"{len(failed)} of {mutants + flips} ended badly; {time.monotonic() - begun:.0f} s")
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
