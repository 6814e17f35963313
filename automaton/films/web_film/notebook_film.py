"""The page of a film inside a notebook: an iframe that holds the whole page."""

from __future__ import annotations

from dataclasses import dataclass, field
from html import escape
from pathlib import Path

from automaton.atomic_write import atomic_writer


@dataclass(frozen=True)
class NotebookFilm:
    """A page that plays by itself; a notebook shows it, `save` writes it to a file."""

    page: str = field(repr=False)
    title: str
    height: int = 600  # pixels

    def save(self, path: str | Path) -> None:
        """Write the page to a file. Raises InputError."""
        with atomic_writer(Path(path)) as file:
            file.write(self.page.encode())

    def _repr_html_(self) -> str:
        """Show it in a notebook: its scripts reach nothing outside their frame."""
        return (
            f'<iframe srcdoc="{escape(self.page)}" sandbox="allow-scripts" title="{escape(self.title)}"'
            f' width="100%" height="{self.height}" style="border:0"></iframe>'
        )
