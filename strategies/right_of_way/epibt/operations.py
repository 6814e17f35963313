"""Operations: what a robot may do in its next D ticks, as sequences of D actions.

    F go forward    R turn right    L turn left    W wait

Two sequences are of one class if the robot stands in the same cell after each action and ends with the
same heading: they meet the same robots. A plan is a class. In the next tick its first action has been
done and a wait follows its last one, which is a class, too, so what robots have planned stays free of
conflicts. New plans are chosen from the candidates: the classes that do not end in a turn,
the full wait left out. Yukhnevich & Andreychuk, AAAI-26.

    D            3    4    5
    classes     31   88  249
    candidates  16   47  135
"""

from __future__ import annotations

from functools import cache
from itertools import product
from typing import Final, NamedTuple

FORWARD: Final = 0
RIGHT: Final = 1
LEFT: Final = 2
WAIT: Final = 3
LETTERS: Final = "FRLW"
FULL_WAIT: Final = 0  # its class

# Of two operations with equal costs the one of larger weight is tried first: a sum over its actions, each
# times the number of ticks that are left.
WEIGHTS: Final = (10, -2, -2, -3)
VECTORS: Final = ((1, 0), (0, 1), (-1, 0), (0, -1))  # of the headings east, south, west, north

Actions = tuple[int, ...]
Trace = tuple[tuple[tuple[int, int], ...], int]


class Operations(NamedTuple):
    """The classes of one depth, by ascending weight; the full wait is the first."""

    actions: tuple[Actions, ...]  # one sequence of each class
    following: tuple[int, ...]  # the class that is left of each after a tick
    candidates: tuple[int, ...]  # the classes from which plans are chosen

    @property
    def texts(self) -> list[str]:
        """The sequences in letters."""
        return ["".join(LETTERS[action] for action in actions) for actions in self.actions]


def trace(actions: Actions) -> Trace:
    """Return the cells after each action, from (0, 0) with the heading east, and the last heading."""
    x = y = heading = 0
    cells = []
    for action in actions:
        if action == FORWARD:
            x, y = x + VECTORS[heading][0], y + VECTORS[heading][1]
        elif action != WAIT:
            heading = heading + (1 if action == RIGHT else 3) & 3
        cells.append((x, y))
    return tuple(cells), heading


def weight(actions: Actions) -> int:
    """Return how early an operation goes forward, and how late it waits."""
    ticks_left = range(len(actions), 0, -1)
    return sum(WEIGHTS[action] * left for action, left in zip(actions, ticks_left, strict=True))


def ends_in_turn(actions: Actions) -> bool:
    """Return whether the last heading is not that of the last move, or of the start if none moves."""
    heading = moved = 0
    for action in actions:
        if action == FORWARD:
            moved = heading
        elif action != WAIT:
            heading = heading + (1 if action == RIGHT else 3) & 3
    return heading != moved


@cache
def operations_of(depth: int) -> Operations:
    """Return the operations of so many actions."""
    wait = (WAIT,) * depth
    others = (actions for actions in product(range(4), repeat=depth) if actions != wait)
    classes: dict[Trace, int] = {}
    sequences: list[Actions] = []
    for actions in (wait, *sorted(others, key=weight)):
        if trace(actions) not in classes:
            classes[trace(actions)] = len(sequences)
            sequences.append(actions)
    return Operations(
        tuple(sequences),
        tuple(classes[trace((*actions[1:], WAIT))] for actions in sequences),
        tuple(
            number
            for number, actions in enumerate(sequences)
            if number != FULL_WAIT and not ends_in_turn(actions)
        ),
    )
