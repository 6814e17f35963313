"""What is shown instead of the viewer while the terminal is too small for it."""

from __future__ import annotations

from typing import Final

from textual.widgets import Static

COLUMNS: Final = 60
ROWS: Final = 16


class TooSmall(Static):
    """Says what is needed; goes away when the terminal grows."""

    DEFAULT_CSS = (
        "TooSmall { display: none; width: 1fr; height: 1fr; content-align: center middle; }"
    )

    def measure(self, columns: int, rows: int) -> bool:
        """Whether the terminal is too small."""
        self.update(f"automaton needs {COLUMNS}x{ROWS}, has {columns}x{rows}")
        return columns < COLUMNS or rows < ROWS
