"""A picture of a floor with its robots that notebooks show and that can be kept in a file."""

from __future__ import annotations

import html
import pathlib
from dataclasses import dataclass
from functools import cached_property

from automaton.atomic_write import atomic_writer
from automaton.drawings.floor_svg import floor_svg
from automaton.drawings.moment import DrawnFloor, Moment
from automaton.drawings.palette import Theme
from automaton.engine.state import NIL


@dataclass(frozen=True, eq=False)
class FloorPicture:
    """A moment of a run; it is drawn when it is looked at. `caption` says which run and tick it is."""

    floor: DrawnFloor
    moment: Moment
    caption: str
    theme: Theme = "light"
    selected: int = NIL  # robot

    @cached_property
    def svg(self) -> str:
        """The drawing as SVG, which loads nothing."""
        return floor_svg(self.floor, self.moment, self.theme, self.selected, self.caption)

    def save(self, path: str | pathlib.Path) -> None:
        """Write the SVG to a file. Raises InputError."""
        with atomic_writer(pathlib.Path(path)) as file:
            file.write(self.svg.encode())

    def _repr_html_(self) -> str:
        """Show it in a notebook."""
        return f"<div>{self.svg}<p>{html.escape(self.caption)}</p></div>"
