"""Why a robot waits: the chain of causes with their rules, and its lost time.

Causes that count as blocked have their own pattern:

    head-on       ⣿⣿⣿⣿⣿⣿⡇      full bar: another robot is in the way (blocked)
    random wait   ⠶⠆           thin bar: the robot waits for something else
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

import numpy as np

from automaton.engine.observation import (
    CAUSE_NO_ORDER,
    CAUSE_NOT_WAITING,
    CAUSES,
    Cause,
    is_waiting,
    waited_ticks,
)
from automaton.engine.state import NIL, Array
from automaton.history.explanation import Explanation, explain
from automaton.units import count, percent
from tui.playback.panel_view import View
from tui.widgets.panel import (
    Line,
    Link,
    Signs,
    Span,
    TextPanel,
    bar,
    dim,
    line,
    linked,
    robot_link,
    term,
    title,
    wrapped,
)

MAKING_WAY: Final = len(CAUSES)  # a kind of lost time without waiting
UNDONE: Final = "{robot} moves to where later moves lead it back from, or turns in vain"
LOST_KINDS: Final = (*CAUSES, Cause("making way", UNDONE, "", True))

SELECT: Final = "A click on a robot, or ), shows where its time went"
MAX_WAITING_LISTED: Final = 40  # listed robots to choose from
NAME_WIDTH: Final = 19  # columns for the name of a cause
PERCENT_WIDTH: Final = 6

SHOWN_IDLE: Final = 0.01  # share of time from which a robot is said to have been idle
FIRST_LINKS: Final = 12  # shown links at the start of a chain
LAST_LINKS: Final = 4


class Why(TextPanel):
    """The waits of the selected robot, and the robots that have waited longest."""

    def panel_lines(self, view: View, width: int) -> list[Line]:
        if view.robot == NIL:
            return longest_waits(view, width)
        found = explain(view.snapshot, view.floor_plan, view.robot)
        lines = [made for at in _told(len(found.chain)) for made in _step(view, found, at, width)]
        if found.cycle != NIL:
            circle = wrapped(linked(found.cycle_line, view.floor_plan, "fault"), width, indent=2)
            # First what a member of the cycle has to know.
            lines = [*lines, (), *circle] if found.cycle else [*circle, (), *lines]
        lines += [(), *self._lost(view, width)]
        others = np.delete(is_waiting(view.snapshot.robots.cause), view.robot).any()
        return [*lines, (), *longest_waits(view, width)] if others else lines

    def _lost(self, view: View, width: int) -> list[Line]:
        """The robot's lost time by cause, the greatest first."""
        measured, ticks = view.measured, max(1, view.snapshot.tick)
        undone, idle = 0, 0.0
        if view.robot < len(measured.active):  # else not yet measured
            undone = int(measured.making_way[view.robot])
            idle = 1 - float(measured.active[view.robot])
        lost = lost_kinds(view.snapshot.robots.lost[view.robot], undone)
        total = int(lost.sum())
        rest = f"idle for {percent(idle, 0)} of {count(ticks, 'tick')}"
        idle_line = wrapped(line(dim(rest)), width) if idle >= SHOWN_IDLE else []
        if not total:
            return [line(title(f"robot {view.robot} lost no time so far")), *idle_line]
        lost_share = percent(total / ticks, 0)
        head = f"robot {view.robot} lost {lost_share} of {count(ticks, 'tick')}"
        causes = np.argsort(-lost, kind="stable")[: np.count_nonzero(lost)].tolist()
        shares = [(cause, int(lost[cause]) / ticks) for cause in causes]
        lines = wrapped(line(title(head)), width)
        digits = len(f"{total:,}") + 1
        room = max(0, width - NAME_WIDTH - digits - PERCENT_WIDTH)
        for cause, share in shares:
            link = ("cause", cause)
            name = term(LOST_KINDS[cause].name, link, NAME_WIDTH)
            figures = f"{int(lost[cause]):>{digits},}{percent(share, 0):>{PERCENT_WIDTH}}"
            lines.append(line(*name, cause_bar(cause, share, room, self.signs), figures))
            lines += self.explanation(link, LOST_KINDS[cause].meaning, width)
        return [*lines, pattern_key(causes, self.signs), *idle_line]

    def follow(self, link: Link, column: int = 0) -> None:
        """Explain a clicked cause."""
        if link[0] == "cause":
            self.explain(link)
        else:
            super().follow(link, column)


def _told(links: int) -> list[int]:
    """Indices of the shown links of a chain; NIL replaces the middle of a long one."""
    if links <= FIRST_LINKS + LAST_LINKS + 1:
        return list(range(links))
    return [*range(FIRST_LINKS), NIL, *range(links - LAST_LINKS, links)]


def _step(view: View, found: Explanation, at: int, width: int) -> list[Line]:
    """One robot of the chain: duration, cause and rule of its wait."""
    if at == NIL:
        return [line(dim(f"... {len(found.chain) - FIRST_LINKS - LAST_LINKS:,} more robots ..."))]
    link = found.chain[at]
    in_circle = found.cycle != NIL and at >= found.cycle
    if not link.cause:  # the last robot does not wait
        words = linked(link.text if at else f"{link.text}: it does not wait", view.floor_plan)
        return wrapped(line(dim("but " if at else ""), *words), width, indent=2)
    mark = "because " if at else ""
    look = "fault" if in_circle else "warn"
    since, _, because = link.text.removeprefix(f"robot {link.robot}").partition(": ")
    waited = Span(since if link.cause in since else f"{since}: {link.cause}", look)
    return [
        *wrapped(line(dim(mark), robot_link(link.robot), waited), width, indent=2),
        *wrapped(linked(because, view.floor_plan), width, indent=2, first=2),
        *wrapped(
            line(dim(f"rule: {link.rule.removeprefix('rule of ')}")), width, indent=4, first=2
        ),
    ]


def longest_waits(view: View, width: int) -> list[Line]:
    """The robots that wait now, longest first."""
    fleet, now = view.snapshot.robots, view.snapshot.tick
    waiting = np.flatnonzero(is_waiting(fleet.cause))
    if not len(waiting):
        return [
            line(title("no robot waits now")),
            *wrapped(
                line(dim(SELECT + ("; p, that of all." if len(view.runs) == 1 else "."))), width
            ),
        ]
    ordered = waiting[np.argsort(fleet.since[waiting], kind="stable")].tolist()
    head = "wait, longest first" if len(ordered) > 1 else "waits"
    lines = [line(title(f"{count(len(ordered), 'robot')} {head}"))]
    for robot in ordered[:MAX_WAITING_LISTED]:
        ticks = int(waited_ticks(fleet.cause[robot], fleet.since[robot], now))
        look = "fault" if fleet.wait_cycle_ticks[robot] else "plain"
        cause = CAUSES[int(fleet.cause[robot])].name
        name = robot_link(robot)
        gap = " " * max(1, 11 - len(name.text))
        lines.append(line(name, gap, f"{ticks:>6,}  ", Span(cause, look)))
    return lines


# Lost time. Its kinds are the causes of waits, and MAKING_WAY.


def lost_kinds(lost: Array, making_way: int) -> Array:
    """(kinds,) lost ticks from those by cause; time without an order is not lost."""
    kinds: Array = np.append(lost, making_way)
    kinds[CAUSE_NOT_WAITING] = kinds[CAUSE_NO_ORDER] = 0
    return kinds


def look_of(cause: int) -> str:
    """The colour of a cause."""
    return "warn" if LOST_KINDS[cause].blocked else "plain"


def cause_bar(cause: int, share: float, width: int, signs: Signs) -> Span:
    """The bar of a cause."""
    return Span(bar(share, width, signs, thin=not LOST_KINDS[cause].blocked), look_of(cause))


def pattern_key(causes: Sequence[int], signs: Signs) -> Line:
    """The meanings of the patterns that occur."""
    kinds = {LOST_KINDS[cause].blocked for cause in causes}
    words = {True: f"{signs.full} another robot in the way", False: f"{signs.thin} other causes"}
    return line(dim("   ".join(text for blocked, text in words.items() if blocked in kinds)))
