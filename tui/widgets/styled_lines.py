"""The few signs of the panels beside letters, in Unicode and in ASCII.

None is "ambiguous" in Unicode's table of East Asian widths: some terminals draw those two columns wide.
"""

from __future__ import annotations

import re
from collections.abc import Iterable
from typing import Final, NamedTuple

from rich.style import Style

from automaton.floor.floor_plan import FloorPlan
from tui.render.glyphs import GlyphSet


class Signs(NamedTuple):
    """What panels draw with."""

    rising: str  # the order of a column
    falling: str
    before: str  # there is more on the left
    beyond: str
    here: str  # the present, the current choice
    on: str
    off: str
    better: str  # the better of two metrics
    full: str  # of a bar
    half: str
    thin: str  # of a bar of the second kind
    thin_half: str
    dots: bool  # whether there are braille patterns


UNICODE: Final = Signs("▴", "▾", "◃", "▹", "▸", "✓", "⋅", "◂", "⣿", "⡇", "⠶", "⠆", True)
ASCII: Final = Signs("^", "v", "<", ">", ">", "+", "-", "*", "#", "", "=", "", False)


def signs_of(glyphs: GlyphSet) -> Signs:
    """Those that go with the characters of the map."""
    return ASCII if glyphs.name == "ascii" else UNICODE


def bar(share: float, width: int, signs: Signs, thin: bool = False) -> str:
    """A bar of at most `width` columns; something that is not nothing shows."""
    full, half = (signs.thin, signs.thin_half) if thin else (signs.full, signs.half)
    steps = 2 if half else 1
    long = min(width * steps, max(round(share * width * steps), int(share > 0)))
    return (full * (long // steps) + half * (long % steps)).ljust(width)


# Lines of styled text, parts of which lead somewhere; what the panels are made of.


Link = tuple[str, int]  # ("robot" | "cell" | "order" | "tick" or a panel's own word, number)
SPAN_LOOKS = ("plain", "dim", "title", "link", "term", "warn", "fault", "good", "cursor", "focus")
MENTION = re.compile(r"robot (\d+)|\((-?\d+), (-?\d+)\)")
PIECES = re.compile(r"\s+|\S+(?: %)?")  # "15 %" stays together
LABEL = 11  # columns of the name of a fact
MAX_LISTED_LINKS = 12  # links that are named one by one


class Span(NamedTuple):
    """Some text in one look."""

    text: str
    look: str | Style = "plain"  # of SPAN_LOOKS, or a style of its own
    link: Link | None = None


Line = tuple[Span, ...]


def line(*parts: str | Span) -> Line:
    """A line of plain texts and spans."""
    return tuple(Span(part) if isinstance(part, str) else part for part in parts)


def dim(text: str) -> Span:
    return Span(text, "dim")


def title(text: str) -> Span:
    return Span(text, "title")


def term(text: str, link: Link, width: int) -> tuple[Span, ...]:
    """A word that can be explained, in a column."""
    return Span(text, "term", link), Span(" " * max(0, width - len(text)))


def robot_link(robot: int) -> Span:
    return Span(f"robot {robot}", "link", ("robot", robot))


def order_link(order: int, name: str = "order") -> Span:
    return Span(f"{name} {order}", "link", ("order", order))


def tick_link(tick: int) -> Span:
    """A tick to go to; one before the run is plain."""
    return Span(f"tick {tick:,}", "link", ("tick", tick)) if tick >= 0 else Span(f"tick {tick:,}")


def cell_link(floor_plan: FloorPlan, cell: int) -> Span:
    x, y = floor_plan.xy(cell)
    return Span(f"({x}, {y})", "link", ("cell", cell))


def linked(text: str, floor_plan: FloorPlan, look: str = "plain") -> Line:
    """A sentence in which every robot and every cell can be clicked."""
    spans: list[Span] = []
    at = 0
    for found in MENTION.finditer(text):
        spans.append(Span(text[at : found.start()], look))
        robot, x, y = found.groups()
        spans.append(
            robot_link(int(robot))
            if robot is not None
            else cell_link(floor_plan, floor_plan.cell(int(x), int(y)))
        )
        at = found.end()
    return tuple(span for span in (*spans, Span(text[at:], look)) if span.text)


def several(links: list[Span]) -> list[str | Span]:
    """Links as a list; beyond MAX_LISTED_LINKS only how many."""
    parts: list[str | Span] = []
    for link in links[:MAX_LISTED_LINKS]:
        parts += [link, ", "]
    if len(links) > MAX_LISTED_LINKS:
        return [*parts[:-1], f" and {len(links) - MAX_LISTED_LINKS:,} more"]
    return parts[:-1]


def length(spans: Iterable[Span]) -> int:
    """Columns of a line."""
    return sum(len(span.text) for span in spans)


def wrapped(spans: Line, width: int, indent: int = 0, first: int = 0) -> list[Line]:
    """The line broken between words, so that it fits; what leads somewhere is never broken.

    The first line is indented by `first`, the others by `indent`.
    """
    lines: list[list[Span]] = [[Span(" " * first)] if first else []]
    for word in _words(spans):
        gap = Span(" ", word[0].look if not word[0].link else "plain")
        fits = length(lines[-1]) + 1 + length(word) <= width
        if length(lines[-1]) <= (indent if len(lines) > 1 else first):
            lines[-1].extend(word)
        elif fits:
            lines[-1].extend((gap, *word))
        else:
            lines.append([Span(" " * indent), *word] if indent else list(word))
    return [tuple(one) for one in lines]


def _words(spans: Line) -> list[list[Span]]:
    """The pieces between blanks; a word can consist of several spans."""
    words: list[list[Span]] = []
    glued = False
    for span in spans:
        pieces = [span.text] if span.link else PIECES.findall(span.text)
        for piece in pieces:
            if piece.isspace():
                glued = False
                continue
            part = span._replace(text=piece)
            if glued:
                words[-1].append(part)
            else:
                words.append([part])
            glued = True
    return words


def fact(name: str, *parts: str | Span, width: int, label: int = LABEL) -> list[Line]:
    """A name and what is to be said under it, in two columns."""
    value = wrapped(line(*parts), width - label)
    labels = [name, *[""] * (len(value) - 1)]
    return [(dim(one.ljust(label)), *spans) for one, spans in zip(labels, value, strict=True)]
