"""Curves and maps as PNG and SVG, by matplotlib (extra `plots`)."""

from __future__ import annotations

import io
import re
import textwrap
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

from automaton.atomic_write import atomic_writer
from automaton.errors import InputError
from automaton.runs.report_document import Block, Curves, HeatMap

FORMATS = ("png", "svg")
DPI = 150
WIDEST_TITLE = 50


def figure_class() -> Any:
    """matplotlib's Figure. Raises InputError where it is not installed."""
    try:
        import matplotlib
        from matplotlib.figure import Figure
    except ImportError as error:
        raise InputError(
            f"plots are drawn by matplotlib, which cannot be imported ({error}): "
            "pip install 'fleet-automaton[plots]'"
        ) from None
    matplotlib.rcParams["svg.hashsalt"] = "automaton"  # the same plot gives the same file
    return Figure


def write_plots(blocks: Sequence[Block], folder: Path) -> list[Path]:
    """Each curve and map as PNG and SVG; the files written. Raises InputError."""
    kind = figure_class()
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise InputError(f"cannot make it: {error.strerror}", str(folder)) from None
    return [path for block in blocks for path in _written(kind, block, folder)]


def _written(kind: Any, block: Block, folder: Path) -> Iterator[Path]:
    if not isinstance(block, Curves | HeatMap):
        return
    figure = kind(figsize=(7, 4.2), layout="constrained")
    axes = figure.subplots()
    if isinstance(block, Curves):
        draw_curves(axes, block)
    else:
        draw_map(figure, axes, block)
    for form in FORMATS:
        path = folder / f"{file_name(block.title)}.{form}"
        content = io.BytesIO()
        figure.savefig(
            content, format=form, dpi=DPI, metadata={"Date": None} if form == "svg" else {}
        )
        with atomic_writer(path) as file:
            file.write(content.getvalue())
        yield path


def draw_curves(axes: Any, curves: Curves) -> None:
    """Lines with bars for their intervals."""
    for line in curves.lines:
        down = [value - low for value, low in zip(line.value, line.low, strict=True)]
        up = [high - value for value, high in zip(line.value, line.high, strict=True)]
        name = line.name or None
        axes.errorbar(line.x, line.value, yerr=[down, up], marker="o", capsize=3, label=name)
    axes.set_xticks(curves.x)
    axes.set(title=curves.title, xlabel=curves.x_label, ylabel=curves.y_label)
    axes.grid(alpha=0.3)
    if any(line.name for line in curves.lines):
        axes.legend()


def draw_map(figure: Any, axes: Any, heat: HeatMap) -> None:
    """A floor in colours."""
    image = axes.imshow(heat.field, cmap="inferno", interpolation="nearest")
    title = "\n".join(textwrap.wrap(heat.title, WIDEST_TITLE))
    axes.set(title=title, xlabel=heat.note)
    axes.set_xticks([])
    axes.set_yticks([])
    figure.colorbar(image, label=heat.unit)


def file_name(title: str) -> str:
    """A title as the name of a file."""
    return re.sub(r"[^a-z0-9]+", "-", title.lower()).strip("-")[:80] or "plot"
