"""The last steps of a search of streets: one-way, reasons, fewer streets."""

from __future__ import annotations

from typing import Any

from street_designs import design_of, planted, resolved_on, with_design

from automaton.studies.street_search.evolution import SearchQuestion
from automaton.studies.street_search.finishing import (
    LOSS_PAIRS,
    REASON_PAIRS,
    SELECT_RUNS_EACH,
    DesignContext,
    finished,
    most_runs,
)

CLOCKWISE = (
    ("row", 0, "west", 8),
    ("row", 2, "east", 8),
    ("column", 0, "south", 8),
    ("column", 5, "north", 8),
)

QUESTION = SearchQuestion("throughput", True, (None,), 7, 3000, "rows")


def test_streets_without_effect_are_closed_and_then_left_out_with_fresh_seeds_each_time() -> None:
    resolved = resolved_on("......\n.####.\n......")
    floor_plan = resolved.floor_plan
    steady = planted(lambda design: 0.0, noise=0.05)
    asked: list[tuple[int, set[int]]] = []

    def runs(designs: Any, seeds: Any, robots: Any = None) -> Any:
        asked.append((len(designs) * len(seeds), set(seeds)))
        return steady.runs(designs, seeds, robots)

    context = DesignContext(
        resolved,
        lambda design: with_design(resolved, design),
        runs,
        steady.metric,
        steady.is_higher_better,
        steady.fleets,
        seeds=QUESTION.seeds,
        workers=1,
    )
    design = design_of(floor_plan, *CLOCKWISE)
    last = finished(design, context, is_one_way=True)
    assert last.one_way is not None and last.one_way.is_kept and len(last.one_way.closings) == 4
    assert [one.street.is_one_way for one in last.reasons] == [True] * 4
    assert last.fewer.is_kept and len(last.fewer.removed) == 4
    assert not last.design.closed.any() and (last.design.moves == 100).all()

    tried, open_again, loss, reasons, fewer = (seeds for _, seeds in asked)
    assert tried < open_again == fewer and not (
        open_again & loss or open_again & reasons or loss & reasons
    )
    assert (len(fewer), len(loss), len(reasons)) == (SELECT_RUNS_EACH, LOSS_PAIRS, REASON_PAIRS)
    assert sum(number for number, _ in asked[1:]) <= most_runs(4, True)  # rows are reused


def test_without_one_way_no_move_is_closed() -> None:
    resolved = resolved_on("......\n.####.\n......")
    floor_plan = resolved.floor_plan
    compared = planted(lambda design: -0.05 * design.closed.any())
    context = DesignContext(
        resolved, lambda one: with_design(resolved, one), *compared, QUESTION.seeds, 1
    )
    last = finished(design_of(floor_plan, *CLOCKWISE), context, is_one_way=False)
    assert last.one_way is None and not last.design.closed.any()
