"""How large a film is, and at which step of the zoom ladder it shows the floor."""

from __future__ import annotations

from typing import Final

from automaton.errors import InputError, alternatives
from automaton.world.floor_plan import FloorPlan
from tui.cast.status import Status
from tui.render.camera import Camera

Size = tuple[int, int]  # columns, rows

LEAST: Final = (40, 8)
MOST: Final = (500, 200)
MOST_UNASKED: Final = (120, 40)
MARGIN: Final = (2, 1)  # around a floor that fits


def checked_size(columns: int, rows: int) -> Size:
    """A size that can be shown. Raises InputError."""
    if not (LEAST[0] <= columns <= MOST[0] and LEAST[1] <= rows <= MOST[1]):
        least, most = (f"{size[0]}x{size[1]}" for size in (LEAST, MOST))
        raise InputError(f"{columns}x{rows} is not a size: allowed are {least} to {most}")
    return columns, rows


def size_for(floor_plan: FloorPlan, robots: int, zoom: str, status: Status) -> Size:
    """As large as the floor is at this zoom, its margin and the status, within MOST_UNASKED."""
    margins = 2 * MARGIN[0], 2 * MARGIN[1]
    columns, rows = MOST_UNASKED[0] - margins[0], MOST_UNASKED[1] - margins[1] - 2
    camera = Camera(floor_plan, rows, columns, robots)
    aim(camera, zoom)
    height, width = camera.size()
    columns = max(min(width, columns) + margins[0], status.least, LEAST[0])
    rows = min(height, rows) + margins[1] + status.rows(columns)
    return columns, max(rows, LEAST[1])


def aim(camera: Camera, zoom: str) -> None:
    """Set the zoom by its name, "fit" or a step of the ladder. Raises InputError."""
    if zoom == "fit":
        camera.fit()
        return
    steps = {step.name.replace(" ", "-"): step for step in camera.ladder}
    if zoom not in steps:
        raise InputError(f"unknown zoom '{zoom}': allowed are {alternatives(['fit', *steps])}")
    camera.zoom = steps[zoom]
    camera.resize(camera.rows, camera.columns)
