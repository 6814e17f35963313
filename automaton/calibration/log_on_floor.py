"""Messages of robots on the floor of a scenario: the cell of each, or the edge that it is on.

    x, y in the log  --units.origin, units.rotation-->  metres from the lower left corner  -->  cells

Positions of more than MAX_OFF_FLOOR off the floor mean another unit, origin or rotation: such a log is
refused with the one that fits. The fit is that of the cells that robots visit on the drivable cells:
the highest correlation over all shifts, computed by a Fourier transform.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from typing import Any, Final, NamedTuple

import numpy as np

from automaton.calibration.state_log import Samples, StateLog
from automaton.errors import InputError
from automaton.floor.floor_plan import DIRECTION_VECTORS, EAST, NIL, NORTH, SOUTH, WEST, FloorPlan
from automaton.scenario.schema import Units
from automaton.units import LENGTH_UNITS, percent

Array = np.ndarray[Any, Any]

MAX_OFF_FLOOR: Final = 0.02  # share of the positions
MAX_THETA: Final = math.tau + 0.01  # radians
SNAP_M: Final = 0.05  # metres from a centre within which a robot stands in the cell
MAX_STEP: Final = 1.5  # cells to a message before or after that shows where a robot drives
MAX_FITTED: Final = 50_000  # positions that a fit looks at
NEAR_BEST: Final = 0.002  # share below the best fit at which a simpler one is preferred
NEAR_CENTRE: Final = 0.15  # cells
MIN_CELLS: Final = 20  # that robots visit, if another unit fits
SAME_FIT: Final = 1e-6  # difference of shares that counts as none
FAR_M: Final = 1e9  # beyond every site
QUARTER: Final = math.pi / 2
CELLS_AHEAD: Final = 4  # in which another robot obstructs
LATERAL: Final = 0.15  # cells; a straight pair does not move farther aside
STILL: Final = 0.15  # cells; noise of positions moves a standing robot less far
UNIT_NAMES: Final = {"mm": "millimetres", "cm": "centimetres", "ft": "feet", "in": "inches"}


@dataclass(frozen=True)
class RobotTracks:
    """A log on its floor, a row for each message: the form that observed runs, fits and comparisons read.

    The robot of a message is in `cell`, or on the way to `to_cell`. Distances are in cells.
    """

    log: StateLog
    cell: Array  # (n,) int64 flat cell; NIL: not on the floor, or not known
    to_cell: Array  # (n,) int64 flat cell that it drives to; NIL at a centre
    share: Array  # (n,) float64 completed share of the way there, 0 to 1
    heading: Array  # (n,) int8 0 to 3, clockwise from east on the screen; NIL: not known
    off_floor: int  # positions off the floor
    stride: int  # of the floor

    def part(self, rows: Array) -> RobotTracks:
        """Some of the messages; `rows`: sorted."""
        cell, to_cell, share, heading = (
            one[rows] for one in (self.cell, self.to_cell, self.share, self.heading)
        )
        log = self.log.part(rows)
        return RobotTracks(log, cell, to_cell, share, heading, self.off_floor, self.stride)

    @cached_property
    def seconds(self) -> Array:
        """(n,) float64 since 1970."""
        out: Array = self.log.samples.time / 1000
        return out

    @cached_property
    def elapsed(self) -> Array:
        """(n,) seconds to the next message."""
        return np.append(np.diff(self.seconds), 0.0)

    @cached_property
    def place(self) -> Array:
        """(2, n) float64: columns and rows from the first cell; nan: not on the floor."""
        at, to = (
            np.stack(np.divmod(one, self.stride)[::-1])
            for one in (self.cell, np.where(self.to_cell == NIL, self.cell, self.to_cell))
        )
        out: Array = np.where(self.on_floor, at - 1 + self.share * (to - at), np.nan)
        return out

    @cached_property
    def on_floor(self) -> Array:
        """(n,) bool."""
        out: Array = self.cell != NIL
        return out

    @cached_property
    def step(self) -> Array:
        """(2, n) cells to the place of the next message."""
        return np.diff(self.place, append=self.place[:, -1:])

    @cached_property
    def loaded(self) -> Array:
        """(n,) bool."""
        out: Array = self.log.samples.load > 0
        return out

    @cached_property
    def acts(self) -> Array:
        """(n,) bool: an operation, a charger or an error keeps the robot."""
        samples = self.log.samples
        out: Array = (samples.action > 0) | (samples.charging == 1) | samples.down
        return out

    @cached_property
    def driving(self) -> Array:
        """(n,) bool; a robot whose log has no state drives if it moves before or after."""
        says = self.log.samples.driving
        moves = (np.hypot(*np.nan_to_num(self.step)) > STILL) & self.log.usable
        out: Array = np.where(says < 0, moves | np.append(False, moves)[:-1], says > 0)
        return out

    @cached_property
    def usable(self) -> Array:
        """(n,) bool: of this message and the next."""
        out: Array = self.log.usable & self.on_floor & np.append(self.on_floor[1:], False)
        return out

    @cached_property
    def gap(self) -> float:
        """The median time between two messages of a robot; nan without pairs."""
        gaps = self.elapsed[self.usable]
        return float(np.median(gaps)) if len(gaps) else math.nan

    @cached_property
    def near(self) -> Array:
        """(n,) bool: another robot is in one of the cells ahead, or beside these, at about this time.

        Ahead is where a robot drives to until its next message; the heading decides if it stands.
        """
        if math.isnan(self.gap):
            return np.zeros(len(self.cell), np.bool_)
        bins = np.round((self.seconds - self.seconds.min()) / self.gap).astype(np.int64)
        x, y = np.round(np.nan_to_num(self.place, nan=-64.0)).astype(np.int64) + 64
        width, height = int(x.max()) + 64, int(y.max()) + 64
        # The lowest and the highest number of the robots in each cell and bin: one of them is another.
        place = (bins * width + x) * height + y
        order = np.argsort(place, kind="stable")
        occupied, first = np.unique(place[order], return_index=True)
        robot = self.log.samples.robot
        low, high = (ends.reduceat(robot[order], first) for ends in (np.minimum, np.maximum))
        across, down = np.where(self.usable, np.nan_to_num(self.step), 0)
        along_x = abs(across) >= abs(down)
        travel = np.where(
            along_x, np.where(across > 0, EAST, WEST), np.where(down > 0, SOUTH, NORTH)
        )
        way = np.where(np.maximum(abs(across), abs(down)) > STILL, travel, self.heading)
        dx, dy = np.array(DIRECTION_VECTORS, np.int64).T[:, way]
        out = np.zeros(len(self.cell), np.bool_)
        for ahead in range(1, CELLS_AHEAD + 1):
            for aside in (-1, 0, 1):
                cells_x, cells_y = x + ahead * dx - aside * dy, y + ahead * dy + aside * dx
                key = (bins * width + cells_x) * height + cells_y
                at = np.searchsorted(occupied[:-1], key)
                out |= (occupied[at] == key) & ((low[at] != robot) | (high[at] != robot))
        return out

    @cached_property
    def free(self) -> Array:
        """(n,) bool: nothing but a straight drive lies between this message and the next, in motion at
        both, without a robot ahead."""
        with np.errstate(invalid="ignore"):
            in_line = abs(self.step).min(axis=0) < LATERAL
        out: Array = self.usable & (self.elapsed > 0) & in_line
        for one in (self.heading, self.loaded):
            out &= np.append(one[:-1] == one[1:], False)
        moves = self.driving & ~self.near & ~self.acts
        out &= moves & np.append(moves[1:], False)
        return out


def placed(log: StateLog, floor_plan: FloorPlan, units: Units, snap: float = SNAP_M) -> RobotTracks:
    """The place of each message; `snap`: distance from a centre, in metres, that counts as none.

    Raises InputError if too many positions are off the floor, or if a cell has no size.
    """
    samples = log.samples
    metres = float(units.scale.cell_metres)
    x, y = (np.clip(one, -FAR_M, FAR_M) for one in (samples.x, samples.y))
    column, row = _in_cells(*_local(x, y, units), metres, floor_plan)
    known = np.isfinite(column) & np.isfinite(row)
    near_column, near_row = (np.rint(np.where(known, at, NIL)) for at in (column, row))
    inside = known & (near_column >= 0) & (near_column < floor_plan.stride)
    inside &= (near_row >= 0) & (near_row < floor_plan.height + 2)
    cell = np.where(inside, near_row * floor_plan.stride + near_column, 0).astype(np.int64)
    on_floor = inside & standable(floor_plan)[cell]
    if not known.any():
        raise InputError("has no position of any robot")
    off_floor = int(known.sum() - on_floor.sum())
    if off_floor > MAX_OFF_FLOOR * known.sum():
        fit = _nearest_fit(samples, floor_plan, metres)
        off = percent(off_floor / int(known.sum()))
        raise InputError(f"{off} of the positions are not on the floor; {fit}")
    is_beyond = abs(np.nan_to_num(samples.theta)) > MAX_THETA
    if is_beyond.sum() > MAX_OFF_FLOOR * np.isfinite(samples.theta).sum():
        theta = float(np.nanmax(abs(samples.theta)))
        raise InputError(f"has theta up to {theta:,.4g}; theta is in radians, so convert degrees")
    cell = np.where(on_floor, cell, NIL)
    heading = _headings(samples.theta - math.radians(units.rotation))
    offset = column - near_column, row - near_row
    way, share = _edges(cell, offset, snap / metres, floor_plan)
    to_cell = np.where(way == NIL, NIL, cell + np.array(floor_plan.offsets)[way])
    back = (way != NIL) & (_drives_along(way, heading, (column, row), log.usable) < 0)
    return RobotTracks(
        log,
        np.where(back, to_cell, cell),
        np.where(back, cell, to_cell),
        np.where(back, 1 - share, share),
        heading,
        off_floor,
        floor_plan.stride,
    )


def standable(floor_plan: FloorPlan) -> Array:
    """(cells,) bool: where robots stand, parking bays included."""
    mask = floor_plan.drivable.ravel().copy()
    mask[floor_plan.bays[:, 0]] = True
    return mask


def _local(x: Array, y: Array, units: Units) -> tuple[Array, Array]:
    """Positions in the log's frame as metres from the lower left corner of the floor."""
    angle = math.radians(units.rotation)
    x, y = x - units.origin[0], y - units.origin[1]
    return math.cos(angle) * x + math.sin(angle) * y, math.cos(angle) * y - math.sin(angle) * x


def _in_cells(x: Array, y: Array, metres: float, floor_plan: FloorPlan) -> tuple[Array, Array]:
    """Column and row of positions, border included; whole numbers are centres."""
    return x / metres + 0.5, floor_plan.height + 0.5 - y / metres


def _headings(theta: Array) -> Array:
    """(n,) int8 the nearest of the four headings, or NIL."""
    known = np.isfinite(theta)
    quarters = np.rint(-np.remainder(np.where(known, theta, 0), math.tau) / QUARTER)
    return np.where(known, quarters.astype(np.int64) & 3, NIL).astype(np.int8)


def _edges(
    cell: Array, offset: tuple[Array, Array], snap: float, floor_plan: FloorPlan
) -> tuple[Array, Array]:
    """(n,) direction from the nearest cell to the other end of the edge, or NIL at a centre, and the
    share of the way."""
    east, south = offset
    is_along_x = np.abs(east) >= np.abs(south)
    away = np.where(is_along_x, east, south)
    way = np.where(is_along_x, np.where(away > 0, 0, 2), np.where(away > 0, 1, 3))
    at = np.where(cell == NIL, 0, cell)
    other = np.clip(at + np.array(floor_plan.offsets)[way], 0, floor_plan.kind.size - 1)
    exits, mask = floor_plan.exits.ravel().astype(np.int64), standable(floor_plan)
    is_open = (exits[at] >> way | exits[other] >> (way ^ 2)) & 1 > 0
    is_open |= (
        ~floor_plan.drivable.ravel()[at] | ~floor_plan.drivable.ravel()[other]
    )  # parking bays
    is_edge = (cell != NIL) & (np.abs(away) > snap) & mask[other] & is_open
    return np.where(is_edge, way, NIL), np.where(is_edge, np.abs(away), 0.0)


def _drives_along(way: Array, heading: Array, place: tuple[Array, Array], usable: Array) -> Array:
    """(n,) above 0: the robot drives in the direction of the edge, below: against it; 0: not known.

    Its next message shows it if it is not far off, else the last one, else its heading.
    """
    step = np.array(DIRECTION_VECTORS)[way]
    column, row = (np.diff(at, append=at[-1:]) for at in place)
    near = usable & (np.hypot(column, row) < MAX_STEP)
    after = np.where(near, column * step[:, 0] + row * step[:, 1], 0)
    column, row, near = (np.roll(one, 1) for one in (column, row, near))
    before = np.where(near, column * step[:, 0] + row * step[:, 1], 0)
    faces = np.where(heading == way, 1, np.where((heading ^ 2) == way, -1, 0))
    out: Array = np.select([after != 0, before != 0], [after, before], faces)
    return out


# The fit that would put a refused log on the floor.


class FloorFit(NamedTuple):
    """A change of positions that puts them on the floor."""

    share: float  # of the positions on the floor
    unit: str
    rotation: int  # degrees
    is_mirrored: bool
    origin: tuple[float, float]
    cells: int = 0  # visited ones

    def __str__(self) -> str:
        parts = []
        if self.unit != "m":
            parts.append(f"they are {UNIT_NAMES[self.unit]}")
        if self.is_mirrored:
            parts.append("their y grows downwards")
        if any(self.origin):
            parts.append("units.origin is [{:g}, {:g}]".format(*self.origin))
        if self.rotation:
            parts.append(f"units.rotation is {self.rotation}")
        return f"they fit if {' and '.join(parts)}"


def _nearest_fit(samples: Samples, floor_plan: FloorPlan, metres: float) -> str:
    """What puts the positions on the floor, as a phrase."""
    near = (np.abs(samples.x) < FAR_M) & (np.abs(samples.y) < FAR_M)  # False: not known, too
    known = np.flatnonzero(near)
    if not len(known):
        return "none is a place"
    some = known[:: max(1, len(known) // MAX_FITTED)]
    # Too small a unit puts all robots in a few cells, wherever they were.
    least = min(MIN_CELLS, int(floor_plan.drivable.sum()) // 4)
    fits = [
        fit
        for is_mirrored in (False, True)
        for unit in ("m", *UNIT_NAMES)
        for rotation in (0, 90, 180, 270)
        for fit in _shifts(
            samples.x[some],
            samples.y[some],
            floor_plan,
            metres,
            FloorFit(0, unit, rotation, is_mirrored, (0, 0)),
        )
        if fit.share >= 1 - MAX_OFF_FLOOR and (fit.unit == "m" or fit.cells >= least)
    ]
    if not fits:
        return "no unit, origin and quarter turn fits them"
    share = max(fit.share for fit in fits) - NEAR_BEST
    cells = max(fit.cells for fit in fits) / 2
    good = (fit for fit in fits if fit.share >= share and fit.cells >= cells)
    return str(min(good, key=_complexity))


def _complexity(fit: FloorFit) -> tuple[bool, bool, bool, int]:
    return fit.is_mirrored, fit.unit != "m", any(fit.origin), fit.rotation


def _shifts(
    x: Array, y: Array, floor_plan: FloorPlan, metres: float, turned: FloorFit
) -> Iterator[FloorFit]:
    """Yield the fit without an origin, and the best one with an origin, of a unit and a rotation."""
    size = float(LENGTH_UNITS[turned.unit])
    angle = math.radians(turned.rotation)
    y = -y if turned.is_mirrored else y
    right = size * (math.cos(angle) * x + math.sin(angle) * y)
    up = size * (math.cos(angle) * y - math.sin(angle) * x)
    column, row = _in_cells(right, up, metres, floor_plan)
    mask = standable(floor_plan).reshape(floor_plan.kind.shape)
    height, width = floor_plan.kind.shape
    low_row, low_column = np.rint(row.min()), np.rint(column.min())
    if np.rint(row.max()) - low_row >= height or np.rint(column.max()) - low_column >= width:
        return
    near_row, near_column = np.rint(row).astype(np.int64), np.rint(column).astype(np.int64)
    inside = (near_row >= 0) & (near_row < height) & (near_column >= 0) & (near_column < width)
    on_floor = inside & mask[np.where(inside, near_row, 0), np.where(inside, near_column, 0)]
    cells = len(np.unique(near_row * width + near_column))
    turned = turned._replace(cells=cells)
    yield turned._replace(share=float(on_floor.mean()))
    low_row, low_column = low_row + _phase(row), low_column + _phase(column)
    shape = 2 * height, 2 * width
    visits = np.zeros(shape)
    at = np.rint(row - low_row).astype(np.int64), np.rint(column - low_column).astype(np.int64)
    np.add.at(visits, at, 1 / len(x))
    matches = np.fft.irfft2(np.conj(np.fft.rfft2(visits)) * np.fft.rfft2(mask, shape), shape)
    best = np.argwhere(matches >= matches.max() - SAME_FIT)
    shifts = (best + np.array([height, width])) % np.array(shape) - np.array([height, width])
    local = np.stack((low_column - shifts[:, 1], shifts[:, 0] - low_row), axis=1) * metres
    east, north = local[np.abs(local).sum(axis=1).argmin()].tolist()
    origin = (
        round(math.cos(angle) * east - math.sin(angle) * north, 3),
        round(math.sin(angle) * east + math.cos(angle) * north, 3),
    )
    yield turned._replace(share=float(matches.max()), origin=origin)


def _phase(places: Array) -> float:
    """The usual offset of positions from whole numbers: that of robots that stand in a cell."""
    mean = float(np.angle(np.exp(2j * math.pi * places).mean()) / (2 * math.pi))
    off = places - mean - np.rint(places - mean)
    near = off[np.abs(off) < NEAR_CENTRE]
    return mean + float(np.median(near)) if len(near) else mean
