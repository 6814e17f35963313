"""The gallery of the documentation is what its command makes."""

from __future__ import annotations

import importlib.util
import re
from pathlib import Path

from automaton.scenario.text_files import shipped
from automaton.world.resolve import resolve

DOCS = Path(__file__).parents[2] / "docs"
spec = importlib.util.spec_from_file_location("gallery", DOCS / "gallery.py")
assert spec is not None and spec.loader is not None
gallery = importlib.util.module_from_spec(spec)
spec.loader.exec_module(gallery)


def test_the_page_and_a_picture_are_up_to_date(tmp_path: Path) -> None:
    assert (DOCS / "gallery.md").read_text(encoding="utf-8") == gallery.page()
    assert set(gallery.MOMENTS) <= set(shipped())
    for name in gallery.MOMENTS:
        assert (DOCS / gallery.PICTURES / f"{name}.svg").exists()
    recorded = gallery.recording("tabletop-mini", tmp_path)
    drawing = gallery.drawing(recorded, gallery.MOMENTS["tabletop-mini"])
    assert drawing == (DOCS / gallery.PICTURES / "tabletop-mini.svg").read_text(encoding="utf-8")


def test_tutorials_show_the_scenarios_that_they_contain(tmp_path: Path) -> None:
    for name, (page, tick) in gallery.DRAWN_ON_PAGES.items():
        resolve(str(gallery.on_page(name, tmp_path)))
        text = (DOCS / page).read_text(encoding="utf-8")
        assert f"![{name} at tick {tick}](../pictures/{name}.svg)" in text
        assert (DOCS / "pictures" / f"{name}.svg").exists()
    for page in (DOCS / "tutorials").glob("*.md"):
        assert "\n![" in page.read_text(encoding="utf-8"), f"{page.name} has no picture"


def test_drawn_floors_follow_the_palette_of_the_page() -> None:
    drawn = [*gallery.MOMENTS.keys(), *gallery.DRAWN_ON_PAGES]
    for name in drawn:
        folder = gallery.PICTURES if name in gallery.MOMENTS else gallery.PICTURES.parent
        text = (DOCS / folder / f"{name}.svg").read_text(encoding="utf-8")
        _, dark, light = re.split("<style>|</style>", text)
        assert "@media(prefers-color-scheme:dark){" in dark
        for colour, name in re.findall('fill="(#[0-9a-f]{6})" class="([^"]+)"', light):
            assert name == f"f{colour[1:]}" and f".{name}{{fill:#" in dark
        assert "class" in light and not re.search('(fill|stroke)="#[^"]+"(?! class)', light)
        assert light.count("<image") in (0, 2)
