"""Streets as arrows: the cheaper direction of each cell, for pictures.

    r = log2(weight of the move back / weight of the move), at most 3; a move back that is closed: 3

A cell shows the axis of larger r, from a factor of 1.25 on, in five steps.
"""

from __future__ import annotations

from functools import lru_cache
from typing import Any, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from automaton.floor.floor_plan import STORAGE, WEIGHT_UNIT, FloorPlan

# Signs by direction, Unicode and ASCII: a cheaper move, and one whose move back is closed.
WAY_SIGNS: Final = ("⇢⇣⇠⇡", "eswn")
ONE_WAY_SIGNS: Final = ("↠↡↞↟", "ESWN")
FACTORS: Final = (1.25, 2, 3, 5, 8)  # at which the steps of arrows begin
LEAST_MEAN: Final = 0.1  # log2: a smaller mean of several cells shows no direction
# Weights of waiting at which steps begin; those of the step NEAR_1 are like 1.
WAIT_BEGINS: Final = (0, 0.5, 0.8, *FACTORS)
NEAR_1: Final = 2


class Arrows(NamedTuple):
    """The streets of a floor of C cells."""

    pull: NDArray[np.float64]  # (C, 2) r along each axis, positive to the east and to the south
    one_way: NDArray[np.bool_]  # (C, 2) whether the move against the pull is closed


@lru_cache(maxsize=8)
def arrows_of(floor_plan: FloorPlan) -> Arrows:
    """The streets of a floor, one-way moves of its picture included; none in storage, through which
    no way leads."""
    exits = (floor_plan.exits.reshape(-1)[:, None] >> np.arange(4)) & 1 > 0
    moves = floor_plan.move_weights if len(floor_plan.move_weights) else WEIGHT_UNIT
    weights = np.where(exits, moves, np.inf)
    strength, one_way = np.zeros(weights.shape), np.zeros(weights.shape, np.bool_)
    for direction, offset in enumerate(floor_plan.offsets):
        back, out = np.roll(weights[:, direction ^ 2], -offset), exits[:, direction]
        ratio = np.divide(back, weights[:, direction], where=out, out=np.ones(len(back)))
        strength[:, direction] = np.log2(np.clip(ratio, 1, FACTORS[-1]))
        one_way[:, direction] = out & np.isinf(back)
    pull = strength[:, :2] - strength[:, 2:]
    pull[floor_plan.kind.reshape(-1) == STORAGE] = 0
    against = np.where(pull > 0, one_way[:, :2], (pull < 0) & one_way[:, 2:])
    return Arrows(pull, against)


class Directions(NamedTuple):
    """The arrows of cells, or of blocks of cells; all arrays of one shape."""

    direction: NDArray[Any]  # E, S, W or N
    step: NDArray[Any]  # index of FACTORS; -1: below the first
    strength: NDArray[np.float64]  # r
    one_way: NDArray[np.bool_]


def directions_of(pull: NDArray[Any], one_way: NDArray[Any], is_odd: NDArray[Any]) -> Directions:
    """The arrows of pulls, whose last axis is that of `Arrows`.

    `is_odd`: cells that show the vertical axis where both are equally strong.
    """
    x, y = np.moveaxis(np.abs(pull), -1, 0)
    axis = np.where(x == y, is_odd, y > x).astype(np.intp)
    along = np.where(axis, pull[..., 1], pull[..., 0])
    strength = np.abs(along) + 1e-9  # so that rounding hides no factor
    step = np.searchsorted(np.log2(FACTORS), strength, "right") - 1
    heads = np.where(axis, one_way[..., 1], one_way[..., 0]).astype(np.bool_)
    return Directions(np.where(along < 0, axis + 2, axis), step, strength, heads)


@lru_cache(maxsize=8)
def wait_steps(floor_plan: FloorPlan) -> NDArray[np.int64]:
    """(C,) the step of the weight of waiting in each cell; NEAR_1 also where robots do not drive."""
    steps = np.full(floor_plan.kind.size, NEAR_1)
    if len(floor_plan.wait_weights):
        weights = floor_plan.wait_weights / WEIGHT_UNIT
        is_driven = floor_plan.drivable.reshape(-1)
        steps[is_driven] = np.searchsorted(WAIT_BEGINS, weights[is_driven], "right") - 1
    return steps


def range_words(begins: tuple[float, ...], step: int) -> str:
    """The values of a step in words."""
    if step == len(begins) - 1:
        return f"{begins[step]:g} or more"
    return f"{begins[step]:g} to {begins[step + 1]:g}"
