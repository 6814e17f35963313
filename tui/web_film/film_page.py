"""From a recording to a page: its columns, the floor and its words, and the player, in one file."""

from __future__ import annotations

import base64
import html
import json
import re
import zlib
from importlib.resources import files
from pathlib import Path
from typing import Any, Final

import numpy as np

from automaton.atomic_write import atomic_writer
from automaton.build.resolve import Resolved
from automaton.errors import InputError
from automaton.floor.cells import BAY, CELL_KINDS
from automaton.units import count, unit
from tui.cast.film_target import checked
from tui.playback.run_source import floor_of, recorded
from tui.playback.titles import title_of
from tui.render import styles
from tui.render.cell_looks import colour_of
from tui.render.robot_marks import STATE_COLOURS
from tui.render.scene import DETAIL_SHIFT, KIND_MASK, Floor
from tui.web_film.film_columns import FIGURES, PARTS, FilmColumns, cause_words

GROUND: Final = {
    "floor": styles.COLOUR_FLOOR,
    "void": styles.COLOUR_VOID,
    "text": styles.COLOUR_TEXT,
    "dim": styles.COLOUR_DIM,
    "load": styles.COLOUR_LOAD,
    "selected": styles.COLOUR_SELECTED,
    "waiting": styles.COLOUR_WAITING,
    "done": styles.COLOUR_DONE,
    "cursor": styles.COLOUR_CURSOR,
}
STATES: Final = (
    *("parked", "charging", "without a load", "with a load", "battery low"),
    *("waiting", "in a wait cycle, or down", "selected"),
)


def make_page(
    recording: Path,
    out: Path,
    first: int | None,
    last: int | None,
    *,
    speed: float,
    follow: int,
    theme: str,
) -> None:
    """Write the page, and say how large it is.

    `speed`: 1 is ten ticks a second; `follow`: a robot, or NIL. Raises InputError.
    """
    path = checked(out)
    opening = recorded(recording)
    (run,), (resolved,) = opening.recordings, opening.resolved
    robots = resolved.scenario.fleet.robots
    if follow >= robots:
        raise InputError(f"there is no robot {follow}: the last one is robot {robots - 1}")
    begin, end = first or 0, run.ticks if last is None else last
    if max(begin, end) > run.ticks:
        raise InputError(
            f"there is no tick {max(begin, end):,}: the recording ends at tick {run.ticks:,}"
        )
    if begin > end:
        raise InputError(f"there is nothing from tick {begin:,} to tick {end:,}")
    floor = floor_of(resolved)
    columns = FilmColumns(floor, robots, begin, end)
    _play(run, columns)
    title = title_of(resolved, run.header["seed"], run.stored())
    film = _words(resolved, floor, columns) | {
        "title": title,
        "speed": speed,
        "follow": follow,
        "theme": theme,
        "columns": columns.packed(),
    }
    page = page_of(title, film).encode()
    with atomic_writer(path) as file:
        file.write(page)
    print(f"{out}: {count(end - begin + 1, 'tick')}, {count(len(page), 'byte')}")


def _play(run: Any, columns: FilmColumns) -> None:
    from automaton.evidence.history.playback import Playback
    from automaton.evidence.history.snapshot import take_snapshot

    playback = Playback(run.header, run.stored())
    for tick in range(columns.first, columns.last + 1):
        playback.go_to(tick)
        columns.take(take_snapshot(playback.simulation))


def _words(resolved: Resolved, floor: Floor, columns: FilmColumns) -> dict[str, Any]:
    """What the page knows besides its columns."""
    tick = unit(resolved.scenario.units.tick)
    looks = floor.looks  # with the frame of cells around the floor, for parking bays
    used = [int(look) for look in np.unique(looks)]
    return {
        "box": _box(floor),
        "robots": resolved.scenario.fleet.robots,
        "first": columns.first,
        "last": columns.last,
        "unit": {"size": float(tick.of(1)), "name": tick.plural},
        "battery": floor.battery,
        "headings": floor.headings,
        "parts": PARTS,
        "figures": FIGURES,
        "causes": cause_words(),
        "states": STATES,
        "stride": floor.floor_plan.stride,
        "slots": [int(cell) for cell in floor.slots_cell],
        "endless": [int(one) for one in floor.slots_endless],
        "looks": base64.b64encode(zlib.compress(looks.tobytes(), 9)).decode(),
        "kinds": {str(kind): one.name for kind, one in enumerate(CELL_KINDS)},
        "kind_mask": KIND_MASK,
        "detail_shift": DETAIL_SHIFT,
        "colours": {theme: _colours(used, place) for place, theme in enumerate(("dark", "light"))},
    }


def _box(floor: Floor) -> list[int]:
    """Left, top, right and bottom of the floor with its parking bays; the last two excluded."""
    height, width = floor.looks.shape
    rows, columns = np.nonzero(floor.floor_plan.kind == BAY)
    left, top = min(columns, default=1), min(rows, default=1)
    right, bottom = max(columns, default=0), max(rows, default=0)
    return [
        int(one) - 1
        for one in (
            min(left, 1),
            min(top, 1),
            max(right + 1, width - 1),
            max(bottom + 1, height - 1),
        )
    ]


def _colours(looks: list[int], theme: int) -> dict[str, Any]:
    """The colours of one theme, as a style sheet writes them."""

    def css(colour: int) -> str:
        shades = (styles.COLOURS[colour].dark, styles.COLOURS[colour].light)[theme]
        return f"#{shades.true:06x}"

    return {
        "looks": {str(look): css(colour_of(look)) for look in looks},
        "states": [css(int(colour)) for colour in STATE_COLOURS[: len(STATES)]],
        **{name: css(colour) for name, colour in GROUND.items()},
    }


def page_of(title: str, film: dict[str, Any]) -> str:
    """The page; nothing in it is fetched from elsewhere, and its policy forbids it."""
    here = files("tui.web_film")
    text = json.dumps(film, separators=(",", ":"), ensure_ascii=True).replace("<", "\\u003c")
    page = (here / "page.html").read_text(encoding="utf-8")
    parts = {
        "TITLE": html.escape(title),
        "STYLE": (here / "player.css").read_text(encoding="utf-8"),
        "FILM": text,
        "PLAYER": (here / "player.js").read_text(encoding="utf-8"),
    }
    return re.sub(r"\[\[([A-Z]+)\]\]", lambda name: parts[name[1]], page)
