"""The first screen of every reproduction: 24 lines of 80 columns, with made-up figures of any size."""

from __future__ import annotations

import random
from collections import defaultdict
from collections.abc import Iterator

import pytest

from automaton.documents.text_output import document_lines, plain
from automaton.papers.claim_report import first_screen, premise_blocks
from automaton.papers.reproduction_study import (
    REPRODUCTIONS,
    Key,
    MadeTable,
    PublishedTable,
    Repetition,
    Reproduced,
    Reproduction,
    find,
)

LINES, COLUMNS = 24, 80


def metrics_of_claims(reproduction: Reproduction) -> dict[Key, set[str]]:
    """By the key of a case, the metrics that claims rest on."""
    used: dict[Key, set[str]] = defaultdict(set)
    dice = random.Random(1)

    def note(metric: str, *key: str | int) -> float:
        used[key].add(metric)
        return 1 + dice.random()  # none is another's: differences may be divided by

    for claim in reproduction.claims:
        for figure in claim.figures:
            figure.of(note)
    return used


def made_up(reproduction: Reproduction, size: float, seeds: int = 4) -> Reproduced:
    """A reproduction whose runs gave numbers of about this size, shares between 0 and 1."""
    dice = random.Random(1)
    used = metrics_of_claims(reproduction)

    def share() -> float:
        """Of a run, or of many runs, each of which is 0 or 1."""
        return dice.random() if size < 1 else float(dice.random() < 0.8)

    def repetitions(table: PublishedTable, key: Key) -> list[Repetition]:
        metrics = {*table.metrics, *used[key], *used[key[:-1]]}
        return [
            Repetition(
                {
                    name: share() if name in table.shares else size * (1 + dice.random())
                    for name in sorted(metrics)
                }
            )
            for _ in range(seeds * table.per_seed)
        ]

    tables = []
    for table in reproduction.tables:
        cases = table.cases(reproduction.strategies)
        tables.append(MadeTable(table, cases, [repetitions(table, case.key) for case in cases]))
    return Reproduced(reproduction, seeds, tables, settings=("durations.turn=10",))


def screen(reproduced: Reproduced) -> list[str]:
    """The lines of the first screen on a narrow terminal."""
    document = first_screen(reproduced, reproduced.judged())
    return [plain(line) for line in document_lines(document.blocks, COLUMNS, is_styled=True)]


@pytest.mark.parametrize("size", [0.3, 20_000.0])
@pytest.mark.parametrize("name", REPRODUCTIONS)
def test_a_reproduction_begins_with_one_screen(name: str, size: float) -> None:
    reproduced = made_up(find(name), size)
    lines = screen(reproduced)
    assert len(lines) < LINES, "the prompt has a line, too"
    assert max(map(len, lines)) <= COLUMNS
    text = "\n".join(lines)
    assert "…" not in text
    for headline in reproduced.reproduction.headlines:
        assert headline.label in text, headline.label
    assert "NOT THE PUBLISHED EXPERIMENT: made with --set durations.turn=10" in text
    assert text.endswith(f"automaton reproduce {name} --tables")
    head = next(line for line in lines if line.startswith("figure"))
    assert head.split()[1] == "printed" and head.split()[-1] == "verdict"


def headlines() -> Iterator[tuple[str, str, int]]:
    for name in REPRODUCTIONS:
        for headline in find(name).headlines:
            if headline.claim:
                yield name, headline.claim, headline.figure


def test_headlines_name_claims() -> None:
    for name, words, figure in headlines():
        claims = [one for one in find(name).claims if one.text.startswith(words)]
        assert claims, (name, words)
        assert len(claims[0].figures) > figure


def test_both_premises_stand_beside_each_other() -> None:
    reproduced = made_up(find("tabletop"), 100.0)
    lines = screen(reproduced)
    head = next(line for line in lines if line.startswith("figure"))
    assert head.split() == ["figure", "printed", "orders", "everything", "verdict"]
    error = next(line for line in lines if line.startswith("mean |error| of T_total"))
    own, other = (
        reproduced.mean_errors(premise)["T_total"] for premise in ("", "information: everything")
    )
    assert own is not None and other is not None and own != other
    assert error.split()[-4:] == [f"{100 * own:,.1f}", "%", f"{100 * other:,.1f}", "%"]


def test_claims_that_turn_by_another_premise_are_named() -> None:
    reproduced = made_up(find("tabletop"), 100.0)
    premise = "information: everything"
    own = {one.claim.text: one.verdict for one in reproduced.judged()}
    turned = [one for one in reproduced.judged(premise) if own[one.claim.text] != one.verdict]
    _, listed = premise_blocks(reproduced, reproduced.judged(), premise)
    text = " ".join(listed.items)
    assert turned and all(f"{one.verdict}: " in text for one in turned)
