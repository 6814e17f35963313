"""The tutorial on learning: its network sees the same in an environment and in a run, and delivers."""

from __future__ import annotations

import importlib
import shutil
import sys
from collections.abc import Iterator
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from doc_commands import WEIGHTS, write_files
from docs_pages import page

import automaton
from automaton.environments import Environment

FLOOR = "learning-floor.yaml"


@pytest.fixture
def learned(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Any]:
    """The module `learned` of the page, in its folder."""
    write_files(page("docs/tutorials/learn-a-right-of-way.md"), tmp_path)
    shutil.copy(WEIGHTS, tmp_path)
    monkeypatch.chdir(tmp_path)
    monkeypatch.syspath_prepend(str(tmp_path))
    yield importlib.import_module("learned")
    for name in ("learned", "learn"):
        sys.modules.pop(name, None)


def delivered(name: str, **parameters: str) -> int:
    chosen = {"right_of_way": {"name": name, **parameters}}
    run = automaton.simulate(FLOOR, seed=9, strategies=chosen, stop__max_duration=300)
    assert run.metrics["illegal_answers"] == 0
    return run.delivered


def test_a_rollout_sees_what_the_strategy_sees(learned: Any) -> None:
    env = Environment(FLOOR, radius=learned.RADIUS, features=True, facing=True, max_ticks=12)
    env.reset(seed=3)
    layers = np.zeros((learned.INPUTS, learned.ACTIONS)), np.zeros(learned.ACTIONS)
    network, draws = partial(learned.logits_of, layers), np.random.default_rng(1)
    for tick in range(12):
        view = env._world(0).world
        assert np.array_equal(learned.inputs_of_view(view), learned.inputs_of_environment(env))
        assert np.array_equal(learned.masks_of_view(view), env.masks[0])
        inputs, masks, acting, actions, rewards, ends = learned.rollout(env, network, 1, draws)
        assert inputs.shape == (1, env.robots, learned.INPUTS) and acting.all()
        assert np.take_along_axis(masks, actions[..., None], 2).all() and not env.invalid.any()
        assert rewards.shape == (1, env.robots) and ends.all() == (tick == 11)


def test_the_shipped_network_delivers(learned: Any) -> None:
    network = delivered("learned:Learned", weights=WEIGHTS.name)
    assert network >= 30 * delivered("learned:Learned") > 0
    assert network >= delivered("pibt") / 2


def test_a_few_updates_teach_something(learned: Any) -> None:
    pytest.importorskip("torch", reason="the extra `learn` is not installed")
    learn = importlib.import_module("learn")
    learned.save("few.npz", learn.layers_of(learn.learn(seed=1, updates=20)))
    few = delivered("learned:Learned", weights="few.npz")
    assert few > 10 * delivered("learned:Learned")
