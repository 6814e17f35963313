"""Recordings that somebody altered and sealed again: `verify` finds it, or it is a label.

Each tampering changes one thing that a recording says, and puts the file together with right seals.
"""

from __future__ import annotations

import copy
from collections.abc import Callable
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from docs_pages import page

from automaton.commands import main
from automaton.engine.record_codes import (
    CHANGE_DURATION,
    CHANGE_ORDER_RESERVED,
    CHANGE_PICKED,
    KEYFRAME_TICKS,
)
from automaton.recording.contents import (
    FRAME_KIND_CONDITIONS,
    FRAME_KIND_END,
    FRAME_KIND_KEYFRAME,
    FRAME_KIND_TICKS,
    DecodedFrame,
)
from automaton.recording.frames import encoded
from automaton.recording.recorder import MemoryRecorder
from automaton.recording.recording_reader import read_recording
from automaton.runs.simulation import Simulation
from automaton.verification.verification import NOT_COMPARED
from automaton.world.resolve import resolve

RUNS = {
    "tables": (
        "tabletop-mini",
        "stop={when: never, max_duration: 2100}",
    ),  # has a state of tick 2,048
    "depots": ("depots", "stop.max_duration=150"),
    "factory": ("factory", "stop.max_duration=150"),
}

Tampering = Callable[["Taken"], None]
FOUND: dict[str, tuple[str, Tampering]] = {}
UNCHECKED: dict[str, tuple[str, Tampering]] = {}


class Taken:
    """A recording taken apart."""

    def __init__(self, header: Any, frames: list[DecodedFrame]) -> None:
        self.header = header
        self.frames = frames

    def all(self, kind: int) -> list[Any]:
        return [frame.content for frame in self.frames if frame.kind == kind]

    @property
    def scenarios(self) -> list[Any]:
        """The scenario wherever it stands, so that all copies stay equal."""
        return [
            self.header["scenario"],
            *(rules["scenario"] for rules in self.all(FRAME_KIND_CONDITIONS)),
        ]

    @property
    def picks(self) -> list[Any]:
        return [
            self.header["strategies"],
            *(rules["strategies"] for rules in self.all(FRAME_KIND_CONDITIONS)),
        ]

    @property
    def ticks(self) -> Any:
        """The ticks in the middle."""
        found = self.all(FRAME_KIND_TICKS)
        return found[len(found) // 2]

    @property
    def state(self) -> Any:
        return self.all(FRAME_KIND_KEYFRAME)[-1]

    @property
    def end(self) -> Any:
        return self.all(FRAME_KIND_END)[0]

    def places(self, kind: int) -> list[int]:
        return [at for at, frame in enumerate(self.frames) if frame.kind == kind]


def tampering(of: str = "tables", found: bool = True) -> Callable[[Tampering], Tampering]:
    def kept(alter: Tampering) -> Tampering:
        (FOUND if found else UNCHECKED)[alter.__name__] = (of, alter)
        return alter

    return kept


def set_key(of: str, path: str, value: Any, found: bool = True) -> None:
    """A tampering that sets a key of the scenario, in all its copies."""

    def alter(taken: Taken) -> None:
        for scenario in taken.scenarios:
            *keys, last = path.split(".")
            for key in keys:
                scenario = scenario[key]
            assert scenario[last] != value
            scenario[last] = value

    alter.__name__ = f"scenario.{path}"
    tampering(of, found)(alter)


def add_to(of: str, path: str, by: int = 1, at: int = 0) -> None:
    """A tampering that changes a number of an array of the header, the last state or ticks."""

    def alter(taken: Taken) -> None:
        where, *keys = path.split(".")
        part = {
            "header": taken.header,
            "state": taken.state,
            "conditions": taken.all(FRAME_KIND_CONDITIONS)[0],
        }
        array: Any = part[where]
        for key in keys:
            array = array[key]
        array.reshape(-1)[at] += by

    alter.__name__ = path
    tampering(of)(alter)


for name, value in (
    ("durations.move", 2),
    ("durations.pick", 3),
    ("durations.drop", 3),
    ("durations.turn", 3),
    ("world.following", False),
    ("stop.when", "delivered"),
    ("stop.max_duration", 900),
    ("fleet.robots", 2),
    ("measure", {"warm_up": 5}),
    ("layout", {"picture": "b+d\n #s"}),
    ("strategy.allocation", "independent"),
):
    set_key("tables", name, value)
set_key("depots", "battery.reserve", 99.0)
set_key("depots", "battery.drain.move", 9.0)
set_key("depots", "fleet.kinematics", "differential")
set_key("depots", "strategy.charging", "threshold")
set_key("factory", "faults.failure_probability", 0.5)
set_key("factory", "strategy.zoning", "static")
for name in ("name", "summary"):
    set_key("tables", name, "another", found=False)
set_key("tables", "seed", 77, found=False)
set_key("tables", "units.tick", "3 s", found=False)

for place in (
    *("header.orders.target", "header.orders.source", "header.orders.release_tick"),
    *("header.robots.home", "header.robots.heading"),
    *("header.slots.cell", "conditions.period", "conditions.wait"),
    *("state.robots.cell", "state.robots.heading", "state.robots.load", "state.robots.order"),
    *(
        "state.robots.goal_type",
        "state.robots.goal_cell",
        "state.robots.priority",
        "state.robots.retry_state",
    ),
    *(
        "state.robots.service_zone",
        "state.robots.need",
        "state.robots.charge_target",
        "state.robots.busy",
    ),
    *(
        "state.orders.delivered",
        "state.orders.legs",
        "state.orders.current_slot",
        "state.slots.content",
    ),
):
    add_to("tables", place)
for place in ("header.robots.charge", "state.robots.charge", "state.robots.slot"):
    add_to("depots", place, by=-1)
for place in (
    *(
        "header.jobs.processing_time",
        "header.jobs.arrival_tick",
        "state.stations.job_done_tick",
        "state.stations.arrival_tick",
    ),
    *("state.service_zones.queue", "state.service_zones.server", "state.service_zones.next_slot"),
):
    add_to("factory", place)


@tampering("factory")
def a_floor_with_a_parameter_that_there_is_not(taken: Taken) -> None:
    for scenario in taken.scenarios:
        scenario["layout"]["cellx"] = 1


@tampering()
def another_seed(taken: Taken) -> None:
    taken.header["seed"] += 1


@tampering()
def strategies_named_otherwise(taken: Taken) -> None:
    for picks in taken.picks:
        picks["right_of_way"]["name"] = "wait"


@tampering()
def strategies_with_other_parameters(taken: Taken) -> None:
    for picks in taken.picks:
        picks["right_of_way"]["parameters"]["retries"] = 9


@tampering()
def a_shelf_less(taken: Taken) -> None:
    kind = taken.header["floor"]["kind"]
    kind[kind == 4] = 0


@tampering()
def an_exit_less(taken: Taken) -> None:
    exits = taken.header["floor"]["exits"].reshape(-1)
    exits[np.flatnonzero(exits)[0]] = 0


@tampering()
def room_for_two(taken: Taken) -> None:
    taken.header["floor"]["capacity"][:] = 2


@tampering()
def digests_named_otherwise(taken: Taken) -> None:
    first, second, *others = taken.header["digest_names"]
    taken.header["digest_names"] = (second, first, *others)


@tampering()
def no_digest_has_a_name(taken: Taken) -> None:
    taken.header["digest_names"] = ()
    for ticks in taken.all(FRAME_KIND_TICKS):
        ticks["digests"] = ticks["digests"][:, :0]


@tampering()
def started_elsewhere(taken: Taken) -> None:
    taken.header["start"] = "random"


@tampering()
def conditions_that_nobody_set(taken: Taken) -> None:
    taken.all(FRAME_KIND_CONDITIONS)[0]["scenario"]["durations"]["turn"] = 3


@tampering()
def a_setting_that_changed_nothing(taken: Taken) -> None:
    taken.all(FRAME_KIND_CONDITIONS)[0]["settings"] = ("durations.turn=3",)


@tampering()
def a_branch_that_there_was_not(taken: Taken) -> None:
    rules = copy.deepcopy(taken.all(FRAME_KIND_CONDITIONS)[0])
    rules["settings"], rules["tick"] = ("durations.pick=9",), 250
    rules["scenario"]["durations"]["pick"] = 9
    taken.frames.insert(
        taken.places(FRAME_KIND_TICKS)[1], DecodedFrame(FRAME_KIND_CONDITIONS, rules)
    )


@tampering()
def a_branch_named_otherwise(taken: Taken) -> None:
    rules = copy.deepcopy(taken.all(FRAME_KIND_CONDITIONS)[0])
    rules["settings"], rules["tick"] = ("durations.pick=9",), 250
    taken.frames.insert(
        taken.places(FRAME_KIND_TICKS)[1], DecodedFrame(FRAME_KIND_CONDITIONS, rules)
    )


@tampering()
def teleported(taken: Taken) -> None:
    did = taken.all(FRAME_KIND_TICKS)[0]["executed"]
    did[np.nonzero((did > 0) & (did < 5))] = 1


@tampering()
def an_action_less(taken: Taken) -> None:
    did = taken.all(FRAME_KIND_TICKS)[0]["executed"].reshape(-1)
    did[np.flatnonzero(did)[5]] = 0


@tampering()
def robots_exchanged(taken: Taken) -> None:
    ticks = taken.all(FRAME_KIND_TICKS)[0]
    ticks["executed"] = ticks["executed"][:, ::-1].copy()


@tampering()
def two_ticks_exchanged(taken: Taken) -> None:
    did = taken.all(FRAME_KIND_TICKS)[0]["executed"]
    row = next(k for k in range(len(did) - 1) if (did[k] != did[k + 1]).any())
    did[[row, row + 1]] = did[[row + 1, row]]


@tampering()
def a_strategy_answered_otherwise(taken: Taken) -> None:
    taken.all(FRAME_KIND_TICKS)[0]["decisions"][4] += 1


@tampering()
def no_strategy_answered(taken: Taken) -> None:
    ticks = taken.all(FRAME_KIND_TICKS)[0]
    ticks["decisions"] = ticks["decisions"][:0]


def row_of(taken: Taken, code: int) -> Any:
    changes = taken.all(FRAME_KIND_TICKS)[0]["changes"]
    return changes[np.flatnonzero(changes[:, 1] == code)[0]]


@tampering()
def reserved_by_another(taken: Taken) -> None:
    row = row_of(taken, CHANGE_ORDER_RESERVED)
    row[3] = (row[3] + 1) % 3


@tampering()
def another_load(taken: Taken) -> None:
    row_of(taken, CHANGE_PICKED)[3] += 1


@tampering()
def a_wait_of_another_length(taken: Taken) -> None:
    row_of(taken, CHANGE_DURATION)[3] += 1


@tampering()
def a_change_less(taken: Taken) -> None:
    ticks = taken.all(FRAME_KIND_TICKS)[0]
    ticks["changes"] = ticks["changes"][1:]


@tampering()
def a_digest_changed(taken: Taken) -> None:
    taken.ticks["digests"][7, 3] ^= np.uint64(1)


@tampering()
def the_digests_of_a_tick_removed(taken: Taken) -> None:
    taken.ticks["digests"][7] = 0


@tampering()
def all_digests_removed(taken: Taken) -> None:
    for ticks in taken.all(FRAME_KIND_TICKS):
        ticks["digests"][:] = 0


@tampering()
def ticks_removed(taken: Taken) -> None:
    del taken.frames[taken.places(FRAME_KIND_TICKS)[2]]


@tampering()
def ticks_doubled(taken: Taken) -> None:
    at = taken.places(FRAME_KIND_TICKS)[2]
    taken.frames.insert(at, copy.deepcopy(taken.frames[at]))


@tampering()
def frames_exchanged(taken: Taken) -> None:
    one, other = taken.places(FRAME_KIND_TICKS)[2:4]
    taken.frames[one], taken.frames[other] = taken.frames[other], taken.frames[one]


@tampering()
def ticks_of_another_time(taken: Taken) -> None:
    taken.ticks["first"] += 1


@tampering()
def a_tick_less(taken: Taken) -> None:
    for name in ("executed", "digests"):
        taken.ticks[name] = taken.ticks[name][:-1]


@tampering()
def ticks_numbered_from_later_on(taken: Taken) -> None:
    for ticks in taken.all(FRAME_KIND_TICKS):
        ticks["first"] += 10
        ticks["changes"][:, 0] += 10


@tampering()
def a_state_removed(taken: Taken) -> None:
    at = next(
        k
        for k in taken.places(FRAME_KIND_KEYFRAME)
        if taken.frames[k].content["tick"] == KEYFRAME_TICKS
    )
    del taken.frames[at]


@tampering()
def the_last_state_removed(taken: Taken) -> None:
    del taken.frames[taken.places(FRAME_KIND_KEYFRAME)[-1]]


@tampering()
def the_first_state_removed(taken: Taken) -> None:
    del taken.frames[taken.places(FRAME_KIND_KEYFRAME)[0]]


@tampering()
def a_state_of_another_tick(taken: Taken) -> None:
    taken.all(FRAME_KIND_KEYFRAME)[1]["tick"] -= 1


@tampering()
def an_earlier_state_instead(taken: Taken) -> None:
    first, second, *_ = taken.all(FRAME_KIND_KEYFRAME)
    second["robots"] = copy.deepcopy(first["robots"])


@tampering()
def a_second_end(taken: Taken) -> None:
    taken.frames.append(copy.deepcopy(taken.frames[-1]))


@tampering()
def an_end_in_the_middle(taken: Taken) -> None:
    taken.frames.insert(5, taken.frames.pop())


@tampering()
def finished_although_it_was_not(taken: Taken) -> None:
    taken.end["finished"] = not taken.end["finished"]


@tampering()
def ended_later(taken: Taken) -> None:
    taken.end["ticks"] += 1


@tampering()
def another_last_digest(taken: Taken) -> None:
    taken.end["digest"] = "0" * 16


@tampering()
def a_figure_improved(taken: Taken) -> None:
    taken.end["metrics"]["throughput"] *= 1.01


@tampering()
def a_figure_removed(taken: Taken) -> None:
    del taken.end["metrics"]["delivered"]


@tampering()
def a_figure_added(taken: Taken) -> None:
    taken.end["metrics"]["praise"] = 1


@tampering()
def all_figures_removed(taken: Taken) -> None:
    taken.end["metrics"] = {}


@tampering(found=False)
def text(taken: Taken) -> None:
    taken.header["text"] = "name: another"


@tampering(found=False)
def overrides(taken: Taken) -> None:
    taken.header["overrides"] = ("fleet.robots=9",)


@tampering(found=False)
def sources(taken: Taken) -> None:
    taken.header["sources"] = {}


@tampering(found=False)
def versions(taken: Taken) -> None:
    taken.header["versions"] = {"python": "2.7"}


@tampering(found=False)
def files(taken: Taken) -> None:
    taken.header["files"] = {"another.csv": "0" * 16}


@tampering(found=False)
def digest_every(taken: Taken) -> None:
    taken.header["digest_every"] = 2
    for ticks in taken.all(FRAME_KIND_TICKS):
        odd = (ticks["first"] + np.arange(len(ticks["executed"]))) % 2 == 1
        ticks["digests"][odd] = 0


@pytest.fixture(scope="module")
def made() -> dict[str, tuple[Any, list[DecodedFrame]]]:
    found = {}
    for key, (name, *settings) in RUNS.items():
        resolved = resolve(name, settings)
        memory = MemoryRecorder(resolved)
        Simulation(resolved, on_record=memory).run()
        recording = memory.recording()
        found[key] = recording.header, list(recording.frames)
    return found


def verified(path: Path, header: Any, frames: list[DecodedFrame]) -> int:
    path.write_bytes(encoded(header, frames))
    return main(["verify", str(path)])


@pytest.mark.parametrize("of", RUNS)
def test_what_was_recorded_is_verified(
    of: str, made: dict[str, tuple[Any, list[DecodedFrame]]], tmp_path: Path
) -> None:
    assert verified(tmp_path / "run.rec", *made[of]) == 0


@pytest.mark.parametrize("name", FOUND)
def test_a_tampering_is_found(
    name: str,
    made: dict[str, tuple[Any, list[DecodedFrame]]],
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
) -> None:
    of, alter = FOUND[name]
    taken = Taken(*copy.deepcopy(made[of]))
    alter(taken)
    path = tmp_path / "run.rec"
    code = verified(path, taken.header, taken.frames)
    told = capsys.readouterr()
    assert code in (1, 2), told.out
    if code == 2:  # one sentence that names file and place
        assert told.out == "" and told.err.count("\n") == 1
        assert f"{path}: damaged" in told.err and "frame " in told.err
    else:
        assert "not verified" in told.out and " differs" in told.out


@pytest.mark.parametrize("name", UNCHECKED)
def test_a_label_is_not_checked_and_listed_as_one(
    name: str,
    made: dict[str, tuple[Any, list[DecodedFrame]]],
    tmp_path: Path,
) -> None:
    of, alter = UNCHECKED[name]
    taken = Taken(*copy.deepcopy(made[of]))
    alter(taken)
    assert verified(tmp_path / "run.rec", taken.header, taken.frames) == 0
    text = page("docs/explanation/trust.md").text
    labels = text.partition("does not check labels:\n\n*")[2].partition("\n\n")[0]
    assert f"`{name.removeprefix('scenario.')}`" in labels


def test_every_label_has_its_tampering() -> None:
    assert set(NOT_COMPARED) <= set(UNCHECKED)


def test_what_is_missing_in_the_middle_is_damage_and_what_is_missing_at_the_end_is_not(
    made: dict[str, tuple[Any, list[DecodedFrame]]], tmp_path: Path
) -> None:
    header, frames = made["factory"]
    for count in range(3, len(frames)):
        path = tmp_path / f"{count}.rec"
        path.write_bytes(encoded(header, frames[:count]))
        assert not read_recording(path).complete
    assert len(list(pairwise(frames))) > 3
