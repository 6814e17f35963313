"""Frames as MP4, by the program ffmpeg where it is installed."""

from __future__ import annotations

import os
import shutil
import subprocess
import tempfile
from collections.abc import Iterable
from contextlib import suppress
from pathlib import Path
from typing import Final

from automaton.atomic_write import put_in_place
from automaton.errors import InputError

SAME_BYTES: Final = ("-map_metadata", "-1", "-fflags", "+bitexact", "-flags:v", "+bitexact")
FOR_PLAYERS: Final = ("-pix_fmt", "yuv420p", "-movflags", "+faststart")


def ffmpeg() -> str:
    """The program. Raises InputError where it is not installed."""
    program = shutil.which("ffmpeg")
    if program is None:
        raise InputError(
            "an MP4 is made by the program ffmpeg, which is not installed: install the package ffmpeg, "
            "or write FILE.gif"
        )
    return program


def write_mp4(frames: Iterable[bytes], width: int, height: int, fps: int, path: Path) -> int:
    """Write frames of red, green and blue bytes; the size of the file. Raises InputError, OSError."""
    part = path.with_name(f".{path.name}.{os.getpid()}.part")
    command = [
        *(ffmpeg(), "-loglevel", "error", "-y", "-f", "rawvideo", "-pix_fmt", "rgb24"),
        *("-s", f"{width}x{height}", "-r", str(fps), "-i", "-", "-an", "-c:v", "libx264"),
        *("-crf", "20", *FOR_PLAYERS, *SAME_BYTES, "-f", "mp4", str(part)),
    ]
    try:
        with tempfile.TemporaryFile() as said:
            process = subprocess.Popen(command, stdin=subprocess.PIPE, stdout=said, stderr=said)
            try:
                _send(process, frames)
            except BaseException:
                process.kill()
                raise
            finally:
                status = process.wait()
            if status:
                said.seek(0)
                lines = said.read().decode(errors="replace").strip().splitlines() or ["no reason"]
                raise InputError(f"ffmpeg could not make the film: {lines[-1].strip()}", str(path))
        put_in_place(part, path)
        return path.stat().st_size
    finally:
        with suppress(OSError):
            part.unlink(missing_ok=True)


def _send(process: subprocess.Popen[bytes], frames: Iterable[bytes]) -> None:
    """Give ffmpeg the frames; if it ends early, its status says so."""
    assert process.stdin is not None
    with suppress(BrokenPipeError), process.stdin:
        for frame in frames:
            process.stdin.write(frame)
