"""Mutants of layouts: files as they look after bad editors, bad exports and bad luck.

Some mutants are changed as text (cut off, bytes flipped, pieces twice), the others as data: a
value becomes another, an entry of a list is gone, there twice, or in another's place. Drawn layouts
beside them are whole, and random: one-way streets, spurs, crossings, speeds, blocks.

    nice python tests/helpers/layout_mutants.py [MUTANTS] [FIRST]
"""

from __future__ import annotations

import contextlib
import io
import json
import random
import re
import sys
import tempfile
from collections import Counter
from pathlib import Path
from typing import Any

from drawn_layouts import drawn_lif, drawn_opentcs
from lif_layouts import LAYOUTS

from automaton.commands import main

MUTATED = ("site-1.lif", "site-2.lif", "site-opentcs.xml")
DRAWN = {"drawn lif": drawn_lif, "drawn opentcs": drawn_opentcs}
OPTIONS = ((), ("--accept", "120%"), ("--cell", "0.5m"), ("--robots", "2"))

VALUES: tuple[Any, ...] = (
    None,
    True,
    "",
    "A",
    "no such thing",
    "\x1b[2J\n\u202e",
    0,
    -1,
    1,
    0.001,
    3.75,
    1e7,
    -1e300,
    10**40,
    [],
    {},
    [[]],
)
TEXTS = (*map(str, VALUES[3:-3]), "NaN", "-Infinity", "true", "4000", "2050", "1e5", "&lt;")
SNIPPETS = (
    "<!DOCTYPE x>",
    "]]>",
    "NaN",
    "1e999",
    "\x00",
    "\ufffd",
    "{" * 50,
    "<a>" * 50,
    '"',
    "&x;",
)


def mutant(text: str, seed: int) -> str:
    """Return a layout that differs from a good one; the same seed gives the same."""
    draw = random.Random(seed)
    for _ in range(draw.choice((1, 1, 1, 2, 5))):
        if draw.random() < 0.15:
            text = _text_mutant(text, draw)
        elif text.lstrip().startswith("{"):
            text = _json_mutant(text, draw)
        else:
            text = _xml_mutant(text, draw)
    return text


def _text_mutant(text: str, draw: random.Random) -> str:
    first, last = sorted(draw.randrange(len(text) + 1) for _ in range(2))
    last = min(last, first + draw.choice((1, 10, 400)))
    return draw.choice(
        (
            text[:first],
            text[:first] + text[last:],
            text[:last] + text[first:],
            text[:first] + draw.choice(SNIPPETS) + text[first:],
            text[:first] + chr(draw.randrange(32, 1000)) + text[first + 1 :],
        )
    )


def _json_mutant(text: str, draw: random.Random) -> str:
    try:
        data = json.loads(text)
    except ValueError:
        return _text_mutant(text, draw)
    spots = list(_spots(data))
    if not spots:
        return text
    inside, key = draw.choice(spots)
    value = inside[key]
    if isinstance(value, int | float) and draw.random() < 0.6:
        inside[key] = value * draw.choice((0.5, 1.01, -1, 10, 1e6)) + draw.choice((0, 0, 0.1, 2))
    elif draw.random() < 0.4:
        inside[key] = draw.choice(VALUES)
    elif isinstance(inside, list) and draw.random() < 0.7:
        other = draw.randrange(len(inside))
        draw.choice(
            (
                lambda: inside.pop(key),
                lambda: inside.insert(other, value),
                lambda: inside.__setitem__(key, inside[other]),
            )
        )()
    else:
        other, name = draw.choice(spots)
        inside[key], other[name] = other[name], value
    try:
        return json.dumps(data)
    except ValueError:  # a value that holds itself
        return text


def _spots(data: Any) -> Any:
    """Yield (list or mapping, key) of all values of some data."""
    for key in list(data) if isinstance(data, dict) else range(len(data)):
        yield data, key
        if isinstance(data[key], dict | list):
            yield from _spots(data[key])


def _xml_mutant(text: str, draw: random.Random) -> str:
    attributes = list(re.finditer(r'(\w+)="([^"]*)"', text))
    lines = text.splitlines(keepends=True)
    if not attributes or draw.random() < 0.3:
        one, other = (draw.randrange(len(lines)) for _ in range(2))
        draw.choice(
            (
                lambda: lines.pop(one),
                lambda: lines.insert(other, lines[one]),
                lambda: lines.__setitem__(one, lines[other]),
            )
        )()
        return "".join(lines)
    place, other = (draw.choice(attributes) for _ in range(2))
    value = draw.choice((*TEXTS, other[2], other[2], ""))
    return draw.choice(
        (
            text[: place.start()] + text[place.end() :],
            text[: place.start(2)] + value + text[place.end(2) :],
            text[: place.start(2)] + value + text[place.end(2) :],
        )
    )


def outcome(name: str, seed: int, folder: Path) -> int:
    """Import a mutant, or a drawn layout; return the exit code.

    Raises AssertionError for a traceback, and for a scenario that `check` refuses.
    """
    drawn = DRAWN.get(name)
    text = drawn(seed) if drawn else mutant((LAYOUTS / name).read_text(), seed)
    path, out = folder / "layout", folder / "floor.yaml"
    path.write_text(text, encoding="utf-8", errors="replace")
    errors = io.StringIO()
    with contextlib.redirect_stdout(io.StringIO()), contextlib.redirect_stderr(errors):
        command = ["import", str(path), "--out", str(out), "--force", *OPTIONS[seed % len(OPTIONS)]]
        code = main(command)
    said = errors.getvalue()
    assert "internal error" not in said, f"{name}, seed {seed}: {said}"
    assert said.count("\n") == (code != 0), f"{name}, seed {seed}: {said}"
    if code == 0:
        with contextlib.redirect_stdout(io.StringIO()), contextlib.redirect_stderr(errors):
            checked = main(["check", str(out)])
        assert checked == 0, f"{name}, seed {seed}: {errors.getvalue()}"
    return code


if __name__ == "__main__":
    many, begin = (int(text) for text in (*sys.argv[1:], "2000", "0")[:2])
    codes: Counter[tuple[str, int]] = Counter()
    with tempfile.TemporaryDirectory() as temporary:
        for number in range(begin, begin + many):
            one = (*MUTATED, *DRAWN)[number % 5]
            codes[one, outcome(one, number, Path(temporary))] += 1
    for (one, exit_code), count in sorted(codes.items()):
        print(f"{one:<18} exit {exit_code}  {count:,}")
