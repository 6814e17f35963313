"""Weighted average consensus: what robots in range of each other agree on."""

from __future__ import annotations

from itertools import combinations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray
from zoning_scenes import near_of

from strategies.zoning.decentralized import moved
from strategies.zoning.negotiation import sigma_about

Numbers = NDArray[np.int64]

LOADS = st.lists(st.integers(0, 10**12), min_size=1, max_size=9)  # billionths of a minute


def consensus(x: Numbers, near: NDArray[np.uint8], steps: int = 1) -> Numbers:
    """What (n,) robots have after synchronous steps; near: (n, n), symmetric."""
    degree = near.sum(axis=1).tolist()
    for _ in range(steps):
        told = x.tolist()
        x = np.array(
            [
                own + sum(moved(own, told[j], degree[i], degree[j]) for j in near[i].nonzero()[0])
                for i, own in enumerate(told)
            ]
        )
    return x


@given(LOADS, st.data())
def test_the_sum_is_kept_at_every_step_on_any_graph(loads: list[int], data: st.DataObject) -> None:
    pairs = list(combinations(range(len(loads)), 2))
    chosen = data.draw(st.lists(st.sampled_from(pairs))) if pairs else []
    near, x = near_of(len(loads), chosen), np.array(loads)
    for _ in range(5):
        after = consensus(x, near)
        assert after.sum() == sum(loads)
        assert x.min() <= after.min() and after.max() <= x.max()
        x = after


@settings(max_examples=25)
@given(LOADS, st.data())
def test_a_connected_graph_tends_to_the_mean(loads: list[int], data: st.DataObject) -> None:
    tree = [(i, data.draw(st.integers(0, i - 1))) for i in range(1, len(loads))]
    x = np.array(loads)
    x = consensus(x, near_of(len(loads), tree), 2000)
    assert x == pytest.approx([np.mean(loads)] * len(loads), abs=100)


def test_robots_out_of_range_agree_among_themselves_only() -> None:
    x = np.array([1, 3, 10, 20, 7]) * 10**9
    x = consensus(x, near_of(5, [(0, 1), (2, 3)]), 100)
    assert x == pytest.approx(np.array([2, 2, 15, 15, 7]) * 1e9, abs=10) and x[4] == 7 * 10**9


def test_three_robots_in_range_have_the_mean_after_one_step() -> None:
    x = np.array([1, 2, 6]) * 10**9
    after = consensus(x, near_of(3, combinations(range(3), 2)))
    assert after == pytest.approx([3e9] * 3, abs=2)


def test_a_chain_uses_the_larger_degree() -> None:
    x = np.array([0, 3, 9])
    after = consensus(x, near_of(3, [(0, 1), (1, 2)]))
    assert after.tolist() == [1, 3 - 1 + 2, 7]


def test_sigma_measures_from_the_mean() -> None:
    """Eq. 5 prints (L_i + x_i)^2 for the robot's own load; equal loads must have no spread."""
    reach = np.ones(3, np.uint8)
    assert sigma_about(np.array([5.0, 5, 5]), reach, 5.0) == 0
    assert sigma_about(np.array([2.0, 5, 8]), reach, 5.0) == pytest.approx(np.sqrt(6))
    assert sigma_about(
        np.array([2.0, 5, 800]), np.array([1, 1, 0], np.uint8), 5.0
    ) == pytest.approx(np.sqrt(4.5))
