"""The file of a recording: what goes in comes out, and what is cut or damaged is noticed."""

from __future__ import annotations

import copy
import os
import struct
import zlib
from collections.abc import Iterable
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from recording_trials import put_together, taken_apart

from automaton.commands import main
from automaton.engine.record_codes import CHANGE_DURATION, KEYFRAME_TICKS
from automaton.engine.state import World
from automaton.errors import InputError
from automaton.recording import frames as stored
from automaton.recording.contents import (
    FRAME_KIND_END,
    FRAME_KIND_HEADER,
    FRAME_KIND_KEYFRAME,
    FRAME_KIND_TICKS,
    IN_HEADER,
    KEYFRAME_ARRAYS,
    MAX_CHANGES,
    MAX_LABELS,
    MAX_NESTING,
    MAX_PLACES,
    DecodedFrame,
)
from automaton.recording.frames import Recording, preamble, resolved_of
from automaton.recording.recorder import MemoryRecorder, Recorder
from automaton.recording.recording_reader import read_recording
from automaton.runs.simulation import Simulation
from automaton.verification.validator import validate_stored
from automaton.world.resolve import Resolved, resolve

SETTINGS = ("stop.max_duration=600",)


def write(path: Path, name: str = "tabletop-mini", settings: Iterable[str] = SETTINGS) -> Resolved:
    resolved = resolve(name, settings)
    with Recorder(path, resolved, resolved.scenario.seed) as recorder:
        Simulation(resolved, on_record=recorder).run()
        recorder.end()
    return resolved


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory) -> bytes:
    path = tmp_path_factory.mktemp("recordings") / "run.rec"
    write(path)
    return path.read_bytes()


def same(one: Any, other: Any) -> bool:
    if isinstance(one, dict):
        return one.keys() == other.keys() and all(same(one[key], other[key]) for key in one)
    if isinstance(one, np.ndarray):
        return one.dtype == other.dtype and np.array_equal(one, other)
    if isinstance(one, tuple | list):
        return len(one) == len(other) and all(map(same, one, other))
    return bool(one == other)


def starts_of_frames(data: bytes) -> list[int]:
    """The first byte of each frame, the header's included, and the end of the file."""
    at = [stored.PREAMBLE.size]
    while at[-1] < len(data):
        at.append(at[-1] + stored.FRAME.size + stored.FRAME.unpack_from(data, at[-1])[1])
    return at


def reread(tmp_path: Path, data: bytes) -> Recording:
    path = tmp_path / "changed.rec"
    path.write_bytes(data)
    return read_recording(path)


def test_a_file_gives_back_what_was_recorded(tmp_path: Path) -> None:
    path = tmp_path / "run.rec"
    resolved = write(path)
    memory = MemoryRecorder(resolved)
    Simulation(resolved, on_record=memory).run()
    kept, read = memory.recording(), read_recording(path)
    assert read.complete and read.ticks == kept.ticks == 600
    assert same(read.header, kept.header)
    theirs, mine = list(read.frames), list(kept.frames)
    assert [frame.kind for frame in theirs] == [frame.kind for frame in mine]
    for one, other in zip(theirs, mine, strict=True):
        assert same(one.content, other.content)
    assert theirs[-1].content["metrics"]["operations"] > 0


def test_ticks_follow_each_other_whatever_the_pauses(tmp_path: Path) -> None:
    resolved = resolve("tabletop-mini")
    at_once, in_steps = MemoryRecorder(resolved), MemoryRecorder(resolved)
    Simulation(resolved, on_record=at_once).run()
    simulation = Simulation(resolved, on_record=in_steps)
    while not simulation.finished:
        simulation.run(until=simulation.tick + 7)
    for name in ("executed", "changes", "digests"):
        one, other = (
            np.concatenate(
                [f.content[name] for f in memory.recording().frames if f.kind == FRAME_KIND_TICKS]
            )
            for memory in (at_once, in_steps)
        )
        assert np.array_equal(one, other), name
    assert (
        max(len(f.content["executed"]) for f in in_steps.frames if f.kind == FRAME_KIND_TICKS)
        <= 256
    )


def test_keyframes_come_at_the_start_now_and_then_and_at_the_end() -> None:
    resolved = resolve("tabletop-1", ["fleet.robots=1"])
    memory = MemoryRecorder(resolved)
    Simulation(resolved, on_record=memory).run()
    ticks = [f.content["tick"] for f in memory.recording().frames if f.kind == FRAME_KIND_KEYFRAME]
    assert ticks[0] == 0 and ticks[-1] > 4000
    assert ticks[:-1] == list(range(0, ticks[-1], KEYFRAME_TICKS))
    assert memory.frames[-1].kind == FRAME_KIND_END


def test_states_and_actions_are_stored_by_identity() -> None:
    resolved = resolve("tabletop-mini", SETTINGS)
    plain, permuted = MemoryRecorder(resolved), MemoryRecorder(resolved)
    Simulation(resolved, on_record=plain).run()
    Simulation(resolved, storage=np.array([2, 0, 1], np.int32), on_record=permuted).run()
    for one, other in zip(plain.recording().frames, permuted.recording().frames, strict=True):
        # Changes of one tick stand in the order in which robots are stored.
        content = [
            {name: value for name, value in frame.content.items() if name != "changes"}
            for frame in (one, other)
        ]
        assert same(*content)


@pytest.mark.parametrize(
    ("name", "settings"),
    [
        (
            "tabletop-1",
            ["fleet.robots=2", "strategy.right_of_way.retries=2", "world.following=none"],
        ),
        ("crossing", ["information={radius: 3}"]),
        ("crossing", ["fleet.start=[[1,0],[2,0],[3,0],[4,0]]"]),
    ],
)
def test_the_header_is_enough_to_run_again(name: str, settings: list[str]) -> None:
    resolved = resolve(name, settings)
    header = MemoryRecorder(resolved, 5).header
    again = resolved_of(
        stored.decode(
            stored.FRAME_KIND_HEADER, stored.payload_of(stored.FRAME_KIND_HEADER, header).data
        )
    )
    assert again == resolved
    one, other = Simulation(resolved, 5), Simulation(again, 5)
    one.run(until=300)
    other.run(until=300)
    assert one.digest == other.digest


def test_the_header_names_no_place_of_this_machine(whole: bytes, tmp_path: Path) -> None:
    header = reread(tmp_path, whole).header
    assert str(Path(stored.__file__).parent.parent) not in str(header)
    assert {"python", "numpy", "numba"} <= set(header["versions"])


def test_a_file_cut_anywhere_reads_to_its_last_whole_frame(whole: bytes, tmp_path: Path) -> None:
    starts = starts_of_frames(whole)
    assert len(starts) > 5
    for whole_frames, (begin, end) in enumerate(pairwise(starts[1:])):
        for cut in (begin, begin + 1, begin + stored.FRAME.size, (begin + end) // 2, end - 1):
            recording = reread(tmp_path, whole[:cut])
            assert len(list(recording.frames)) == whole_frames
            assert not recording.complete


def test_a_flipped_byte_is_noticed_wherever_it_is(whole: bytes, tmp_path: Path) -> None:
    starts = starts_of_frames(whole)
    for number, begin in enumerate(starts[1:-1]):
        end = starts[number + 2]
        checksum = begin + stored.CHECKED.size
        for place in (
            begin,
            begin + 1,
            checksum,
            begin + stored.FRAME.size,
            (begin + end) // 2,
            end - 1,
        ):
            data = bytearray(whole)
            data[place] ^= 0x10
            with pytest.raises(InputError, match=f"damaged: frame {number + 1} at byte {begin:,} "):
                reread(tmp_path, bytes(data))


@pytest.mark.parametrize(
    ("data", "told"),
    [
        (b"", "the file is empty, not a recording"),
        (b"name: tabletop-1\n", "this is not a recording of automaton"),
        (stored.MAGIC[:5], "cut short before its first frame ends"),
        (stored.preamble(), "cut short before its first frame ends"),
        (stored.preamble() + b"\x01\x02", "cut short before its first frame ends"),
        (
            struct.pack("<12sH", stored.MAGIC, 9),
            "has format 9, but this version of automaton reads format 7",
        ),
    ],
)
def test_what_is_no_recording_is_refused_in_one_sentence(
    data: bytes, told: str, tmp_path: Path
) -> None:
    with pytest.raises(InputError) as error:
        reread(tmp_path, data)
    assert told in str(error.value) and "\n" not in str(error.value)
    assert str(error.value).startswith(str(tmp_path / "changed.rec"))


def test_what_comes_before_damage_can_be_kept(whole: bytes, tmp_path: Path) -> None:
    begin = starts_of_frames(whole)[5]
    data = whole[:begin] + b"\x07" + whole[begin + 1 :]
    kept = reread(tmp_path, data[:begin])
    assert kept.ticks > 0 and not kept.complete
    with pytest.raises(
        InputError, match=f"ticks 0 to {kept.ticks} before it are intact; `head -c {begin} "
    ):
        reread(tmp_path, data)


def test_nothing_stands_after_the_end(whole: bytes, tmp_path: Path) -> None:
    for more in (b"\n", whole[starts_of_frames(whole)[1] :]):
        with pytest.raises(InputError, match="damaged: frame "):
            reread(tmp_path, whole + more)


def test_what_is_no_ordinary_file_is_not_read(tmp_path: Path) -> None:
    pipe = tmp_path / "pipe.rec"
    os.mkfifo(pipe)
    for place in (pipe, Path("/dev/zero"), tmp_path, tmp_path / "nothing.rec"):
        with pytest.raises(InputError, match="cannot read the recording"):
            read_recording(place)


def test_a_place_that_cannot_be_written_is_refused(tmp_path: Path) -> None:
    resolved = resolve("tabletop-mini")
    for place in (tmp_path / "no" / "run.rec", tmp_path):
        with pytest.raises(InputError, match="cannot write the recording"):
            Recorder(place, resolved, 1)


OLDER = preamble() + b"an older recording"


def test_a_file_that_is_no_recording_is_never_replaced(tmp_path: Path) -> None:
    path = tmp_path / "floor.yaml"
    path.write_text("name: precious")
    with pytest.raises(InputError, match="exists and is not a recording; not overwritten"):
        Recorder(path, resolve("tabletop-mini", SETTINGS), 1)
    assert path.read_text() == "name: precious"


def test_an_older_file_is_replaced_only_at_the_end(tmp_path: Path) -> None:
    path, part = tmp_path / "run.rec", tmp_path / "run.rec.part"
    path.write_bytes(OLDER)
    resolved = resolve("tabletop-mini", SETTINGS)
    with Recorder(path, resolved, 1) as recorder:
        Simulation(resolved, on_record=recorder).run()
        assert path.read_bytes() == OLDER
        assert read_recording(part).ticks >= 256  # what a killed process would leave
    assert read_recording(path).complete and not part.exists()


def test_an_interrupted_run_keeps_what_is_done(tmp_path: Path) -> None:
    path = tmp_path / "run.rec"
    resolved = resolve("tabletop-mini", SETTINGS)
    with pytest.raises(KeyboardInterrupt), Recorder(path, resolved, 1) as recorder:
        Simulation(resolved, on_record=recorder).run(until=300)
        raise KeyboardInterrupt
    recording = read_recording(path)
    assert recording.ticks == 300 and not recording.complete


def test_a_failed_run_leaves_an_older_file_alone(tmp_path: Path) -> None:
    path = tmp_path / "run.rec"
    path.write_bytes(OLDER)
    resolved = resolve("tabletop-mini", SETTINGS)
    with pytest.raises(ZeroDivisionError), Recorder(path, resolved, 1) as recorder:
        Simulation(resolved, on_record=recorder).run(until=300)
        raise ZeroDivisionError
    assert path.read_bytes() == OLDER
    assert read_recording(tmp_path / "run.rec.part").ticks == 300


def test_recordings_are_small(tmp_path: Path) -> None:
    write(tmp_path / "run.rec", "tabletop-1", ["fleet.robots=5"])
    data = (tmp_path / "run.rec").read_bytes()
    recording = read_recording(tmp_path / "run.rec")
    per_tick = len(data) / recording.ticks
    actions = [
        frame.content["executed"] for frame in recording.frames if frame.kind == FRAME_KIND_TICKS
    ]
    packed = sum(len(zlib.compress(np.ascontiguousarray(did.T).tobytes())) for did in actions)
    print(
        f"{per_tick / 5:.2f} bytes per robot and tick, digests included; "
        f"actions alone {8 * packed / (5 * recording.ticks):.2f} bits"
    )
    assert per_tick < 100
    assert 8 * packed / (5 * recording.ticks) < 3


def test_frames_of_no_changes_survive(tmp_path: Path) -> None:
    content = {
        "first": 9,
        "executed": np.zeros((2, 3), np.uint16),
        "changes": np.zeros((0, 4), np.int64),
        "decisions": np.zeros(0, np.int64),
        "digests": np.array([[1, 2**64 - 1], [1, 0]], np.uint64),
    }
    data = stored.payload_of(FRAME_KIND_TICKS, content).data
    assert same(
        DecodedFrame(FRAME_KIND_TICKS, stored.decode(FRAME_KIND_TICKS, data)),
        DecodedFrame(FRAME_KIND_TICKS, content),
    )


def refused(tmp_path: Path, capsys: pytest.CaptureFixture[str], parts: Any) -> str:
    """The one sentence in which `verify` refuses a file of these frames."""
    path = tmp_path / "hostile.rec"
    path.write_bytes(put_together(parts))
    assert path.stat().st_size < 1_000_000
    capsys.readouterr()  # what was compiled for the first time
    assert main(["verify", str(path)]) == 2
    told = capsys.readouterr()
    assert told.out == "" and told.err.count("\n") == 1
    assert f"{path}: damaged or altered: frame " in told.err
    return told.err


def apart() -> list[tuple[int, Any]]:
    return copy.deepcopy(list(taken_apart("crossing")))


def first(parts: list[tuple[int, Any]], wanted: int) -> Any:
    return next(content for kind, content in parts if kind == wanted)


@pytest.mark.parametrize(
    ("names", "told"),
    [
        (2**31 - 1, "one of its arrays is empty but has an extent of 2,147,483,647"),
        (2**16, "digests has 65,536 rows or columns, not "),
    ],
)
def test_an_array_without_values_takes_no_memory(
    names: int, told: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    parts = apart()
    first(parts, FRAME_KIND_TICKS).update(
        due=np.zeros(0, np.int32), digests=np.zeros((names, 0), np.uint64)
    )
    assert told in refused(tmp_path, capsys, parts)


@pytest.mark.parametrize("levels", [MAX_NESTING + 1, 450, 900])
@pytest.mark.parametrize("part", ["scenario", "strategies"])
def test_lists_within_lists_have_a_bound(
    part: str, levels: int, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    parts, deep = apart(), []
    for _ in range(levels - 3):
        deep = [deep]
    header = first(parts, FRAME_KIND_HEADER)
    header[part]["layout"] = {"generator": "a:B", "deep": deep}
    told = refused(tmp_path, capsys, parts)
    assert f"{part} is nested more than {MAX_NESTING} levels deep" in told


def test_as_many_levels_as_a_file_may_have_are_read(tmp_path: Path) -> None:
    parts, deep = apart(), []
    for _ in range(MAX_NESTING - 3):
        deep = [deep]
    header = first(parts, FRAME_KIND_HEADER)
    header["scenario"]["layout"] = {"generator": "a:B", "deep": deep}
    path = tmp_path / "deep.rec"
    path.write_bytes(put_together(parts[:1]))
    assert read_recording(path).header["scenario"]["layout"]["deep"] == deep


@pytest.mark.parametrize(
    ("name", "value"),
    [
        *((name, "") for name in ("overrides", "digest_names", "versions", "files")),
        *((name, 1) for name in ("start", "starts", "numbered")),
    ],
)
def test_lists_of_a_header_have_a_bound(
    name: str, value: Any, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    parts = apart()
    header = first(parts, FRAME_KIND_HEADER)
    if name in ("versions", "files"):
        header[name] = {str(number): value for number in range(20_000)}
    else:
        (header["floor"] if name in header["floor"] else header)[name] = [value] * 20_000_000
    told = refused(tmp_path, capsys, parts)
    assert f"of length <= {MAX_PLACES if value else MAX_LABELS} - at `$." in told


def test_changes_of_a_frame_have_a_bound(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """However many robots there are; and a tick has not those of a whole frame."""
    for rows, told in ((MAX_CHANGES + 1, "changes"), (5000, "changes in a tick")):
        parts = apart()
        ticks = first(parts, FRAME_KIND_TICKS)
        ticks["changes"] = np.full((4, rows), [[0], [CHANGE_DURATION], [0], [0]], np.int32)
        if rows > MAX_CHANGES:
            ticks["executed"] = np.zeros((1000, 256), np.uint16)
        assert f"{told}\n" in refused(tmp_path, capsys, parts[:4])


@pytest.mark.parametrize("count", [0, 5_000_000])
def test_a_state_of_another_number_of_stations_is_found(count: int, tmp_path: Path) -> None:
    parts = copy.deepcopy(list(taken_apart("factory")))
    first(parts, FRAME_KIND_KEYFRAME)["stations"]["completion_tick"] = np.zeros(count, np.uint8)
    report = validate_stored(reread(tmp_path, put_together(parts)))
    text = f"stations.completion_tick has {count:,} values in the recorded state, not "
    assert text in report.violations[0].text


# Who has recordings can read them only as long as this stays: a change of it is a new format.
OF_THE_STATE = """
header    robots         cell heading home bay charge
header    orders         source target release_tick weight priority due release_sequence first_stop
header    stops          cell ticks
header    stations       processing_time arrival_tick
header    slots          cell
header    pods           slot weight sku_first sku_pod
header    lines          order pod sku station release_tick due priority handling
header    pod_stations   cell places rule visit ticks_from
header    gates          first_closing closings
keyframe  robots         cell claim heading travel action busy priority load order slot goal_type
keyframe  robots         goal_cell charge_target try_drop retreat_moves failed_retries retry_state
keyframe  robots         parked service_zone charge status need reason
keyframe  orders         state current_slot reserved_by release_tick delivered legs
keyframe  slots          cell content reserved_by
keyframe  stations       in_service job_done_tick arrival_tick completion_tick
keyframe  stops          done
keyframe  pods           slot trip first_line
keyframe  lines          served_at trip done
keyframe  trips          begun station place leaving offered
keyframe  pod_stations   taken open_lines
keyframe  gates          closing open_from used mouth caller waited waited_for
keyframe  service_zones  server queue next_slot skips_transfer halt
"""


def test_what_a_recording_has_of_the_state() -> None:
    expected: dict[tuple[str, str], list[str]] = {}
    for line in OF_THE_STATE.strip().splitlines():
        frame, part, *names = line.split()
        expected.setdefault((frame, part), []).extend(names)
    parts = World.struct_classes().items()
    header = {("header", part): [*struct.fields_where(IN_HEADER)] for part, struct in parts}
    keyframe = {("keyframe", part): [*names] for part, names in KEYFRAME_ARRAYS.items()}
    assert {part: names for part, names in (header | keyframe).items() if names} == expected
