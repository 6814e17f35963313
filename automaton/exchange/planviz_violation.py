"""A rule that an output breaks: in which tick, and which robots."""

from __future__ import annotations

from typing import NamedTuple


class Violation(NamedTuple):
    """The first place where an output breaks a rule."""

    tick: int
    robots: tuple[int, ...]
    rule: str  # start, wall, collision, swap, visit, task, release or count
    text: str

    def __str__(self) -> str:
        name = "robot" if len(self.robots) == 1 else "robots"
        robots = f"{name} {' and '.join(map(str, self.robots))} " if self.robots else ""
        return f"tick {self.tick:,}: {robots}{self.text}"
