"""Make the gallery: `python docs/gallery.py`.

It runs each scenario to a tick, draws the floor, and writes `docs/gallery.md` with the pictures, which
are light or dark as the page around them. With `--films FOLDER` it also writes each run up to there as a
page with a film.
"""

from __future__ import annotations

import argparse
import re
import tempfile
from pathlib import Path
from typing import Final

import automaton

DOCS: Final = Path(__file__).parent
PICTURES: Final = Path("pictures/gallery")
MOMENTS: Final = {  # the tick of each picture
    "tabletop-1": 634,
    "tabletop-mini": 120,
    "crossing": 90,
    "goods-mini": 40,
    "goods-60x40": 900,
    "goods-to-person": 300,
    "bad-day": 400,
    "sorting": 300,
    "random-400": 60,
    "depots": 2000,
    "factory": 900,
    "warehouse-100": 400,
}
DRAWN_ON_PAGES: Final = {  # scenarios that tutorials contain: the page, and the tick of the picture
    "my-floor": ("tutorials/your-own-floor.md", 60),
    "my-warehouse": ("tutorials/your-own-warehouse.md", 120),
    "learning-floor": ("tutorials/learn-a-right-of-way.md", 60),
}
HEAD: Final = """<!-- Generated: `python docs/gallery.py` writes this page again. -->
# Gallery

The shipped scenarios, each at one moment of its run. `automaton watch NAME` shows a run from its
beginning; `automaton list` names all scenarios.
"""


def page() -> str:
    """The text of the page."""
    entries = []
    for name, tick in MOMENTS.items():
        scenario = automaton.load(name)
        entries.append(
            f"\n## {name}\n\n{scenario.summary}\n\n![{name} at tick {tick:,}]({PICTURES / name}.svg)\n\n"
            f"`automaton watch {name} --at {tick}`\n"
        )
    return HEAD + "".join(entries)


def recording(name: str, folder: Path) -> automaton.Recording:
    """The run of a scenario up to its moment."""
    return automaton.Simulation(name).run(until=MOMENTS[name]).save(folder / f"{name}.rec")


def on_page(name: str, folder: Path) -> Path:
    """A scenario of a tutorial as a file."""
    page, _ = DRAWN_ON_PAGES[name]
    text = (DOCS / page).read_text(encoding="utf-8")
    found = re.search(rf'```yaml title="{name}.yaml"\n(.*?)```', text, re.DOTALL)
    assert found is not None, f"{page} has no {name}.yaml"
    file = folder / f"{name}.yaml"
    file.write_text(found[1], encoding="utf-8")
    return file


PAINTED: Final = re.compile(r'(fill|stroke)="(#[0-9a-f]{6})"|<image [^>]*/>')


def in_both_palettes(light: str, dark: str) -> str:
    """One SVG of two that differ in colours alone: light, and dark where the page around it is dark."""
    rules = {".dark": "display:inline", ".light": "display:none"}
    darks = PAINTED.finditer(dark)

    def both(one: re.Match[str]) -> str:
        other = next(darks)
        if one[1] is None:  # a bitmap
            images = (
                f'<image class="{name}"{image[0][6:]}'
                for name, image in (("light", one), ("dark", other))
            )
            return "".join(images)
        name = f"{one[1][0]}{one[2][1:]}"
        assert rules.setdefault(f".{name}", f"{one[1]}:{other[2]}") == f"{one[1]}:{other[2]}"
        return f'{one[0]} class="{name}"'

    assert PAINTED.sub("", light) == PAINTED.sub("", dark)
    head, body = PAINTED.sub(both, light).split(">", 1)
    used = "".join(f"{name}{{{rule}}}" for name, rule in rules.items() if f'"{name[1:]}"' in body)
    hidden = "<style>.dark{display:none}" if ".dark" in used else "<style>"
    return f"{head}>{hidden}@media(prefers-color-scheme:dark){{{used}}}</style>{body}"


def drawing(recorded: automaton.Recording, tick: int) -> str:
    """The floor at a tick of a recording, in both palettes."""
    light, dark = (recorded.picture(at=tick, theme=theme).svg for theme in ("light", "dark"))
    return in_both_palettes(light, dark)


def draw_tutorials() -> None:
    """Draw the scenarios that tutorials contain."""
    for name, (_, tick) in DRAWN_ON_PAGES.items():
        with tempfile.TemporaryDirectory() as folder:
            file = on_page(name, Path(folder))
            run = automaton.Simulation(str(file)).run(until=tick)
            recorded = run.save(Path(folder) / f"{name}.rec")
            svg = drawing(recorded, tick)
            (DOCS / "pictures" / f"{name}.svg").write_text(svg, encoding="utf-8")


def make(films: Path | None) -> None:
    """Write the page and its pictures, and films into a folder."""
    (DOCS / PICTURES).mkdir(parents=True, exist_ok=True)
    (DOCS / "gallery.md").write_text(page(), encoding="utf-8")
    draw_tutorials()
    for name in MOMENTS:
        with tempfile.TemporaryDirectory() as folder:
            recorded = recording(name, Path(folder))
            svg = drawing(recorded, MOMENTS[name])
            (DOCS / PICTURES / f"{name}.svg").write_text(svg, encoding="utf-8")
            if films is not None:
                films.mkdir(parents=True, exist_ok=True)
                (films / f"{name}.html").write_text(recorded.film().page, encoding="utf-8")


def main() -> None:
    parser = argparse.ArgumentParser(description="Make the gallery of the documentation.")
    parser.add_argument("--films", type=Path, metavar="FOLDER", help="also write films")
    make(parser.parse_args().films)


if __name__ == "__main__":
    main()
