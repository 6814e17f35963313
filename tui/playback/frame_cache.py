"""From a playback state to pictures: one camera for all maps, a scene for each run, the minimap in
a corner.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from automaton.engine.state import NIL
from tui.playback.run_source import Opening
from tui.render import styles
from tui.render.camera import Camera
from tui.render.compose import Minimap, compose
from tui.render.scene import NO_CELLS, Choice, Scene, floor_of
from tui.render.styles import Codes, GlyphSet, code, style

if TYPE_CHECKING:
    from automaton.world.resolved import Resolved
    from tui.playback.playback_state import PlaybackState


MINIMAP_SHARE: Final = 3  # at most a third of the map's rows and columns
MINIMAP_ROWS: Final = 12
MINIMAP_COLUMNS: Final = 40
NARROW: Final = 100  # columns below which two maps of equal scale are stacked
DEAD_ZONE: Final = 4  # a followed robot stays at least 1/4 of the screen away from the edges


class Pictures:
    """Draws the maps of one or two runs."""

    def __init__(self, opening: Opening, glyphs: GlyphSet) -> None:
        self.glyphs = glyphs
        self.floors = [floor_of(resolved) for resolved in opening.resolved]
        robots = max(one.scenario.fleet.robots for one in opening.resolved)
        self.camera = Camera(opening.resolved[0].floor_plan, 1, 1, robots)
        self.in_pixels = False  # not text, and without a minimap
        self._is_compared = opening.comparing and not opening.live
        self.fitted = True  # show the whole floor at any size
        self._corner: tuple[tuple[int, int], Corner] | None = None  # by the size of the map

    def resize(self, rows: int, columns: int) -> None:
        """Set the size of the maps."""
        self.camera.resize(rows, columns)
        if self.fitted:
            self.camera.fit()

    def take_floor(self, opening: Opening) -> bool:
        """After a reload, take the new floor and keep the view; returns whether its size is the same."""
        before, floor_plan = self.camera, opening.resolved[0].floor_plan
        self.floors = [floor_of(resolved) for resolved in opening.resolved]
        self._corner = None
        robots = max(one.scenario.fleet.robots for one in opening.resolved)
        self.camera = Camera(floor_plan, before.rows, before.columns, robots)
        same = floor_plan.kind.shape == before.floor_plan.kind.shape
        if self.fitted or before.zoom not in self.camera.ladder:
            return same
        self.camera.zoom = before.zoom
        middle = before.cell_at(before.rows // 2, before.columns // 2)
        if same and self.camera.shown == before.shown:
            self.camera = before.copy()
            self.camera.floor_plan = floor_plan
        elif middle is not None:
            x, y = before.floor_plan.xy(middle)
            x, y = min(x, floor_plan.width - 1), min(y, floor_plan.height - 1)
            self.camera.centre_on(floor_plan.cell(max(x, 0), max(y, 0)))
        return same

    def split(self, rows: int, columns: int) -> str:
        """The better layout of two maps with heads: "horizontal", or "vertical" (stacked)."""
        if rows < 4 or columns < 2:
            return ""
        sizes = {"horizontal": (rows - 1, columns // 2), "vertical": (rows // 2 - 1, columns)}
        sizes_of_cells = {}
        for name, size in sizes.items():
            camera = self.camera.copy()
            camera.resize(*size)
            camera.fit()
            sizes_of_cells[name] = camera.zoom.area
        if sizes_of_cells["horizontal"] == sizes_of_cells["vertical"]:
            return "vertical" if columns < NARROW else "horizontal"
        return max(sizes_of_cells, key=sizes_of_cells.__getitem__)

    def larger_beside(self, rows: int, columns: int, below: int, beside: int) -> bool:
        """Whether the map is larger beside a panel of `beside` columns than above `below` rows."""
        nearest = []
        for size in ((rows, columns - beside), (rows - below, columns)):
            camera = self.camera.copy()
            camera.resize(max(1, size[0]), max(1, size[1]))
            camera.fit()
            nearest.append(camera.size()[0])
        return nearest[0] > nearest[1]

    def scene(self, playback: PlaybackState | None, choice: Choice, side: int) -> Scene:
        """The scene of one run."""
        if playback is None:
            return Scene(self.floors[side], cursor=_cursor(choice), zone=choice.zone)
        snapshot = playback.snapshots[side]
        robot = choice.robot if choice.robot < len(snapshot.robots) else NIL
        fleet = len(snapshot.robots)  # the other one may be larger
        found = choice.matches[choice.matches < fleet]
        differs = differing(playback)
        late = snapshot.heat is not None and snapshot.layer != choice.layer
        return Scene(
            self.floors[side],
            snapshot,
            selected=robot,
            route=snapshot.route if choice.route and snapshot.selected == robot else NO_CELLS,
            cursor=_cursor(choice),
            layer="" if late else choice.layer,  # not with the previous layer's numbers
            zone=choice.zone,
            marked_cells=choice.match_cells[choice.match_cells < self.floors[side].looks.size],
            least=choice.least,
            colouring=choice.colouring,
            trails=playback.trails[side] if choice.trails and playback.trails else NO_CELLS,
            lines=choice.lines,
            marked=found if len(found) else differs[differs < fleet],
            ghosts=ghosts_of(playback, side),
            is_compared=self._is_compared,
            slow_places=choice.slow_places[side]
            if choice.slow_places and side == choice.side
            else (),
        )

    def take_zones(self, resolved: Resolved) -> bool:
        """After a branch of the only run, take its floor; returns whether its zones differ."""
        before, self.floors[0] = self.floors[0].traffic_zones, floor_of(resolved)
        return before is None or before.mode != resolved.scenario.world.traffic_zones

    def zone_cells(self, playback: PlaybackState | None, zone: int, side: int) -> list[int]:
        """The cells of a zone, in reading order."""
        snapshot = None if playback is None else playback.snapshots[side]
        cells: list[int] = Scene(self.floors[side], snapshot, zone=zone).zone_cells.tolist()
        return cells

    def picture(self, scene: Scene, choice: Choice, rows: int, columns: int) -> Codes:
        """(rows, columns) codes: the scene seen by the camera, and the minimap."""
        codes = compose(scene, self.camera, self.glyphs)
        corner = self.corner(choice)
        if corner is not None:
            small = corner.minimap.picture(scene, self.camera, self.glyphs)
            height, width = small.shape
            codes[corner.top : corner.top + height, corner.left : corner.left + width] = small
        if codes.shape == (rows, columns):
            return codes
        # One of two maps side by side may be a column wider than the camera.
        whole = np.full(
            (rows, columns), code(style(styles.COLOUR_VOID, styles.COLOUR_VOID), 0), np.uint32
        )
        part = codes[:rows, :columns]
        whole[: part.shape[0], : part.shape[1]] = part
        return whole

    def corner(self, choice: Choice) -> Corner | None:
        """The minimap, while some of the floor is off the screen."""
        camera = self.camera
        if self.in_pixels or not (choice.minimap and camera.exceeds()):
            return None
        if self._corner is None or self._corner[0] != (camera.rows, camera.columns):
            self._corner = (camera.rows, camera.columns), _corner(camera)
        return self._corner[1]

    def cell_at(self, choice: Choice, row: int, column: int) -> int | None:
        """The cell at a place of the map; None outside the floor and on the minimap."""
        if row < 0 or self._in_minimap(choice, row, column):
            return None
        return self.camera.cell_at(row, column)

    def centre(self, choice: Choice, row: int, column: int) -> bool:
        """Centre on a place of the minimap; returns False outside the minimap."""
        corner = self._in_minimap(choice, row, column)
        if corner is None:
            return False
        cell = corner.minimap.cell_at(row - corner.top, column - corner.left)
        if cell is not None:
            choice.following = self.fitted = False
            self.camera.centre_on(cell)
        return True

    def _in_minimap(self, choice: Choice, row: int, column: int) -> Corner | None:
        corner = self.corner(choice)
        return corner if corner is not None and corner.holds(row, column) else None

    def follow(self, playback: PlaybackState, choice: Choice) -> bool:
        """Keep the followed robot away from the edges; returns whether the view moved."""
        if not choice.following or choice.robot == NIL:
            return False
        cell = robot_cell(playback, choice)
        place = None if cell == NIL else self.camera.place_of(cell)
        rows, columns = self.camera.rows // DEAD_ZONE, self.camera.columns // DEAD_ZONE
        if cell == NIL or (
            place is not None
            and rows <= place[0] < self.camera.rows - rows
            and columns <= place[1] < self.camera.columns - columns
        ):
            return False
        before = self.camera.key
        self.camera.centre_on(cell)
        return self.camera.key != before


class Corner(NamedTuple):
    """The minimap and its position on the map."""

    top: int
    left: int
    minimap: Minimap

    def holds(self, row: int, column: int) -> bool:
        camera = self.minimap.camera
        inside = 0 <= row - self.top < camera.rows and 0 <= column - self.left < camera.columns
        return inside


def _corner(camera: Camera) -> Corner:
    """A minimap of the whole floor, in the lower right corner of the map."""
    rows = min(camera.rows // MINIMAP_SHARE, MINIMAP_ROWS)
    columns = min(camera.columns // MINIMAP_SHARE, MINIMAP_COLUMNS)
    minimap = Minimap(camera, rows, columns)
    height, width = minimap.camera.size()
    minimap.camera.resize(min(height, rows), min(width, columns))
    own = minimap.camera
    return Corner(camera.rows - own.rows, camera.columns - own.columns, minimap)


def robot_cell(playback: PlaybackState, choice: Choice) -> int:
    """The cell or parking bay of the selected robot, or NIL."""
    robots = playback.snapshots[choice.side].robots
    if not 0 <= choice.robot < len(robots):
        return NIL
    cell = int(robots.cell[choice.robot])
    return int(robots.bay[choice.robot]) if cell == NIL else cell


def differing(playback: PlaybackState) -> NDArray[np.int32]:
    """The robots whose cell or load differs between two runs, or that only one of them has."""
    if len(playback.snapshots) < 2:
        return NO_CELLS
    one, other = (snapshot.robots for snapshot in playback.snapshots)
    both = min(len(one), len(other))
    differs = one.cell[:both] != other.cell[:both]
    differs |= one.load[:both] != other.load[:both]
    alone = np.arange(both, max(len(one), len(other)))  # robots of the larger fleet
    return np.append(np.flatnonzero(differs), alone).astype(np.int32)


def ghosts_of(playback: PlaybackState, side: int) -> NDArray[np.int32]:
    """The cells of robots in the other run that are not there in this one."""
    if len(playback.snapshots) < 2:
        return NO_CELLS
    here, there = (playback.snapshots[one].robots.cell for one in (side, 1 - side))
    both = min(len(here), len(there))
    differs = there != NIL
    differs[:both] &= here[:both] != there[:both]
    return np.asarray(there[differs], np.int32)


def _cursor(choice: Choice) -> int | None:
    return None if choice.cell == NIL else choice.cell
