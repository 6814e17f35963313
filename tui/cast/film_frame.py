"""How large a film is, and at which step of the zoom ladder it shows the floor."""

from __future__ import annotations

from typing import Final

from automaton.errors import InputError, alternatives
from automaton.floor.floor_plan import FloorPlan
from tui.cast.film_status import Status
from tui.render.camera import Camera

Size = tuple[int, int]  # columns, rows

MIN_FILM_SIZE: Final = (40, 8)
MAX_FILM_SIZE: Final = (500, 200)
MAX_DEFAULT_FILM_SIZE: Final = (120, 40)
FILM_MARGIN: Final = (2, 1)  # around a floor that fits


def checked_size(columns: int, rows: int) -> Size:
    """A size that can be shown. Raises InputError."""
    if not (
        MIN_FILM_SIZE[0] <= columns <= MAX_FILM_SIZE[0]
        and MIN_FILM_SIZE[1] <= rows <= MAX_FILM_SIZE[1]
    ):
        least, most = (f"{size[0]}x{size[1]}" for size in (MIN_FILM_SIZE, MAX_FILM_SIZE))
        raise InputError(f"{columns}x{rows} is not a size: allowed are {least} to {most}")
    return columns, rows


def size_for(floor_plan: FloorPlan, robots: int, zoom: str, status: Status) -> Size:
    """As large as the floor is at this zoom, its margin and the status, within MAX_DEFAULT_FILM_SIZE."""
    margins = 2 * FILM_MARGIN[0], 2 * FILM_MARGIN[1]
    columns, rows = MAX_DEFAULT_FILM_SIZE[0] - margins[0], MAX_DEFAULT_FILM_SIZE[1] - margins[1] - 2
    camera = Camera(floor_plan, rows, columns, robots)
    aim(camera, zoom)
    height, width = camera.size()
    columns = max(min(width, columns) + margins[0], status.least, MIN_FILM_SIZE[0])
    rows = min(height, rows) + margins[1] + status.rows(columns)
    return columns, max(rows, MIN_FILM_SIZE[1])


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
