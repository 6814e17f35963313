"""Actions on the view of the floor: panning, zooming, following."""

from __future__ import annotations

from typing import Final

from automaton.engine.state import NIL
from tui.actions.viewer_base import ViewerBase

STEP_COLUMNS: Final = 4
STEP_ROWS: Final = 2


class MapActions(ViewerBase):
    """The map."""

    def action_pan_left(self) -> None:
        self.pan(-STEP_COLUMNS, 0)

    def action_pan_right(self) -> None:
        self.pan(STEP_COLUMNS, 0)

    def action_pan_up(self) -> None:
        self.pan(0, -STEP_ROWS)

    def action_pan_down(self) -> None:
        self.pan(0, STEP_ROWS)

    def action_page_left(self) -> None:
        self.pan(-(self.pictures.camera.columns // 2), 0)

    def action_page_right(self) -> None:
        self.pan(self.pictures.camera.columns // 2, 0)

    def action_page_up(self) -> None:
        self.pan(0, -(self.pictures.camera.rows // 2))

    def action_page_down(self) -> None:
        self.pan(0, self.pictures.camera.rows // 2)

    def action_zoom_in(self) -> None:
        self.zoom(1)

    def action_zoom_out(self) -> None:
        self.zoom(-1)

    def action_zoom_fit(self) -> None:
        self.pictures.fitted = True
        self.pictures.camera.fit()
        self.changed()

    def action_zoom_cell(self) -> None:
        self.pictures.fitted = False
        self.pictures.camera.one_to_one()
        self.changed()

    def action_follow(self) -> None:
        if self.choice.robot == NIL:
            self.notify("choose a robot first: click it, or press )")
            return
        self.choice.following = not self.choice.following
        if self.choice.following and self.playback is not None:
            self.pictures.fitted = False
            self.pictures.follow(self.playback, self.choice)
        self.changed()

    def action_maximise(self) -> None:
        self.screen.toggle_class("-map-alone")
        self.changed()

    def action_minimap(self) -> None:
        self.choice.minimap = not self.choice.minimap
        self.changed()

    def pan(self, columns: int, rows: int) -> None:
        """Move the view by so many characters; nobody is followed any more."""
        self.choice.following = self.pictures.fitted = False
        self.pictures.camera.pan_characters(columns, rows)
        self.changed()

    def zoom(self, steps: int, at: tuple[int, int] | None = None) -> None:
        """A step nearer or farther; what is at the place (row, column) of the map stays there."""
        self.pictures.fitted = False
        if at is None and self.choice.robot != NIL:
            at = self._place_of_robot()
        if steps > 0:
            self.pictures.camera.zoom_in(at)
        else:
            self.pictures.camera.zoom_out(at)
        self.changed()

    def _place_of_robot(self) -> tuple[int, int] | None:
        from tui.playback.frame_cache import robot_cell

        cell = NIL if self.playback is None else robot_cell(self.playback, self.choice)
        return None if cell == NIL else self.pictures.camera.place_of(cell)
