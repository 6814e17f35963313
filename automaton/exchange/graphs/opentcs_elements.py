"""Read the elements of an openTCS plant model: their attributes, and the line of each.

A DOCTYPE is refused before anything in it is expanded, so no entity of a file is ever read.
"""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Final
from xml.parsers import expat

from automaton.errors import InputError
from automaton.exchange.file_kinds import read_bytes
from automaton.exchange.graphs.graph import single_line

MAX_ELEMENTS: Final = 1_000_000
MAX_DEPTH: Final = 32
CHUNK: Final = 2**20  # bytes that are parsed at a time

# What is read: an element's attributes, and the elements within it.
LOCATION_LAYOUT: Final[dict[str, Any]] = {"": ("locationRepresentation",)}
NAMED: Final[dict[str, Any]] = {"": ("name",)}
MODEL: Final[dict[str, Any]] = {
    "": ("version", "name"),
    "point": {
        "": ("name", "positionX", "positionY", "type"),
        "outgoingPath": {"": ("name",)},
    },
    "path": {
        "": (
            "name",
            "sourcePoint",
            "destinationPoint",
            "length",
            "maxVelocity",
            "maxReverseVelocity",
            "locked",
        ),
    },
    "vehicle": {"": ("name", "maxVelocity")},
    "locationType": {
        "": ("name",),
        "allowedOperation": NAMED,
        "locationTypeLayout": LOCATION_LAYOUT,
    },
    "location": {
        "": ("name", "type", "locked"),
        "link": {"": ("point",), "allowedOperation": NAMED},
        "locationLayout": LOCATION_LAYOUT,
    },
    "block": {"": ("name", "type"), "member": NAMED},
}


@dataclass
class Element:
    """An element that is read."""

    name: str
    attributes: dict[str, str]
    line: int
    parts: list[Element] = field(default_factory=list)

    def of(self, name: str) -> list[Element]:
        """The elements within it that have a name."""
        return [part for part in self.parts if part.name == name]


def read_elements(path: Path, lost: Counter[str]) -> Element:
    """Return the element `model` with what is read of it; count the rest. Raises InputError."""
    file, content = str(path), read_bytes(path)
    handlers = _Handlers(file, lost)
    parser = handlers.parser
    try:
        for first in range(0, len(content), CHUNK):
            parser.Parse(content[first : first + CHUNK], False)
        parser.Parse(b"", True)
    except expat.ExpatError as error:
        text = expat.ErrorString(error.code) or "error"
        raise InputError(f"is not XML: {text}", file, error.lineno) from None
    except (LookupError, ValueError) as error:
        raise InputError(f"is not XML: {error}", file) from None
    assert handlers.root is not None  # there is no XML without an element
    return handlers.root


class _Handlers:
    """What the parser calls."""

    def __init__(self, file: str, lost: Counter[str]) -> None:
        self.file, self.lost = file, lost
        self.root: Element | None = None
        self.open: list[tuple[Element, dict[str, Any]]] = []
        self.depth = self.count = self.unread = 0
        self.parser = expat.ParserCreate()
        self.parser.buffer_text = True
        self.parser.StartDoctypeDeclHandler = self.doctype
        self.parser.StartElementHandler = self.start
        self.parser.EndElementHandler = self.end

    def error(self, text: str) -> InputError:
        """An error in the line where the parser is."""
        return InputError(text, self.file, self.parser.CurrentLineNumber)

    def doctype(self, *_: Any) -> None:
        """Refuse a DOCTYPE."""
        raise self.error("has a DOCTYPE, which no plant model needs: remove it")

    def start(self, tag: str, attributes: dict[str, str]) -> None:
        """Read an element, or count it."""
        self.count += 1
        self.depth += 1
        if self.count > MAX_ELEMENTS:
            raise self.error(f"has more than {MAX_ELEMENTS:,} elements, the most")
        if self.depth > MAX_DEPTH:
            raise self.error(f"is nested more than {MAX_DEPTH} levels deep")
        name = tag.rpartition(":")[2]
        if self.depth == 1 and name != "model":
            raise self.error(f"is XML, but not a plant model: it begins with <{single_line(name)}>")
        known = {"model": MODEL} if self.depth == 1 else self.open[-1][1]
        if self.unread or name not in known:
            if not self.unread:
                self.lost[single_line(name)] += 1
            self.unread += 1
            return
        element = Element(name, attributes, self.parser.CurrentLineNumber)
        for key in attributes:
            if key not in known[name][""] and not key.startswith("xml"):
                self.lost[f"{name} {single_line(key)}"] += 1
        if self.open:
            self.open[-1][0].parts.append(element)
        else:
            self.root = element
        self.open.append((element, known[name]))

    def end(self, _: str) -> None:
        """Close an element."""
        self.depth -= 1
        if self.unread:
            self.unread -= 1
        else:
            self.open.pop()
