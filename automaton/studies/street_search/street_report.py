"""Streets in words and as a picture: the reasons for a design, what is one-way, and the drawn floor.

⇢⇢⇢⇢⇢↠    dashed: the move back costs more; two heads: it is closed
⇡####⇣    ASCII: e s w n, and E S W N
⇡⇠⇠⇠⇠⇠
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any, Final

import numpy as np

from automaton.documents.report_document import (
    Block,
    CharacterPicture,
    Heading,
    Listed,
    Table,
    Text,
)
from automaton.drawings.street_arrows import ONE_WAY_SIGNS, WAY_SIGNS, arrows_of, directions_of
from automaton.floor.floor_plan import FloorPlan
from automaton.studies.street_search.designs import StreetDesign
from automaton.studies.street_search.finishing import FinishedDesign
from automaton.studies.street_search.one_way import OneWay, with_closed
from automaton.studies.street_search.reasons import (
    MOST_CHANGE,
    FewerStreets,
    GroupChange,
    Reason,
    change_text,
    share_of,
    sum_of_largest,
)

in_percent: Final = change_text  # the words of a gain are those of a reason
NO_DIRECTION: Final = ("·", ".")
OBSTACLE: Final = "#"
MOST_LISTED: Final = 40  # streets without effect
CHANGES_NOTHING: Final = "changes nothing"
LARGEST_FLOOR: Final = (120, 80)  # columns and rows of a floor that is drawn


def drawn_streets(design: StreetDesign, floor_plan: FloorPlan, ascii_only: bool) -> list[str]:
    """The rows of a floor: an arrow in each cell along the axis with the stronger preference."""
    shown = arrows_of(
        with_closed(floor_plan, design.closed).with_weights(design.moves, design.waits)
    )
    odd = np.indices(floor_plan.kind.shape).sum(axis=0).reshape(-1) % 2 == 1
    cells = directions_of(shown.pull, shown.one_way, odd)
    drivable = floor_plan.drivable.reshape(-1)
    kind = 1 if ascii_only else 0
    signs = np.full(drivable.size, OBSTACLE)
    signs[drivable] = NO_DIRECTION[kind]
    for direction, (way, one_way) in enumerate(
        zip(WAY_SIGNS[kind], ONE_WAY_SIGNS[kind], strict=True)
    ):
        here = drivable & (cells.step >= 0) & (cells.direction == direction)
        signs[here] = np.where(cells.one_way[here], one_way, way)
    inner = signs.reshape(floor_plan.kind.shape)[1:-1, 1:-1]
    return ["".join(row) for row in inner.tolist()]


def blocks_of(
    last: FinishedDesign,
    floor_plan: FloorPlan,
    metric: str,
    total: float | None,
    ascii_only: bool,
) -> Iterator[Block]:
    """The drawn streets, what was closed and left out, and what each street is worth.

    `total`: what all streets together gain, in shares.
    """
    yield Heading("Streets")
    changes = [] if last.one_way is None else [one_way_words(last.one_way)]
    yield Listed([*changes, fewer_words(last.fewer)], mark="")
    if floor_plan.width <= LARGEST_FLOOR[0] and floor_plan.height <= LARGEST_FLOOR[1]:
        kind = 1 if ascii_only else 0
        soft, closed = (" ".join(signs[kind]) for signs in (WAY_SIGNS, ONE_WAY_SIGNS))
        yield Text(f"{soft}: the move back costs more; {closed}: it is closed.")
        rows = drawn_streets(last.design, floor_plan, ascii_only)
        yield CharacterPicture([[(row, "")] for row in rows])
    yield Heading("Reasons")
    before = (
        " They are those of the design before streets were left out." if last.fewer.is_kept else ""
    )
    yield Text(how_compared(last.reasons) + before)
    yield reasons_in_words(last.reasons, floor_plan, metric, total)
    yield reasons_table(last.reasons, floor_plan, metric)
    if len(last.reasons) > MOST_LISTED:
        yield Text("Streets that were screened only are not listed; --json has all.")


def how_compared(ranked: Sequence[Reason]) -> str:
    """How streets were compared, and for what the intervals hold."""
    screened = [one.worth.difference.n for one in ranked if not one.is_confirmed and one.worth]
    confirmed = sum(one.is_confirmed for one in ranked)
    text = (
        "Each street is compared in pairs of runs with the design where both of its directions cost the "
        "same and are open."
    )
    if screened:
        text += (
            f" All were screened in {max(screened):,} pairs; the {confirmed:,} with the clearest effects "
            "have further pairs with fresh seeds, from which alone their effects come."
        )
    return f"{text} Intervals hold for all listed streets together (95 %, Bonferroni)."


def reason_record(reason: Reason, floor_plan: FloorPlan) -> dict[str, Any]:
    """A reason for JSON output; changes in shares."""
    worth = None
    if reason.worth is not None:
        worth = interval_record(share_of(reason.worth))
    groups = {"saves": reason.saves, "costs": reason.costs}
    return {
        "street": reason.street.name(floor_plan),
        "cheaper": reason.street.preference,
        "worth": worth,
        "has_effect": reason.has_effect,
        "is_confirmed": reason.is_confirmed,
        **{
            key: one and {"orders": one.name, "lead_time": interval_record(one.change)}
            for key, one in groups.items()
        },
    }


def interval_record(change: Any) -> dict[str, float | None]:
    """A change with its interval."""
    return {"value": change.value, "low": change.low, "high": change.high}


# Reasons.


def sentence(reason: Reason, floor_plan: FloorPlan) -> str:
    """Such as "row 12, west 2.1 times as cheap: +2.0 % (+1.6 to +2.4); costs orders from ..."."""
    street = reason.street
    parts = [f"{street.name(floor_plan)}, {street.preference}: {worth_words(reason)}"]
    if reason.costs is not None:
        parts.append(f"costs orders {group_words(reason.costs)}")
    if reason.saves is not None:
        parts.append(f"saves orders {group_words(reason.saves)}")
    return "; ".join(parts)


def worth_words(reason: Reason) -> str:
    """What a street is worth, and whether that is significant."""
    if reason.worth is None:
        return "too few runs finished"
    if reason.changes_nothing:
        return CHANGES_NOTHING
    if reason.has_effect:
        return change_text(reason.worth)
    return f"{change_text(reason.worth)}, not significant"


def group_words(group: GroupChange) -> str:
    """Such as "from station 3 to station 7 +6.0 % lead time (+4.1 to +7.9)"."""
    change, interval = change_text(group.change).split(" (")
    return f"{group.name} {change} lead time ({interval}"


def reasons_table(ranked: Sequence[Reason], floor_plan: FloorPlan, metric: str) -> Table:
    """The streets with the largest effects, the largest gain first, with what each is worth."""
    rows = [
        [one.street.name(floor_plan), one.street.preference, worth_words(one)]
        for one in ranked
        if one.is_confirmed
    ]
    return Table(("street", "cheaper", metric), rows, left=2, also_left=(2,))


def reasons_in_words(
    ranked: Sequence[Reason], floor_plan: FloorPlan, metric: str, total: float | None
) -> Listed:
    """The sentences of streets with an effect, and how they add up; `total`: what all gain."""
    items = [sentence(one, floor_plan) for one in ranked if one.has_effect]
    nothing = [one.street.name(floor_plan) for one in ranked if one.changes_nothing]
    if nothing:
        more = f"; and {len(nothing) - MOST_LISTED:,} more" if len(nothing) > MOST_LISTED else ""
        items.append(f"without effect in any run: {'; '.join(nothing[:MOST_LISTED])}{more}")
    return Listed([*items, *summary(ranked, metric, total)])


def summary(ranked: Sequence[Reason], metric: str, total: float | None) -> Iterator[str]:
    """How many streets have an effect, and their sum beside the gain of the design."""
    number = sum(one.has_effect for one in ranked)
    yield f"{number:,} of {len(ranked):,} streets have a significant effect on {metric}"
    if screened := [one for one in ranked if not one.is_confirmed]:
        clear = sum(one.certainty > 0 for one in screened)
        text = f"streets with less clear effects that were screened only: {len(screened):,}"
        yield f"{text}, of which the intervals of {clear:,} exclude 0"
    if total is not None and ranked:
        largest = min(10, sum(one.is_confirmed for one in ranked))
        text = f"the {largest} largest gains add up to {100 * sum_of_largest(ranked):+.1f} %"
        yield f"{text}; all streets together gain {100 * total:+.1f} %"


def one_way_words(result: OneWay) -> str:
    """What was closed, and what it costs."""
    left = f"two-way: {len(result.two_way):,} that robots need both ways"
    left = f"{left}, {len(result.reopened):,} that do better so"
    if result.change is None:
        if not result.two_way and not result.reopened:
            return "no street is one-way: no move costs 4 times as much as the move back"
        return f"no street is one-way; {left}"
    change = f"{change_text(result.change)} against weights alone"
    text = f"one-way streets: {len(result.closings):,}, {change}"
    if not result.is_kept:
        return f"weights alone stay, because one-way streets may cost 1 % or more; {text}"
    return f"{text}; {left}"


def fewer_words(result: FewerStreets) -> str:
    """Which streets were left out, and what that changes."""
    if not result.removed:
        return "no street is left out"
    change = "" if result.change is None else f" ({change_text(result.change)})"
    if result.is_kept:
        lost = "not known" if result.change is None else change_text(result.change)
        return (
            f"streets left out, none of which has a significant effect alone: {len(result.removed):,}; "
            f"without all of them {lost}, where a loss of {100 * MOST_CHANGE:g} % is allowed"
        )
    return (
        f"streets without an effect alone: {len(result.removed):,}; they stay, because together they "
        f"have one{change}"
    )
