"""Recognize the files of other programs by what they hold, not by their names.

A file is read whole only by its own reader. Here its first bytes are looked at, of JSON the keys at
the top; where they say nothing, the name decides whose reader says what is wrong.
"""

from __future__ import annotations

import os
import re
from pathlib import Path
from typing import Any, Final

import msgspec

from automaton.errors import InputError

MAX_BYTES: Final = 64 * 2**20
HEAD_BYTES: Final = 65_536

FOLDER: Final = "folder"
MAP: Final = "map"
SCEN: Final = "scen"
LEAGUE: Final = "league"
LIF: Final = "lif"
OPENTCS: Final = "opentcs"
ROS: Final = "ros"

KINDS: Final = {  # kind: what it is called
    LIF: "VDMA LIF",
    OPENTCS: "openTCS plant model",
    ROS: "map of ROS",
    MAP: "MovingAI map",
    SCEN: "MovingAI scenario",
    LEAGUE: "problem of the League of Robot Runners",
}
BEGINNINGS: Final = (  # kind, and what its first lines are like
    (MAP, re.compile(rb"\s*type\s+\w+\s")),
    (SCEN, re.compile(rb"\s*version\s+\d")),
    (OPENTCS, re.compile(rb"\s*<")),
    (
        ROS,
        re.compile(rb"(?sm)(?!\s*\{)(?=.*^[ \t]*image[ \t]*:)(?=.*^[ \t]*resolution[ \t]*:)"),
    ),
    (ROS, re.compile(rb"P[25]\s|\x89PNG")),  # the image instead of the file that names it
)
SUFFIXES: Final = {
    **{".map": MAP, ".scen": SCEN, ".json": LEAGUE, ".lif": LIF, ".xml": OPENTCS},
    **{".yaml": ROS, ".yml": ROS},
}
LIF_KEYS: Final = frozenset(("layouts", "origins", "metaInformation"))
BYTE_ORDER_MARK: Final = b"\xef\xbb\xbf"


def kind_of(path: Path) -> str:
    """Return one of the kinds above. Raises InputError for what is not a file, or none of them."""
    file = str(path)
    if os.path.isdir(path):
        return FOLDER
    if not os.path.exists(path):
        raise InputError("no such file", file)
    if not os.path.isfile(path):
        raise InputError("is not a regular file", file)
    head = read_bytes(path, HEAD_BYTES, cut=True).removeprefix(BYTE_ORDER_MARK)
    for kind, beginning in BEGINNINGS:
        if beginning.match(head):
            return kind
    if head.lstrip().startswith(b"{"):
        return LIF if LIF_KEYS & _top_keys(path, head) else LEAGUE
    kind = SUFFIXES.get(path.suffix.lower(), "")
    if not kind:
        known = ", ".join(KINDS.values())
        raise InputError(
            f"is not in one of the formats that are read: {known}, or a folder with map.txt, "
            "agents_K.csv and tasks_one.csv",
            file,
        )
    return kind


def read_bytes(path: Path, most: int = MAX_BYTES, cut: bool = False) -> bytes:
    """Read a file of at most so many bytes; `cut`: only its beginning. Raises InputError."""
    try:
        with path.open("rb") as file:
            data = file.read(most + (not cut))
    except OSError as error:
        raise InputError(f"cannot be read: {error.strerror or error}", str(path)) from None
    if len(data) > most:
        raise InputError(f"has more than {most // 2**20} MiB, which is the most", str(path))
    return data


def _top_keys(path: Path, head: bytes) -> set[str]:
    """Return the keys of a JSON object; those of LIF that its beginning has where it is broken."""
    content = head if len(head) < HEAD_BYTES else read_bytes(path)
    try:
        data: dict[str, Any] = msgspec.json.decode(content, type=dict[str, msgspec.Raw])
    except (msgspec.MsgspecError, UnicodeDecodeError, RecursionError):
        return {key for key in LIF_KEYS if f'"{key}"'.encode() in head}
    return set(data)
