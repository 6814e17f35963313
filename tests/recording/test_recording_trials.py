"""Hostile recordings do no harm: the trials of recording_trials.py in small."""

from __future__ import annotations

import zlib
from pathlib import Path

import pytest
from recording_trials import MEMORY, Worker, flipped, mutant, recorded, trials

from automaton.errors import InputError
from automaton.recording.contents import FRAME_KIND_HEADER, MAX_BYTES
from automaton.recording.frames import Chain, Payload, preamble
from automaton.recording.recording_reader import read_recording


def test_altered_and_damaged_recordings_end_in_one_sentence(tmp_path: Path) -> None:
    for name in ("crossing", "depots", "factory", "factory-single", "tabletop-mini"):
        recorded(name)
    worker = Worker(tmp_path)
    for make, count in ((mutant, 120), (flipped, 40)):
        counts, bad, peak = trials(make, range(count), worker)
        assert bad == [] and counts.total() == count
        assert peak < MEMORY
    worker.end()


def test_a_trial_notices_a_crash(tmp_path: Path) -> None:
    worker = Worker(tmp_path)
    worker.path.mkdir()  # where the file should go
    told, _ = worker.tried(b"", [])
    assert told.startswith("internal error: IsADirectoryError")
    worker.end()


def test_what_a_small_file_unpacks_to_is_bounded(tmp_path: Path) -> None:
    path = tmp_path / "bomb.rec"
    data = zlib.compress(bytes(MAX_BYTES[FRAME_KIND_HEADER] + 1))
    path.write_bytes(preamble() + Chain().framed(Payload(FRAME_KIND_HEADER, 0, data)))
    assert len(data) < 200_000
    with pytest.raises(InputError, match=f"has more than {MAX_BYTES[FRAME_KIND_HEADER]:,} bytes"):
        read_recording(path)
