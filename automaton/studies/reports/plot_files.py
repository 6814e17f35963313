"""Curves and maps as PNG and SVG, by matplotlib (extra `plots`)."""

from __future__ import annotations

import io
import math
import re
import textwrap
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

from automaton.atomic_write import atomic_writer
from automaton.errors import InputError
from automaton.runs.report_document import Block, Curves, HeatMap
from automaton.studies.reports.line_styles import line_style

FORMATS = ("png", "svg")
DPI = 300  # for print
SIZE = (6.5, 4.2)  # inches: the width of a column of text on A4, and half a slide
FONT_SIZES = {  # points; at half a slide they are as large as its text
    "font.size": 10,
    "axes.labelsize": 11,
    "axes.titlesize": 11,
    "legend.fontsize": 9,
}
WIDEST_TITLE = 50
WIDEST_LEGEND = 60  # characters in a line of the legend


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
    import matplotlib

    with matplotlib.rc_context(FONT_SIZES):
        figure = kind(figsize=SIZE, layout="constrained")
        axes = figure.subplots()
        if isinstance(block, Curves):
            draw_curves(figure, axes, block)
        else:
            draw_map(figure, axes, block)
        yield from _saved(figure, block, folder)


def _saved(figure: Any, block: Curves | HeatMap, folder: Path) -> Iterator[Path]:
    for form in FORMATS:
        path = folder / f"{file_name(block.title)}.{form}"
        content = io.BytesIO()
        figure.savefig(
            content, format=form, dpi=DPI, metadata={"Date": None} if form == "svg" else {}
        )
        with atomic_writer(path) as file:
            file.write(content.getvalue())
        yield path


def draw_curves(figure: Any, axes: Any, curves: Curves) -> None:
    """Lines with bars for their intervals; the legend stands below, off the data."""
    for index, line in enumerate(curves.lines):
        down = [value - low for value, low in zip(line.value, line.low, strict=True)]
        up = [high - value for value, high in zip(line.value, line.high, strict=True)]
        style = line_style(index)
        dashes = "none" if curves.x_names else (0, style.dashes) if style.dashes else "solid"
        axes.errorbar(
            line.x,
            line.value,
            yerr=[down, up],
            capsize=3,
            color=style.colour,
            marker=style.marker,
            linestyle=dashes,
            label=line.name or None,
        )
    axes.set_xticks(curves.x)
    if curves.x_names:
        axes.set_xticklabels([curves.x_names[int(x)] for x in curves.x])
    if curves.from_zero:
        axes.set_ylim(bottom=0)
    axes.set(title=curves.title, xlabel=curves.x_label, ylabel=curves.y_label)
    axes.grid(alpha=0.3)
    names = [line.name for line in curves.lines if line.name]
    if names:
        columns = max(1, WIDEST_LEGEND // max(map(len, names)))
        rows = math.ceil(len(names) / columns)
        figure.set_figheight(SIZE[1] + 0.2 * rows)  # the data keep their height
        figure.legend(loc="outside lower center", ncols=columns, handlelength=4, frameon=False)


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
