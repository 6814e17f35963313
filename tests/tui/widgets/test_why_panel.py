"""Why a robot waits: queues, head-on, wait cycles and parking bays, and where its time went."""

from __future__ import annotations

from dataclasses import fields, replace
from pathlib import Path

import numpy as np
import pytest
from panel_harness import (
    NARROW,
    WIDE,
    PanelHarness,
    click,
    deadlocked,
    moment,
    of_robot,
    run_in_harness,
    said,
    shown,
)
from textual.pilot import Pilot

from automaton.engine.observation import CAUSES
from automaton.history.snapshot import FleetSnapshot
from automaton.runs.metrics import metrics_by_robot
from automaton.units import percent
from tui.widgets.panel import ASCII_SIGNS, UNICODE_SIGNS, Signs
from tui.widgets.why_panel import Why, cause_bar, pattern_key

WAIT = ("tabletop-1", "fleet.robots=5", "strategy.right_of_way=wait")

# The parking bays share their home, in which robot 0 picks up a load.
SHARED_HOME = """
name: shared-home
layout:
  picture: |
    #s#
    b.b
    s.#
    #d#
fleet: {robots: 2, kinematics: omni}
durations: {pick: 20}
"""


@pytest.mark.parametrize("width", [NARROW, WIDE])
def test_a_queue_is_told_back_to_the_robot_that_works(width: int) -> None:
    said_then = shown(Why(), of_robot(moment(5, *WAIT), 4), width)
    chain = [
        "robot 4 has been waiting for 5 ticks: queue robot 3 holds (0, 3) and is waiting itself",
        "because robot 3 has been waiting for 5 ticks: queue robot 2 holds (0, 2) and is waiting itself",
        "because robot 2 has been waiting for 5 ticks: queue robot 1 holds (0, 1) and is waiting itself",
        "because robot 1 has been waiting for 5 ticks: working ahead robot 0 holds (0, 0) while it works "
        "there",
        "but robot 0 is turning",
    ]
    places = [said_then.index(words) for words in chain]
    assert places == sorted(places)
    assert said_then.count("rule: occupancy: a cell holds no more robots than its capacity") == 4


def test_head_on_names_the_rule_and_the_circle_is_shown_as_such() -> None:
    said_then = shown(Why(), of_robot(deadlocked(), 3))
    assert "robot 1 holds (8, 1) and wants to come the other way" in said_then
    assert "rule: two robots cannot swap over one edge" in said_then
    assert (
        "a wait cycle: robot 2 -> robot 1 -> robot 2; none moves until one makes way" in said_then
    )


def test_the_members_of_a_circle_are_in_the_colour_of_faults() -> None:
    why = Why()
    run_in_harness(why, _noop)
    made = why.panel_lines(of_robot(deadlocked(), 3), 80)
    faults = "".join(span.text for spans in made for span in spans if span.look == "fault")
    assert "a wait cycle" in faults and "head-on" in faults
    assert "queue" not in faults  # robots 3 and 4 are not members


def test_a_robot_in_its_bay_is_told_who_holds_its_home(tmp_path: Path) -> None:
    file = tmp_path / "shared-home.yaml"
    file.write_text(SHARED_HOME)
    view = moment(10, str(file))
    (robot,) = np.flatnonzero(view.snapshot.robots.cause == 8).tolist()
    said_then = shown(Why(), of_robot(view, robot), WIDE)
    assert (
        f"robot {1 - robot} holds (1, 1), so robot {robot} cannot leave its parking bay"
        in said_then
    )
    assert "rule: a robot may leave its parking bay only if its home cell was empty" in said_then


def test_lost_time_is_split_by_cause_the_greatest_first() -> None:
    view = of_robot(deadlocked(), 1)
    lost = view.snapshot.robots.lost[1]
    said_then = shown(Why(), view).partition("robot 1 lost ")[2]
    assert said_then.startswith(f"{100 * lost[1:].sum() / 300:.0f} % of 300 ticks head-on ")
    for code in np.flatnonzero(lost).tolist():
        assert f" {CAUSES[code].name} " in said_then
        assert f" {lost[code]} " in said_then


def test_a_robot_lost_as_much_as_its_run_reports() -> None:
    """Waits, and moves and turns that were undone; time without an order is not lost."""
    view = moment(634)
    rows = metrics_by_robot(view.runs[0].leading_simulation)
    for robot, row in enumerate(rows):
        told = shown(Why(), of_robot(view, robot), WIDE, 80)
        lost = sum(ticks for name, ticks in row.items() if name.startswith("lost_"))
        assert f"robot {robot} lost {percent(lost / 634, 0)} of 634 ticks" in told
        assert (" making way " in told) == (row["lost_making_way"] > 0)
    assert [row["lost_making_way"] for row in rows].count(0) < len(rows)
    idle = of_robot(moment(900, "factory"), 1)
    assert "robot 1 lost no time so far idle for 80 % of 900 ticks" in shown(Why(), idle)


@pytest.mark.parametrize("signs", [UNICODE_SIGNS, ASCII_SIGNS], ids=["unicode", "ascii"])
def test_bars_of_blocked_and_of_other_time_differ_without_colours(signs: Signs) -> None:
    queue, drawn_wait = (cause_bar(cause, 0.5, 8, signs).text for cause in (1, 9))
    assert len(queue) == len(drawn_wait) == 8 and queue != drawn_wait
    told = "".join(span.text for span in pattern_key([1, 9], signs))
    assert queue[0] in told and drawn_wait[0] in told


def test_without_a_robot_the_longest_waits_can_be_picked() -> None:
    why = Why()

    async def story(stage: PanelHarness, pilot: Pilot[None]) -> None:
        why.show(deadlocked())
        await pilot.pause()
        assert said(why)[0] == "4 robots wait, longest first"
        since = deadlocked().snapshot.robots.since
        listed = [int(words.split()[1]) for words in said(why)[1:5]]
        assert listed == sorted(listed, key=lambda robot: since[robot])
        await click(pilot, why, "robot 3")
        assert stage.wishes() == [("robot", 3)]
        why.show(of_robot(deadlocked(), 0))  # they stand below the waits of a selected robot, too
        await pilot.pause()
        assert "4 robots wait, longest first" in said(why)

    run_in_harness(why, story)


def test_every_robot_and_every_cell_of_the_chain_can_be_clicked() -> None:
    why = Why()

    async def story(stage: PanelHarness, pilot: Pilot[None]) -> None:
        why.show(of_robot(deadlocked(), 1))
        await pilot.pause()
        await click(pilot, why, "(8, 0)")
        await click(pilot, why, "robot 2 holds")
        assert stage.wishes() == [("cell", deadlocked().floor_plan.cell(8, 0)), ("robot", 2)]

    run_in_harness(why, story)


def test_of_a_very_long_chain_the_beginning_and_the_end_are_told() -> None:
    view = moment(5, *WAIT)
    fleet = view.snapshot.robots
    many = 100
    longer = {
        field.name: np.resize(value, (many, *value.shape[1:]))
        for field in fields(fleet)
        if (value := getattr(fleet, field.name)) is not None
    }
    longer["cause"], longer["blocker"] = np.ones(many, np.uint8), np.arange(-1, many - 1)
    longer["cause"][0] = 0
    snapshot = replace(view.snapshot, robots=FleetSnapshot(**longer))
    chain = replace(view, playback=replace(view.playback, snapshots=(snapshot,)), robot=many - 1)
    said_then = shown(Why(), chain, WIDE, 80)
    assert "robot 99 has been waiting" in said_then and "robot 88 has been waiting" in said_then
    assert "robot 50" not in said_then and "... 84 more robots ..." in said_then
    assert "because robot 1 has been waiting" in said_then


async def _noop(stage: PanelHarness, pilot: Pilot[None]) -> None:
    await pilot.pause()


def test_a_cause_in_the_list_of_lost_time_is_explained_by_keys() -> None:
    async def story(stage: PanelHarness, pilot: Pilot[None]) -> None:
        panel = stage.widget
        assert isinstance(panel, Why)
        panel.show(of_robot(moment(600, "tabletop-1", "fleet.robots=5"), 1))
        panel.focus()
        await pilot.press(*["down"] * 30, "enter")
        explained = panel.explained
        assert explained is not None and explained[0] == "cause"
        meaning = CAUSES[explained[1]].meaning
        assert "{" not in meaning
        assert " ".join(meaning.split()) in " ".join(" ".join(said(panel)).split())

    run_in_harness(Why(), story, WIDE, 60)
