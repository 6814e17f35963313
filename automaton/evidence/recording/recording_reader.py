"""Read the file of a recording: its chain and its header at once, frames as they are asked for."""

from __future__ import annotations

import os
import stat
from collections.abc import Iterator
from pathlib import Path
from typing import BinaryIO

from automaton.engine.record_codes import KEYFRAME_TICKS
from automaton.errors import InputError
from automaton.evidence.recording.admission import Admission
from automaton.evidence.recording.contents import (
    FRAME_KIND_CONDITIONS,
    FRAME_KIND_END,
    FRAME_KIND_HEADER,
    FRAME_KIND_KEYFRAME,
    FRAME_KIND_TICKS,
    FRAME_TICKS,
    MAX_BYTES,
)
from automaton.evidence.recording.frames import (
    FRAME,
    MAGIC,
    PREAMBLE,
    RECORDING_FORMAT,
    Chain,
    Payload,
    Recording,
    StoredFrames,
)


def read_recording(path: str | Path) -> Recording:
    """Open a recording: check the chain of its frames and the header; frames as they are read.

    Raises InputError for a file that is not a recording, has another format, or is damaged. A file
    that was cut short is read to its last whole frame.
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
            f"the recording has format {version}, "
            f"this version of automaton reads format {RECORDING_FORMAT}",
            file,
        )


def _frames_of(stream: BinaryIO, size: int, file: str) -> Iterator[Payload]:
    """The frames of a file behind its preamble. Raises InputError for damage."""
    chain, sequence = Chain(), Sequel()
    at, number = PREAMBLE.size, 0

    def damaged(why: str) -> InputError:
        kept = f"; ticks 0 to {sequence.tick:,} come before it, and `head -c {at} FILE > NEW` keeps them"
        text = f"damaged: frame {number} at byte {at:,} {why}"
        return InputError(text + (kept if sequence.keyframe >= 0 else ""), file)

    while len(head := stream.read(FRAME.size)) == FRAME.size:
        kind, length, tick, _, _ = FRAME.unpack(head)
        if not chain.leads_to(head):
            raise damaged("does not follow the one before it")
        if length > MAX_BYTES.get(kind, 0):
            raise damaged(f"says that it has {length:,} bytes")
        if at + FRAME.size + length > size:
            return  # cut short
        data = stream.read(length)
        if not chain.follow(head, data):
            raise damaged("is not what was written")
        before = sequence.tick
        if why := sequence.check_scenario(kind, tick):
            raise damaged(why)
        yield Payload(kind, tick, data, at, before)
        at, number = at + FRAME.size + length, number + 1
    if sequence.ended and head:
        raise damaged("stands after the end")


class Sequel:
    """In which sequence frames stand, told by their kinds and ticks alone."""

    def __init__(self) -> None:
        self.tick = 0
        self.keyframe = -1  # the tick of the last one
        self.ended = False
        self._number = 0
        self._conditions = 0  # the last tick at which they changed

    def check_scenario(self, kind: int, tick: int) -> str:
        """What is wrong with the next frame, or ""; takes it in."""
        first = (FRAME_KIND_HEADER, FRAME_KIND_CONDITIONS, FRAME_KIND_KEYFRAME)
        number, self._number = self._number, self._number + 1
        if number < len(first) or kind == FRAME_KIND_HEADER:
            wrong = number >= len(first) or kind != first[number] or tick != 0
            self.keyframe = 0 if number == len(first) - 1 else -1
            return "stands out of sequence" if wrong else ""
        if self.ended:
            return "stands after the end"
        if kind == FRAME_KIND_TICKS:
            return self._ticks(tick)
        if tick != self.tick:
            return f"tells of tick {tick:,} after tick {self.tick:,}"
        if kind == FRAME_KIND_KEYFRAME:
            wrong = self.keyframe == tick
            self.keyframe = tick
            return f"is a second state after tick {tick:,}" if wrong else ""
        if kind == FRAME_KIND_CONDITIONS:
            wrong = self.keyframe == tick and tick % KEYFRAME_TICKS > 0
            wrong |= self._conditions == tick > 0
            self._conditions = tick
            return f"changes conditions once more after tick {tick:,}" if wrong else ""
        self.ended = True
        return "" if self.keyframe == tick else f"is an end without the state after tick {tick:,}"

    def _ticks(self, tick: int) -> str:
        before, self.tick = self.tick, tick
        if not before < tick <= before + FRAME_TICKS:
            return f"tells of ticks up to {tick:,} after tick {before:,}"
        if before % KEYFRAME_TICKS == 0 and self.keyframe != before:
            return f"goes on without the state after tick {before:,}"
        if self.keyframe == before and before % KEYFRAME_TICKS:
            return f"goes on after the last state, of tick {before:,}"
        if before // KEYFRAME_TICKS != (tick - 1) // KEYFRAME_TICKS:
            return f"goes past tick {(before // KEYFRAME_TICKS + 1) * KEYFRAME_TICKS:,}"
        return ""
