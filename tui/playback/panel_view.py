"""What every panel is given to show, and what panels ask of the app."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from textual.message import Message

from automaton.engine.state import NIL
from automaton.evidence.history.snapshot import Snapshot
from automaton.evidence.history.watched_run import Run
from automaton.floor.floor_plan import FloorPlan
from tui.playback.playback_state import PlaybackState


@dataclass(frozen=True)
class View:
    """A playback state with what the user has chosen. Of a run only plan, header and event_history
    may be read.
    """

    playback: PlaybackState
    runs: Sequence[Run]
    robot: int = NIL  # the selected robot, or NIL
    cell: int = NIL  # the selected cell, or NIL
    layer: str = ""  # of tui.render.scene.LAYERS
    side: int = 0  # which of two compared runs the panels tell of
    zone: int = NIL  # the selected zone of the floor, or NIL

    @property
    def snapshot(self) -> Snapshot:
        """The state to tell of."""
        return self.playback.snapshots[self.side]

    @property
    def run(self) -> Run:
        """The run to tell of."""
        return self.runs[self.side]

    @property
    def floor_plan(self) -> FloorPlan:
        """Its floor."""
        return self.run.floor_plan


class RobotChosen(Message):
    """Select a robot, and show where it is."""

    def __init__(self, robot: int) -> None:
        self.robot = robot
        super().__init__()


class CellChosen(Message):
    """Select a cell, and show where it is."""

    def __init__(self, cell: int) -> None:
        self.cell = cell
        super().__init__()


class ZoneChosen(Message):
    """Select a zone of the floor, and show where it is."""

    def __init__(self, zone: int) -> None:
        self.zone = zone
        super().__init__()


class TickChosen(Message):
    """Show a tick."""

    def __init__(self, tick: int) -> None:
        self.tick = tick
        super().__init__()
