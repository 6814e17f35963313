"""The measures of Tables 1 to 4 on cases small enough to count."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis.extra.numpy import arrays

from automaton.papers.training_report import PRINTED_TABLES, monitored
from automaton.papers.training_settings import (
    MEASURES,
    AnswerCounts,
    counts,
    first_bias,
    mcc,
    measured,
    sample_weights,
    subset_accuracy,
)


def answers(*rows: str) -> np.ndarray:
    """'x' is a zone that is touched, or said to be; a row is a leg."""
    return np.array([[zone == "x" for zone in row] for row in rows])


TRUTH = answers("xx......", "xx......")
CASES = [  # predicted, then TP FP TN FN, then what follows from them
    (("xx......", "xx......"), (4, 0, 12, 0), {"accuracy": 1, "precision": 1, "recall": 1, "mcc": 1}),
    (
        ("x.x.....", "xx......"),
        (3, 1, 11, 1),
        {"accuracy": 14 / 16, "precision": 3 / 4, "recall": 3 / 4, "f1": 3 / 4, "hamming": 2 / 16,
         "mcc": (3 * 11 - 1) / math.sqrt(4 * 4 * 12 * 12), "subset": 1 / 2},
    ),
    (
        ("........", "........"),
        (0, 0, 12, 4),
        {"accuracy": 12 / 16, "precision": 0, "recall": 0, "f1": 0, "mcc": 0, "subset": 0},
    ),
    (
        ("xxxxxxxx", "xxxxxxxx"),
        (4, 12, 0, 0),
        {"accuracy": 4 / 16, "precision": 4 / 16, "recall": 1, "hamming": 12 / 16, "mcc": 0},
    ),
    (("..xxxxxx", "..xxxxxx"), (0, 12, 0, 4), {"accuracy": 0, "hamming": 1, "mcc": -1}),
]  # fmt: skip


@pytest.mark.parametrize(("predicted", "by_kind", "expected"), CASES)
def test_measures_of_cases_counted_by_hand(predicted, by_kind, expected):
    found = answers(*predicted)
    assert counts(found, TRUTH) == AnswerCounts(*by_kind)
    values = measured(found, TRUTH)
    assert {name: values[name] for name in expected} == pytest.approx(expected)


@given(arrays(bool, (5, 7)), arrays(bool, (5, 7)))
def test_hamming_loss_is_one_less_accuracy_and_mcc_is_the_correlation(predicted, truth):
    values = measured(predicted, truth)
    assert values["hamming"] == pytest.approx(1 - values["accuracy"])
    assert values["subset"] == np.mean(
        [np.array_equal(a, b) for a, b in zip(predicted, truth, strict=True)]
    )
    if predicted.any() and truth.any() and not predicted.all() and not truth.all():
        correlation = np.corrcoef(predicted.ravel(), truth.ravel())[0, 1]
        assert values["mcc"] == pytest.approx(correlation, abs=1e-12)


def test_counts_may_be_large():
    assert mcc(AnswerCounts(10**12, 0, 10**12, 0)) == 1.0


def test_arrays_of_different_shapes_are_refused():
    with pytest.raises(ValueError, match="shapes differ"):
        counts(TRUTH, TRUTH[:1])
    assert subset_accuracy(TRUTH, TRUTH) == 1.0


def test_less_hamming_loss_and_more_of_everything_else_is_an_improvement():
    worse, better = AnswerCounts(3, 2, 10, 2), AnswerCounts(4, 1, 11, 1)
    for name, metric in MEASURES.items():
        assert metric.improves(better, worse), name
        assert not metric.improves(worse, better), name
        assert not metric.improves(worse, worse), name


def test_the_weights_and_the_bias_of_the_paper():
    truth = answers("x...", "....")  # one touched of eight
    assert sample_weights(truth) == (8 / 7, 8.0)
    assert first_bias(truth) == pytest.approx(math.log(1 / 7))
    assert 1 / (1 + math.exp(-first_bias(truth))) == pytest.approx(1 / 8)


def test_the_printed_tables_are_complete():
    assert [len(rows) for rows in PRINTED_TABLES.values()] == [5, 5, 4, 5]
    assert monitored("bias") == list(PRINTED_TABLES[1]) == list(PRINTED_TABLES[2])
    assert set(monitored("samples")) == {*PRINTED_TABLES[3], *PRINTED_TABLES[4]}
    assert all(
        name in MEASURES for rows in PRINTED_TABLES.values() for keep in rows for name in keep
    )
