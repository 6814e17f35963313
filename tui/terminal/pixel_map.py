"""Maps in pixels, where the terminal shows images: the picture of films, by kitty graphics or sixel.

The picture is divided into blocks of 4 x 2 characters. Painting and sending follow what changed:

    robots that moved -> rectangles -> their blocks -> one image each at its place on the screen

A cell of the floor takes the same characters as in text, so that clicks, zooming and panning mean the
same. Where anything covers a map, or where it shows something that films do not (a layer, trails, a
zone), it is text. A kitty terminal draws images over the text, so they are deleted first; the images of
sixel vanish when text is written over them.
"""

from __future__ import annotations

import base64
import fcntl
import re
import struct
import sys
import termios
import zlib
from collections.abc import Callable, Generator, Iterator
from dataclasses import dataclass
from functools import lru_cache
from typing import TYPE_CHECKING, Any, Final, Literal

import numpy as np
from numpy.typing import NDArray
from textual._parser import ParseEOF, ParseTimeout, Peek1, Read1, TokenCallback
from textual._xterm_parser import XTermParser
from textual.constants import ESCAPE_DELAY
from textual.drivers import linux_driver
from textual.message import Message

from automaton.drawings.looks import PALETTE
from automaton.drawings.moment import DrawnFloor, Moment, empty_moment, full_cells, moment_of_fleet
from automaton.drawings.shapes import Box, Disc, Shape
from automaton.films.painter import Layout, Painter

if TYPE_CHECKING:
    from PIL.Image import Image

    from tui.render.camera import Camera
    from tui.render.scene import Scene, ShownFloor

Rectangle = tuple[int, int, int, int]  # left, top, right, bottom in pixels

BLOCK_COLUMNS: Final = 4  # characters
BLOCK_ROWS: Final = 2
SLOW_PIXELS: Final = "pixels are too slow here, so the map is text; --pixels off starts with text"
NO_SIZE: Final = "the terminal does not say how many pixels a character has, so the map is text"
# A frame of 1,000 robots takes 40 ms of CPU by kitty graphics, and 110 ms by sixel.
MAX_ROBOTS: Final = 500
# What is painted over the floor and under the robots, or around them.
ROUTE_SHAPES: Final = (Disc(0.5, 0.5, 0.1, "cursor"),)
GOAL_SHAPES: Final = (Disc(0.5, 0.5, 0.4, "cursor", 0.08),)
CURSOR_SHAPES: Final = (Box(0.03, 0.03, 0.94, 0.94, "cursor", 0.08),)
GHOST_SHAPES: Final = (Disc(0.5, 0.5, 0.36, "dim", 0.08),)
MARK_SHAPES: Final = (Disc(0.5, 0.5, 0.54, "cursor", 0.08),)


def can_paint(scene: Scene) -> bool:
    """Whether the picture of films shows all that the user wants to see."""
    if scene.snapshot is not None and len(scene.snapshot.robots.cell) > MAX_ROBOTS:
        return False
    more = scene.layer or scene.lines or scene.slow_places or scene.colouring != "state"
    return not (more or scene.trails.size or scene.zone_cells.size)


@dataclass(frozen=True)
class MapLayout(Layout):
    """A picture without title and progress bar, at a place of the floor."""

    at: tuple[float, float] = (0.0, 0.0)  # the upper left corner in cells

    @property
    def map_size(self) -> tuple[int, int]:
        return self.width, self.height

    def corner(self, place: tuple[float, float] | None) -> tuple[float, float]:
        return self.at


def layout_seen(camera: Camera, rows: int, columns: int, character: tuple[int, int]) -> MapLayout:
    """The layout in which cells take the characters that they take in the text of this camera.

    `character`: its width and height in pixels.
    """
    down, across = camera.zoom.scale
    wide, high = across * character[0], down * character[1]
    left = camera.left / across + camera.shown.left - 1
    top = camera.top / down + camera.shown.top - 1
    size = columns * character[0], rows * character[1]
    return MapLayout(*size, wide, (0, 0, 0, 0), high / wide, (left, top))


def drawn_floor_of(floor: ShownFloor) -> DrawnFloor:
    """The floor as films draw it."""
    constants = floor.headings, floor.battery, floor.faults
    return DrawnFloor(floor.floor_plan, *constants, floor.place_names, floor.levels)


def moment_seen(scene: Scene, floor: DrawnFloor) -> Moment:
    """The moment of a scene."""
    snapshot = scene.snapshot
    if snapshot is None:
        return empty_moment()
    shut = np.concatenate(scene.shut_cells).astype(np.int32)
    return moment_of_fleet(
        floor, snapshot.robots, snapshot.tick, full_cells(snapshot, floor), np.unique(shut)
    )


class PaintedMap:
    """The picture of one map, painted again only where it changes."""

    def __init__(
        self, floor: ShownFloor, layout: MapLayout, theme: Literal["dark", "light"]
    ) -> None:
        self.floor, self.layout, self.theme = floor, layout, theme
        self._drawn = drawn_floor_of(floor)
        self._painter = Painter(self._drawn, layout, theme)
        self._signs: dict[Any, Image] = {}
        self._extents: dict[Any, Rectangle] = {}  # of signs
        self._base: Image | None = None  # the floor with loads
        self._loads: tuple[NDArray[np.int32], NDArray[np.int32]] | None = None
        self._items: dict[tuple[Any, ...], None] = {}  # sign and place, in painting order
        self.image: Image

    def update(self, scene: Scene) -> list[Rectangle] | None:
        """Paint a scene; returns the rectangles that may have changed, or None for the whole."""
        moment = moment_seen(scene, self._drawn)
        changed = self._update_base(moment)
        items = dict.fromkeys(self._items_of(scene, moment))
        if changed is None:
            assert self._base is not None
            self.image = self._base.copy()
        else:
            assert self._base is not None
            for rectangle in (*changed, *(self._rectangle(item) for item in self._items)):
                self.image.paste(self._base.crop(rectangle), rectangle[:2])
            changed += [self._rectangle(item) for item in items.keys() ^ self._items.keys()]
        for item in items:
            self._paint(item)
        self._items = items
        return changed

    def _update_base(self, moment: Moment) -> list[Rectangle] | None:
        """Paint the floor and its loads; returns the rectangles that changed, None: all of it."""
        before, self._loads = self._loads, (moment.full, moment.shut)
        if self._base is not None and before is not None:
            pairs = list(zip(before, self._loads, strict=True))
            if all(np.array_equal(old, new) for old, new in pairs):
                return []
            cells = np.concatenate([np.setxor1d(old, new) for old, new in pairs])
            layout = self.layout
            self._base = self._painter.floor_with_loads(moment, layout.at)
            stride = self._drawn.floor_plan.stride
            return [self._cell(cell % stride - 1, cell // stride - 1) for cell in cells.tolist()]
        self._base = self._painter.floor_with_loads(moment, self.layout.at)
        return None

    def _items_of(self, scene: Scene, moment: Moment) -> Iterator[tuple[Any, ...]]:
        """The signs on the floor in painting order: kind, place in cells, and the sign's name."""
        stride = self._drawn.floor_plan.stride

        def signs(shapes: tuple[Shape, ...], cells: NDArray[np.int32]) -> Iterator[Any]:
            for cell in cells.tolist():
                yield shapes, cell % stride - 1, cell // stride - 1

        yield from signs(GHOST_SHAPES, scene.ghosts)
        yield from signs(ROUTE_SHAPES, scene.route[:-1])
        yield from signs(GOAL_SHAPES, scene.route[-1:])
        if scene.cursor is not None:
            yield from signs(CURSOR_SHAPES, np.array([scene.cursor]))
        selected = scene.selected
        if (ends := self._painter.wait_line(moment, selected, self.layout.at)) is not None:
            yield "wait", *ends
        looks = moment.looks
        names = np.column_stack((looks.state, looks.shape, looks.direction)).tolist()
        places = np.column_stack((moment.x, moment.y)).tolist()
        for robot in np.flatnonzero(~np.isnan(moment.x)).tolist():
            sign = ("robot", robot, *names[robot], robot == selected)
            if sign not in self._signs:
                self._signs[sign] = self._painter.robot_sign(moment, robot, selected)
            yield sign, *places[robot]
        for robot in scene.marked.tolist():
            if not np.isnan(moment.x[robot]):
                yield MARK_SHAPES, *places[robot]

    def _sign(self, name: Any) -> Image:
        if name not in self._signs:
            self._signs[name] = self._painter.sign((name,), name)
        return self._signs[name]

    def _paint(self, item: tuple[Any, ...]) -> None:
        sign, *place = item
        if sign == "wait":
            self._painter.draw_wait(self.image, place)
        else:
            x, y = place
            self._painter.paste(self.image, self._sign(sign), x, y, self.layout.at)

    def _rectangle(self, item: tuple[Any, ...]) -> Rectangle:
        """The pixels of a sign, inside the picture."""
        sign, *place = item
        if sign == "wait":
            x, y = zip(*place, strict=True)
            edge = max(2, round(0.08 * self.layout.scale))
            box = (int(min(x)) - edge, int(min(y)) - edge, int(max(x)) + edge, int(max(y)) + edge)
        else:
            image = self._sign(sign)
            across, down = self._painter.position(image, place[0], place[1], self.layout.at)
            if sign not in self._extents:  # without the transparent margins
                self._extents[sign] = image.getbbox() or (0, 0, 0, 0)
            left, top, right, bottom = self._extents[sign]
            box = (across + left, down + top, across + right, down + bottom)
        return self._inside(box)

    def _point(self, x: float, y: float) -> tuple[float, float]:
        layout = self.layout
        return (x + 0.5 - layout.at[0]) * layout.scale, (y + 0.5 - layout.at[1]) * layout.scale_down

    def _cell(self, x: int, y: int) -> Rectangle:
        """The pixels of a cell and of the load in it."""
        (middle_x, middle_y), layout = self._point(x, y), self.layout
        wide, high = 0.8 * layout.scale + 1, 0.8 * layout.scale_down + 1
        box = (middle_x - wide, middle_y - high, middle_x + wide, middle_y + high)
        return self._inside(tuple(int(one) for one in box))

    def _inside(self, box: tuple[int, ...]) -> Rectangle:
        width, height = self.layout.width, self.layout.height
        left, right = (min(max(one, 0), width) for one in (box[0], box[2]))
        top, bottom = (min(max(one, 0), height) for one in (box[1], box[3]))
        return left, top, right, bottom


# Images as sequences. kitty: https://sw.kovidgoyal.net/kitty/graphics-protocol/; sixel: VT340.


KITTY_CHUNK: Final = 4096  # characters of a sequence
DELETE_KITTY_IMAGES: Final = "\x1b_Ga=d,d=A,q=2\x1b\\"
MAX_REGISTERS: Final = 256
NO_REGISTER: Final = -1
SIXEL_ROWS: Final = 6  # pixels, the bits of a character from "?" on
REPEATED: Final = re.compile(rb"([?-~])\1{3,}")


def kitty_image(image: Image, number: int, columns: int, rows: int) -> str:
    """The sequence that shows an image on `columns` x `rows` characters at the cursor, over text.

    It replaces the image with the same number.
    """
    keys = f"a=T,f=24,o=z,i={number},p=1,q=2,C=1,z=1,s={image.width},v={image.height}"
    data = _compressed(image.tobytes())
    parts = [data[at : at + KITTY_CHUNK] for at in range(0, len(data), KITTY_CHUNK)]
    first = f"{keys},c={columns},r={rows},m={int(len(parts) > 1)};{parts[0]}"
    rest = [f"m={int(at < len(parts))};{part}" for at, part in enumerate(parts[1:], start=2)]
    return "".join(f"\x1b_G{part}\x1b\\" for part in (first, *rest))


@lru_cache(maxsize=1024)
def _compressed(pixels: bytes) -> str:
    return base64.b64encode(zlib.compress(pixels, 6)).decode()


class SixelColours:
    """The registers of colours: those of the themes, others in turn, then the nearest of these.

    Colours that differ in the lower 3 bits of their channels alone share a register.
    """

    def __init__(self) -> None:
        self._colours: list[tuple[int, ...]] = []
        self._register = np.full(1 << 15, NO_REGISTER, np.int16)  # by 5 bits of each channel
        themes = np.array([colour for pair in PALETTE.values() for colour in pair])
        self._add(themes[:, None] >> np.array([16, 8, 0]) & 255)

    def sixels(self, image: Image) -> str:
        """The sequence that shows an image at the cursor."""
        numbers = self.numbers(np.asarray(image))
        lines = []
        for top in range(0, image.height, SIXEL_ROWS):
            band = numbers[top : top + SIXEL_ROWS]
            registers = np.flatnonzero(np.bincount(band.reshape(-1)))
            bits = np.packbits(band == registers[:, None, None], axis=1, bitorder="little")[:, 0]
            rows = (
                b"#%d%s" % (register, REPEATED.sub(_repeat, row.tobytes().rstrip(b"?")))
                for register, row in zip(registers.tolist(), bits + np.uint8(ord("?")), strict=True)
            )
            lines.append(b"$".join(rows))
        used = np.flatnonzero(np.bincount(numbers.reshape(-1))).tolist()
        defined = b"".join(self.definition(register) for register in used)
        head = b'\x1bP0;1;0q"1;1;%d;%d' % image.size
        return (head + defined + b"-".join(lines) + b"\x1b\\").decode()

    def numbers(self, pixels: NDArray[np.uint8]) -> NDArray[np.int16]:
        """The register of each pixel."""
        numbers = self._register[_bins(pixels)]
        missing = pixels[numbers == NO_REGISTER]
        if missing.size:
            colours, times = np.unique(missing, axis=0, return_counts=True)
            self._add(colours[np.argsort(-times, kind="stable")])  # flat colours come first
            numbers = self._register[_bins(pixels)]
        return numbers

    def definition(self, register: int) -> bytes:
        """The definition of a register; its colours are percentages."""
        red, green, blue = (round(one * 100 / 255) for one in self._colours[register])
        return b"#%d;2;%d;%d;%d" % (register, red, green, blue)

    def _add(self, colours: NDArray[Any]) -> None:
        for at, colour in zip(_bins(colours).tolist(), colours.tolist(), strict=True):
            if self._register[at] != NO_REGISTER:
                continue
            self._register[at] = len(self._colours)
            if len(self._colours) < MAX_REGISTERS:
                self._colours.append(tuple(colour))
            else:
                away = ((np.array(self._colours) - np.array(colour)) ** 2).sum(axis=1)
                self._register[at] = away.argmin()


def _bins(pixels: NDArray[Any]) -> NDArray[np.int32]:
    """The upper 5 bits of each channel, packed."""
    wide: NDArray[np.int32] = pixels.astype(np.int32) >> 3
    return wide[..., 0] << 10 | wide[..., 1] << 5 | wide[..., 2]


def _repeat(run: re.Match[bytes]) -> bytes:
    return b"!%d%s" % (len(run[0]), run[1])


# Maps on the screen.


class ShownMap:
    """What the terminal shows of one map in pixels."""

    def __init__(self, side: int) -> None:
        self._first = 1 + side * 100_000  # number of its first image
        self._painted: PaintedMap | None = None
        self.region: Any = None  # on the screen in characters; None: it shows text,
        self.is_covered = False  # because something covers it

    def update(
        self, scene: Scene, layout: MapLayout, region: Any, theme: Literal["dark", "light"]
    ) -> set[tuple[int, int]] | None:
        """Paint; returns the changed blocks as row and column, or None for all."""
        painted = self._painted
        wanted = (scene.floor, layout, theme)
        if painted is None or (painted.floor, painted.layout, painted.theme) != wanted:
            painted = self._painted = PaintedMap(*wanted)
        changed = painted.update(scene)
        is_new, self.region = self.region != region, region
        if changed is None or is_new:
            return None
        wide = layout.width // region.width * BLOCK_COLUMNS
        high = layout.height // region.height * BLOCK_ROWS
        return {
            (row, column)
            for left, top, right, bottom in changed
            for row in range(top // high, -(-bottom // high))
            for column in range(left // wide, -(-right // wide))
        }

    def kitty(self, blocks: set[tuple[int, int]] | None) -> Iterator[str]:
        """The sequences of changed blocks, all if None."""
        across = -(-self.region.width // BLOCK_COLUMNS)
        down = -(-self.region.height // BLOCK_ROWS)
        every = ((row, column) for row in range(down) for column in range(across))
        for row, column in every if blocks is None else sorted(blocks):
            place, image, size = self._cut(row, column, column + 1)
            yield place + kitty_image(image, self._first + row * across + column, *size)

    def sixel(self, blocks: set[tuple[int, int]] | None, colours: SixelColours) -> Iterator[str]:
        """The sequences of changed blocks, adjacent ones as one image; all as one if None."""
        if blocks is None:
            assert self._painted is not None
            place, _, _ = self._cut(0, 0, 1)
            yield place + colours.sixels(self._painted.image)
            return
        for row, column in sorted(blocks):
            if (row, column - 1) not in blocks:
                end = column + 1
                while (row, end) in blocks:
                    end += 1
                place, image, _ = self._cut(row, column, end)
                yield place + colours.sixels(image)

    def _cut(self, row: int, column: int, end: int) -> tuple[str, Image, tuple[int, int]]:
        """The move to a row of blocks from `column` to `end`, its image, and its characters."""
        assert self._painted is not None
        region, image = self.region, self._painted.image
        wide, high = image.width // region.width, image.height // region.height
        left, top = column * BLOCK_COLUMNS, row * BLOCK_ROWS
        right, bottom = min(end * BLOCK_COLUMNS, region.width), min(top + BLOCK_ROWS, region.height)
        box = (left * wide, top * high, right * wide, bottom * high)
        place = f"\x1b[{region.y + top + 1};{region.x + left + 1}H"
        return place, image.crop(box), (right - left, bottom - top)


# Questions. Each answer of the terminal is taken out of the input, whenever it comes: Textual's parser
# would make keys of it.

PIXELS_QUESTION: Final = "\x1b_Gi=31,s=1,v=1,a=q,t=d,f=24;AAAA\x1b\\\x1b[16t\x1b[c"
KITTY: Final = "\x1b_Gi=31;OK\x1b\\"
CHARACTER_ANSWER: Final = re.compile(r"\x1b\[6;(\d+);(\d+)t")  # its height and width in pixels
KIND_ANSWER: Final = re.compile(r"\x1b\[\?([\d;]*)c")  # sixel is 4
ANSWER: Final = re.compile(
    rf"{CHARACTER_ANSWER.pattern}|{KIND_ANSWER.pattern}|\x1b(?:_G[^\x1b]*|\]11;[^\x07\x1b]*)(?:\x1b\\|\x07)"
)
BEGUN: Final = re.compile(  # a part of an answer from its beginning on
    r"\x1b(?:_(?:G[^\x1b]*\x1b?)?|\](?:1(?:1(?:;[^\x07\x1b]*\x1b?)?)?)?|\[(?:\?[\d;]*|6[\d;]*)?)?"
)
REST_TIMEOUT_S: Final = 2.0  # for the rest of an answer


class TerminalAnswer(Message):
    """An answer of the terminal to a question of the viewer."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.text = text


class AnswerParser(XTermParser):
    """Textual's parser of input, which does not get the answers."""

    def parse(self, token_callback: TokenCallback[Message]) -> Generator[Read1 | Peek1, str, None]:
        parser = super().parse(token_callback)
        wanted, held = next(parser), ""
        while True:
            certain = len(held) > 2  # no key begins so
            try:
                held += yield (
                    Read1(REST_TIMEOUT_S if certain else ESCAPE_DELAY) if held else wanted
                )
                timeout = None
            except ParseTimeout as error:
                timeout = error
            except ParseEOF:
                return
            if timeout is None and ANSWER.fullmatch(held):
                token_callback(TerminalAnswer(held))
                held = ""
            elif timeout is not None or not BEGUN.fullmatch(held):
                for character in held:
                    wanted = parser.send(character)
                if timeout is not None and wanted.timeout is not None:
                    wanted = parser.throw(timeout)
                held = ""


def character_size() -> tuple[int, int]:
    """Width and height of a character in pixels, from the kernel; (0, 0) if unknown."""
    try:
        packed = fcntl.ioctl(sys.__stdout__.fileno(), termios.TIOCGWINSZ, bytes(8))  # type: ignore[union-attr]
    except (AttributeError, OSError, ValueError):
        return 0, 0
    rows, columns, width, height = struct.unpack("HHHH", packed)
    return width // max(columns, 1), height // max(rows, 1)


class PixelScreen:
    """All maps in pixels, and whether this terminal keeps up with them."""

    def __init__(self, presenter: Any, wanted: str) -> None:
        """`presenter`: the one of the maps."""
        self._presenter, self._wanted = presenter, wanted
        self.protocol: str = "off" if wanted == "auto" else wanted
        self._size = (0, 0)  # of a character as answered
        self._answered = False
        self._maps: dict[Any, ShownMap] = {}  # by widget
        self._colours = SixelColours()
        vars(linux_driver)["XTermParser"] = AnswerParser

    def ask(self) -> None:
        """Ask the terminal whether it shows images, if the user wants any."""
        if self._wanted != "off" and not self._presenter.why_not:
            self._presenter.add(PIXELS_QUESTION)

    def answered(self, text: str) -> bool:
        """Note an answer; returns whether maps may look different now."""
        kind = KIND_ANSWER.fullmatch(text)
        self._answered |= kind is not None
        if size := CHARACTER_ANSWER.fullmatch(text):
            self._size = int(size[2]), int(size[1])
        elif self._wanted == "auto" and text == KITTY:
            self.protocol = "kitty"
        elif self._wanted == "auto" and kind and "4" in kind[1].split(";")[1:]:
            self.protocol = "sixel" if self.protocol == "off" else self.protocol
        return self.protocol != "off"

    def present(
        self,
        view: Any,
        scene_of: Callable[[], Scene],
        camera: Camera,
        theme: Literal["dark", "light"],
        is_covered: bool,
    ) -> bool | None:
        """Show a scene; returns whether anything was written, or None if text must show it.

        `is_covered`: something is drawn over the map that only text can show.
        """
        shown = self._maps.setdefault(view, ShownMap(len(self._maps)))
        character = self._character() if self.protocol != "off" else (0, 0)
        scene = scene_of() if all(character) and not is_covered else None
        possible = scene is not None and can_paint(scene)
        region = self._presenter.uncovered(view) if possible else None
        shown.is_covered = possible and region is None
        if scene is None or region is None or view.shown is None:
            self.hide(view)
            return None
        if self.protocol == "kitty" and shown.region not in (None, region):
            self.hide(view)
        layout = layout_seen(camera, region.height, region.width, character)
        blocks = shown.update(scene, layout, region, theme)
        pieces = (
            shown.kitty(blocks) if self.protocol == "kitty" else shown.sixel(blocks, self._colours)
        )
        text = "".join(pieces)
        if text:
            self._presenter.add(text)
        return bool(text)

    def leave(self, pace: Any) -> str:
        """Show text from now on if images are impossible, or the terminal does not keep up with them.

        `pace`: the tui.terminal.frame_pacing.FramePacer of the terminal, which learns whether there are
        images. Returns why, "" if all is as before.
        """
        pace.has_images = any(one.region is not None for one in self._maps.values())
        if self.protocol == "off":
            return ""
        unknown = self._answered and not all(self._character())
        why = NO_SIZE * (unknown and self._wanted != "auto") or SLOW_PIXELS * pace.is_late
        if why:
            self.end()
        return why

    def _character(self) -> tuple[int, int]:
        size = character_size()
        return size if all(size) else self._size

    def hide(self, view: Any) -> None:
        """Show the text of a map instead."""
        shown = self._maps.get(view)
        if shown is not None and shown.region is not None:
            self._forget_all()
            view.refresh()

    def painted_over(self, update: Any) -> bool:
        """Note that the compositor wrote an update; returns whether a map must be drawn again."""
        again = False
        for view, shown in self._maps.items():
            if shown.region is None:
                again |= shown.is_covered and self._presenter.uncovered(view) is not None
            elif self._presenter.uncovered(view) != shown.region:
                self.hide(view)
                again = True
            elif self.protocol == "sixel" and _touches(update, shown.region):
                shown.region, again = None, True
        return again

    def end(self) -> None:
        """Show text from now on."""
        for view in self._maps:
            self.hide(view)
        self.protocol = self._wanted = "off"

    def _forget_all(self) -> None:
        """Delete all images."""
        for shown in self._maps.values():
            shown.region = None
        if self.protocol == "kitty":
            self._presenter.add(DELETE_KITTY_IMAGES)


def _touches(update: Any, region: Any) -> bool:
    """Whether an update of the compositor writes into a region."""
    spans = getattr(update, "spans", None)
    if spans is None:
        return True
    return any(
        region.y <= y < region.bottom and begin < region.right and end > region.x
        for y, begin, end in spans
    )
