"""The pages beside the README and those of docs, with their blocks of code, headings and links."""

from __future__ import annotations

import re
from functools import cache
from pathlib import Path
from typing import Final, NamedTuple

ROOT: Final = Path(__file__).parents[2]
AT_THE_ROOT: Final = ("README.md", "CONTRIBUTING.md", "SECURITY.md", "CHANGELOG.md")
FENCE: Final = re.compile(
    r"^```(\w*)(?: title=\"([^\"]+)\")?\n(.*?)^```$", re.MULTILINE | re.DOTALL
)


class Block(NamedTuple):
    """A fenced block."""

    language: str
    title: str  # the name of the file that it is, or ""
    text: str


class Page(NamedTuple):
    """One page; `name` is its path from the root."""

    name: str
    text: str

    @property
    def blocks(self) -> list[Block]:
        """Its fenced blocks."""
        return [Block(*match) for match in FENCE.findall(self.text)]

    @property
    def prose(self) -> str:
        """Its text without fenced blocks."""
        return FENCE.sub("", self.text)

    @property
    def anchors(self) -> set[str]:
        """The names of its headings, as links write them."""
        return {anchor(heading) for heading in re.findall(r"^#+ (.+)$", self.prose, re.MULTILINE)}

    @property
    def links(self) -> list[str]:
        """The targets of its links and pictures that are in the project."""
        targets = re.findall(r"\]\(([^)\s]+)\)", self.prose)
        return [target for target in targets if "://" not in target]


def anchor(heading: str) -> str:
    """Return the name of a heading, as links write it."""
    words = re.sub(r"[^\w\- ]", "", heading.lower())
    return words.strip().replace(" ", "-")


@cache
def pages() -> tuple[Page, ...]:
    """Return all pages."""
    paths = [*(ROOT / name for name in AT_THE_ROOT), *sorted((ROOT / "docs").rglob("*.md"))]
    return tuple(
        Page(path.relative_to(ROOT).as_posix(), path.read_text(encoding="utf-8")) for path in paths
    )


def page(name: str) -> Page:
    """Return the page of that path from the root."""
    [found] = [one for one in pages() if one.name == name]
    return found
