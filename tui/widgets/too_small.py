"""What a terminal that is too small shows in place of everything else, and the classes of sizes."""

from __future__ import annotations

from typing import Final

from textual.widgets import Static

MIN_TERMINAL_COLUMNS: Final = 60


MIN_TERMINAL_ROWS: Final = 16


# From how many columns and rows on a screen bears which class: one of each.
ACROSS: Final = [(0, "-tight"), (MIN_TERMINAL_COLUMNS, "-narrow"), (100, "-normal"), (160, "-wide")]


DOWN: Final = [(0, "-flat"), (MIN_TERMINAL_ROWS, "-short"), (24, "-low"), (30, "-high")]


class TooSmall(Static):
    """Says what is needed; goes away when the terminal grows."""

    DEFAULT_CSS = (
        "TooSmall { display: none; width: 1fr; height: 1fr; content-align: center middle; }"
    )

    def measure(self, columns: int, rows: int) -> None:
        """Say how large the terminal is."""
        self.update(
            f"automaton needs {MIN_TERMINAL_COLUMNS}x{MIN_TERMINAL_ROWS}, has {columns}x{rows}"
        )


def size_classes(columns: int, rows: int) -> dict[str, bool]:
    """Which of the classes a screen of this size bears."""
    bears: dict[str, bool] = {}
    for cells, table in ((columns, ACROSS), (rows, DOWN)):
        own = max(step for step in table if step[0] <= cells)
        bears |= {step[1]: step == own for step in table}
    return bears
