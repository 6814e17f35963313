"""Maps of ROS, as map_server reads them: a YAML file that names an image, and what its greys mean.

    image: hall.pgm           beside the file, or with its whole path
    resolution: 0.25          metres of a pixel
    origin: [-3.0, -2.0, 0.0] x, y and yaw of the lower left pixel
    negate: 0                 1: white is occupied
    occupied_thresh: 0.65     a pixel is occupied above this share of black,
    free_thresh: 0.196        free below that one, and else unknown
    mode: trinary             left out: trinary; scale is read as trinary; raw: greys are percent

Source: map_server of ROS and Nav2.
"""

from __future__ import annotations

import math
import os
import re
from collections.abc import Mapping
from dataclasses import dataclass
from fractions import Fraction
from pathlib import Path
from typing import Any, Final

import numpy as np
import numpy.typing as npt

from automaton.errors import InputError, nearest
from automaton.exchange.image_values import ImageValues, read_image
from automaton.exchange.pixel_cells import Mask
from automaton.scenario.document import Document, parse, quoted, read_text

MODES: Final = ("trinary", "scale", "raw")
KEYS: Final = (
    *("image", "resolution", "origin", "negate", "occupied_thresh", "free_thresh", "mode"),
)
OPTIONAL: Final = ("origin", "mode")
NUMBER: Final = re.compile(r"[-+]?([0-9]+\.?[0-9]*|\.[0-9]+)([eE][-+]?[0-9]{1,3})?")
RESOLUTIONS: Final = (1e-4, 1e3)  # metres of a pixel
FARTHEST: Final = 1e9  # of an origin
WHITE: Final = 255  # what greys are scaled to
MOST_PERCENT: Final = 100  # greys of raw above this are unknown
IMAGE_BEGINNINGS: Final = ("P2", "P5", "\ufffdPNG")


@dataclass(frozen=True, eq=False)
class RosMap:
    """A map in pixels, the upper row first."""

    resolution: Fraction  # metres of a pixel, as written
    origin: tuple[float, ...]  # x, y, yaw of the lower left pixel
    free: Mask  # (h, w)
    unknown: Mask  # (h, w); the rest is occupied
    mode: str
    unread: tuple[str, ...]  # keys that mean nothing to map_server


def read_ros_map(path: Path) -> RosMap:
    """Read a map and its image. Raises InputError with file and line."""
    file = str(path)
    data, root = parse(_text(path), file)
    if not isinstance(data, dict):
        raise InputError("a map of ROS has keys such as image and resolution; found none", file)
    fields = _Fields(Document(data=data, file=file, root=root))
    fields.check_keys()
    mode = fields.mode()
    resolution = fields.number("resolution", *RESOLUTIONS)
    occupied, free = (fields.number(f"{name}_thresh", 0, 1) for name in ("occupied", "free"))
    negate, origin = fields.negate(), fields.origin()
    image = read_image(fields.image(path.parent))
    is_free, unknown = classes(image, mode, negate, occupied, free)
    return RosMap(
        resolution=Fraction(repr(resolution)),
        origin=origin,
        free=is_free,
        unknown=unknown,
        mode=mode,
        unread=tuple(key for key in data if key not in KEYS),
    )


def classes(
    image: ImageValues, mode: str, negate: bool, occupied: float, free: float
) -> tuple[Mask, Mask]:
    """(h, w) each: the pixels that are free, and those of which nothing is known."""
    grey = WHITE * np.arange(image.white + 1) / image.white  # of each value
    share = grey / MOST_PERCENT if mode == "raw" else (grey if negate else WHITE - grey) / WHITE
    is_unknown = (grey > MOST_PERCENT) & (mode == "raw")
    is_occupied = (share > occupied) & ~is_unknown
    is_free = (share < free) & ~is_occupied & ~is_unknown
    kind: npt.NDArray[np.uint8] = np.where(is_free, 1, np.where(is_occupied, 0, 2)).astype(np.uint8)
    kinds = kind[image.values]
    if image.clear is not None:
        kinds[image.clear] = 2
    return kinds == 1, kinds == 2


def _text(path: Path) -> str:
    """The text of the YAML file. Raises InputError, also for the image itself."""
    with path.open("rb") as stream:
        if stream.read(4).decode("utf-8", "replace").startswith(IMAGE_BEGINNINGS):
            text = "is the image of a map; give the YAML file that names it"
            raise InputError(text, str(path))
    return read_text(path)


class _Fields:
    """The values of the YAML file, checked one by one; errors have the line of the key."""

    def __init__(self, document: Document) -> None:
        self.document = document
        self.data: Mapping[str, Any] = document.data

    def error(self, key: str, message: str) -> InputError:
        return self.document.error((key,), message)

    def check_keys(self) -> None:
        for key in KEYS:
            if key not in self.data and key not in OPTIONAL:
                hint = nearest(key, [name for name in self.data if name not in KEYS])
                text = f"a map of ROS has the key {key}, this one does not{hint}"
                raise InputError(text, self.document.file)

    def mode(self) -> str:
        mode = self.data.get("mode", MODES[0])
        if mode not in MODES:
            hint = nearest(str(mode), MODES)
            known = f"{', '.join(MODES[:-1])} or {MODES[-1]}"
            raise self.error("mode", f"mode must be {known}, found {_shown(mode)}{hint}")
        return str(mode)

    def number(self, key: str, least: float, most: float) -> float:
        value = _number(self.data[key])
        if not least <= value <= most:
            text = f"{key} must be a number from {least:g} to {most:g}"
            raise self.error(key, f"{text}, found {_shown(self.data[key])}")
        return value

    def negate(self) -> bool:
        value = self.data["negate"]
        if value not in (0, 1):
            raise self.error("negate", f"negate must be 0 or 1, found {_shown(value)}")
        return bool(value)

    def origin(self) -> tuple[float, ...]:
        values = self.data.get("origin", [0, 0, 0])
        numbers = [_number(one) for one in values] if isinstance(values, list) else []
        if len(numbers) != 3 or not all(abs(one) <= FARTHEST for one in numbers):
            text = f"origin must be three numbers, x, y and yaw, up to {FARTHEST:g}"
            raise self.error("origin", f"{text}; found {_shown(values)}")
        return tuple(numbers)

    def image(self, folder: Path) -> Path:
        name = self.data["image"]
        if not isinstance(name, str) or not name:
            raise self.error("image", f"image must be the name of a file, found {_shown(name)}")
        path = folder / name  # os.path takes a name that no file can have for one that there is not
        if not os.path.isfile(path):
            why = "is not a regular file" if os.path.exists(path) else "is not there"
            raise self.error("image", f"the image {quoted(name)} {why}")
        return path


def _number(value: Any) -> float:
    """A number, also as YAML 1.1 takes for text (5e-2); NaN for anything else."""
    if isinstance(value, str) and NUMBER.fullmatch(value) and len(value) < 40:
        return float(value)
    if isinstance(value, bool) or not isinstance(value, int | float):
        return math.nan
    return float(value)


def _shown(value: Any) -> str:
    return quoted(value if isinstance(value, str) else repr(value))
