"""Environments: what robots may do, what they see and earn, how episodes begin and end."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from automaton.environments import Environment, reset_kernels, stepping
from automaton.errors import InputError
from automaton.recording.frames import resolved_of
from automaton.runs.simulation import Simulation
from automaton.verification.verification import verify
from automaton.world.resolve import resolve

STAY, EAST, SOUTH, WEST = 0, 1, 2, 3
MINI = "tabletop-mini"
TOURS = {
    "name": "tours",
    "layout": {"generator": "random", "columns": 8, "rows": 8, "obstacles": 0.2},
    "fleet": {"robots": 6, "kinematics": "omni", "start": "random"},
    "orders": {"generator": "tours", "count": 12, "stops": 2},
    "stop": {"when": "delivered", "max_duration": 500},
}


def floor(picture: str, *start: tuple[int, int], **parts: Any) -> dict[str, Any]:
    """Robots on a drawn floor, whose orders are stops."""
    kinematics = parts.pop("kinematics", "omni")
    fleet = {"robots": len(start), "kinematics": kinematics, "start": [list(one) for one in start]}
    body = {"name": "drawn", "layout": {"picture": picture}, "fleet": fleet, **parts}
    body.setdefault("stop", {"when": "delivered", "max_duration": 100})
    return body


def to(*stops: tuple[int, int]) -> dict[str, Any]:
    """An order for each of these cells."""
    return {"list": [{"stops": [list(one)]} for one in stops]}


def walk(env: Environment, steps: int) -> list[list[int]]:
    """The digests after each of some random steps, which depend on the world alone."""
    digests = []
    for step in range(steps):
        for w in range(env.worlds):
            draws = np.random.default_rng([step, w]).random(env.masks[w].shape)
            env.actions[w] = (draws * env.masks[w]).argmax(axis=1)
        env.step()
        digests.append(env.digests().tolist())
    return digests


def test_an_episode_is_the_same_alone_in_a_batch_and_in_threads() -> None:
    runs = []
    for worlds, threads in ((1, 1), (3, 1), (3, 2)):
        env = Environment(MINI, worlds, max_ticks=30, threads=threads)
        env.reset(seed=4)
        runs.append([row[:1] if worlds == 1 else row for row in walk(env, 40)])
        env.close()
    alone, batch, threaded = runs
    assert [row[:1] for row in batch] == alone
    assert batch == threaded


def test_functions_that_find_structs_and_functions_have_names_of_their_own() -> None:
    found = [one for module in (stepping, reset_kernels) for one in vars(module).items()]
    finders = {one for name, one in found if name.endswith("_at") and callable(one)}
    assert len(finders) > 30
    assert len({one.__qualname__ for one in finders}) == len(finders)


def test_a_saved_episode_is_a_recording_that_verifies(tmp_path: Path) -> None:
    env = Environment(MINI, 2, max_ticks=40, log=True, drive="guided")
    env.reset(seed=2)
    walk(env, 30)
    env.save(1, tmp_path / "run.rec")
    result = verify(tmp_path / "run.rec")
    assert result.passed and result.recording.header["seed"] == int(env.seeds[1])
    assert resolved_of(result.recording.header).scenario.seed == int(env.seeds[1]), "as reports say"


def test_a_robot_drives_to_its_stop_and_earns_what_it_ends() -> None:
    reward = {"delivered": 10, "nearer": 1, "tick": -0.5}
    env = Environment(floor("...\n...", (0, 0), orders=to((2, 0))), reward=reward, max_ticks=20)
    env.reset()
    rewards = []
    for _ in range(2):
        env.step([[EAST]])
        rewards.append(float(env.rewards[0, 0]))
    assert rewards == [0.5, 9.5], "its stop takes no time, and then it has no goal"
    assert env.terminations.all() and not env.truncations.any() and env.ticks.tolist() == [2]


def test_a_window_shows_walls_other_robots_and_the_goal() -> None:
    channels = ("walls", "ways", "robots", "headings", "goal", "goals")
    scenario = floor("#..\n...", (1, 0), (2, 0), orders=to((0, 1), (0, 1)))
    env = Environment(scenario, radius=1, channels=channels, max_ticks=20)
    env.reset()
    walls, ways, robots, headings, goal, goals = env.observations[0, 0].tolist()
    assert walls == [[1, 1, 1], [1, 0, 0], [0, 0, 0]]
    assert ways == [[0, 0, 0], [0, 3, 6], [1, 13, 12]]
    assert robots == headings == [[0, 0, 0], [0, 0, 1], [0, 0, 0]]
    assert goal == goals == [[0, 0, 0], [0, 0, 0], [1, 0, 0]]


def test_windows_of_two_radii_agree_where_both_reach() -> None:
    small, large = (Environment(TOURS, radius=radius, max_ticks=9) for radius in (1, 2))
    for env in (small, large):
        env.reset(seed=1)
    assert small.observations is not None and large.observations is not None
    inner = large.observations[:, :, :2, 1:4, 1:4]  # the goal is clipped to the window
    assert np.array_equal(small.observations[:, :, :2], inner)


@pytest.mark.parametrize(
    ("kinematics", "mask"),
    [("omni", [1, 1, 1, 0, 0]), ("differential", [1, 0, 1, 1]), ("rail", [1, 1, 0, 1])],
)
def test_masks_are_the_rules_of_the_floor(kinematics: str, mask: list[int]) -> None:
    """In a corner with a turntable: the differential robot looks north, the rail robot stands across."""
    scenario = floor("+.\n..", (0, 0), kinematics=kinematics, orders=to((0, 1)))
    if kinematics == "differential":
        scenario["fleet"]["heading"] = "north"
    env = Environment(scenario, max_ticks=20)
    env.reset()
    assert env.masks[0, 0].tolist() == mask


@pytest.mark.parametrize("kinematics", ["omni", "differential", "rail"])
@pytest.mark.parametrize("drive", ["free", "guided"])
def test_no_action_is_illegal_whatever_a_learner_does(kinematics: str, drive: str) -> None:
    picture = "++++#\n+##++\n+++++\n+~+++"
    scenario = floor(
        picture, (0, 0), (3, 1), (4, 3), kinematics=kinematics, orders=to((4, 2), (0, 2))
    )
    env = Environment(scenario, drive=drive, max_ticks=80)
    env.reset()
    walk(env, 60)
    assert env.invalid.tolist() == [0]
    draws, invalid = np.random.default_rng(1), 0
    for _ in range(60):
        env.step(draws.integers(-2, 9, env.actions.shape))
        invalid = max(invalid, int(env.invalid[0]))
        assert env._world(0).world.tally.illegal.sum() == 0
    assert invalid > 0


@pytest.mark.parametrize(("drive", "go", "handle"), [("free", EAST, 5), ("guided", STAY, 6)])
def test_a_task_begins_by_an_action_of_its_own(
    drive: str, go: int, handle: int, tmp_path: Path
) -> None:
    """The robot drives to its stop, stays there for two steps, and begins it when it is to."""
    stop = {"list": [{"stops": [{"at": [2, 0], "for": 2}]}]}
    scenario = floor("...", (0, 0), orders=stop)
    env = Environment(scenario, drive=drive, handling="action", log=True, max_ticks=20)
    env.reset()
    shown, rewards = [], []
    for action in (go, go, STAY, STAY, handle, STAY):
        shown.append(int(env.masks[0, 0, handle]))
        env.step([[action]])
        rewards.append(int(env.rewards[0, 0]))
    assert shown == [0, 0, 1, 1, 1, 0] and env.masks.shape[2] == handle + 1
    assert rewards == [0, 0, 0, 0, 0, 1] and env.terminations.all() and not env.invalid.any()
    env.save(0, tmp_path / "run.rec")
    assert verify(tmp_path / "run.rec").passed


def test_what_counts_against_the_mask_earns_nothing_and_moves_nobody() -> None:
    env = Environment(floor("#.", (1, 0), orders=to((1, 0))), reward={"invalid": -1}, max_ticks=9)
    env.reset()
    env.step([[WEST]])
    assert env.rewards.tolist() == [[-1]] and env.invalid.tolist() == [1]


def test_after_the_end_the_next_step_begins_another_episode() -> None:
    env = Environment(TOURS, 2, max_ticks=3)
    env.reset(seed=1)
    first = env.seeds.copy()
    for _ in range(3):
        env.step()
    assert env.truncations.all() and env.masks.sum() == env.masks[:, :, 0].sum()
    env.step()
    assert not env.truncations.any() and env.ticks.tolist() == [0, 0]
    assert (env.seeds != first).all()
    env.reset(seed=1)
    assert (env.seeds == first).all()


def test_in_the_step_of_the_end_the_last_view_is_kept_beside_the_first_one() -> None:
    later = Environment(TOURS, 2, max_ticks=3)
    at_once = Environment(TOURS, 2, max_ticks=3, autoreset="same_step", reward={"tick": 1})
    for env in (later, at_once):
        env.reset(seed=1)
        for _ in range(3):
            env.step()
    assert at_once.truncations.all() and at_once.rewards.all() and not at_once.ticks.any()
    assert at_once.final_observations is not None
    assert np.array_equal(at_once.final_observations, later.observations)
    later.step()
    assert np.array_equal(at_once.observations, later.observations)
    assert np.array_equal(at_once.seeds, later.seeds)


def test_a_disabled_world_stands_still_until_it_is_reset() -> None:
    env = Environment(TOURS, 2, max_ticks=2, autoreset="disabled", reward={"tick": 1})
    env.reset(seed=1)
    for _ in range(4):
        env.step()
    assert env.truncations.all() and not env.rewards.any() and env.ticks.tolist() == [2, 2]
    env.reset(options={"reset_mask": np.array([False, True]), "unknown": 1})
    env.step()
    assert env.ticks.tolist() == [2, 1] and env.rewards[:, 0].tolist() == [0, 1]


@pytest.mark.parametrize("assign", ["pool", "round-robin"])
def test_a_compiled_reset_gives_the_world_of_a_simulation(assign: str) -> None:
    scenario = {**TOURS, "orders": {**TOURS["orders"], "assign": assign}}
    env = Environment(scenario, 1, max_ticks=6)
    assert env.compiled_reset
    env.reset(seed=1)
    walk(env, 5)
    world = env._world(0)
    for seed in range(20, 40):
        env._begin_world(0, seed)
        assert world.digest == Simulation(env._resolved, seed).digest


def test_what_kernels_cannot_draw_is_built() -> None:
    env = Environment(MINI, 1, max_ticks=6)
    assert not env.compiled_reset
    env.reset(options={"seeds": np.array([7], np.uint64)})
    assert env._world(0).seed == 7


def test_a_step_of_decisions_waits_for_a_robot_that_acts() -> None:
    scenario = floor("....", (0, 0), orders=to((3, 0)), durations={"move": 4})
    env = Environment(scenario, stepping="decision", max_ticks=50, reward={"tick": 1})
    env.reset()
    env.step([[EAST]])
    assert (env.ticks[0], env.elapsed[0, 0], env.rewards[0, 0], env.acting[0, 0]) == (4, 4, 4, 1)
    env.step([[STAY]])
    assert (env.ticks[0], env.elapsed[0, 0]) == (5, 1)


def test_robots_that_follow_their_routes_deliver() -> None:
    scenario = floor("....\n....", (0, 0), (3, 1), orders=to((3, 0), (0, 1)))
    env = Environment(scenario, drive="guided", max_ticks=50)
    env.reset()
    total = np.zeros(2)
    while not env.terminations.any():
        env.step(np.zeros((1, 2), int))
        total += env.rewards[0]
    assert total.sum() == 2 and env.ticks[0] < 12


def test_features_tell_where_the_goal_is() -> None:
    scenario = floor(".....", (0, 0), orders=to((4, 0)))
    env = Environment(scenario, features=True, radius=None, max_ticks=9)
    env.reset()
    assert env.observations is None and env.features is not None
    assert env.features[0, 0, [6, 10, 11, 12, 13]].tolist() == [1, 4 / 16, 0, 4 / 64, 1]


def test_ahead_of_the_robot_is_up_in_views_that_face() -> None:
    scenario = {**TOURS, "fleet": {**TOURS["fleet"], "kinematics": "differential"}}
    channels = ("walls", "robots", "goal", "ways", "headings")
    north, ahead = (
        Environment(scenario, channels=channels, features=True, facing=facing, max_ticks=9)
        for facing in (False, True)
    )
    for env in (north, ahead):
        env.reset(seed=1)
        walk(env, 8)
    headings = north.features[0, :, :4].argmax(axis=1)
    assert len(set(headings.tolist())) > 2 and (ahead.features[0, :, 3] == 1).all()
    for robot, heading in enumerate(headings):
        quarters = (heading + 1) % 4
        turned = np.rot90(north.observations[0, robot], quarters, axes=(1, 2))
        shown = ahead.observations[0, robot]
        assert np.array_equal(shown[:3], turned[:3])
        exits, ways = ((cells[..., None] >> np.arange(4)) & 1 for cells in (shown[3], turned[3]))
        assert np.array_equal(exits, np.roll(ways, -quarters, axis=2))
        directions = np.roll([1, 2, 3, 4], quarters)
        assert np.array_equal(shown[4], np.array([0, *directions])[turned[4]])
        right, back = ahead.features[0, robot, 10:12]
        east, south = north.features[0, robot, 10:12]
        assert right + 1j * back == (east + 1j * south) * (-1j) ** quarters


def test_an_environment_fills_arrays_of_the_caller() -> None:
    rewards = np.full((1, 6), 9, np.float32)
    env = Environment(TOURS, buffers={"rewards": rewards}, max_ticks=9)
    env.reset(seed=1)
    assert env.rewards is rewards and not rewards.any()


@pytest.mark.parametrize(
    ("options", "said"),
    [
        (
            {"drive": "fre"},
            "unknown drive 'fre' (did you mean 'free'?): allowed are free or guided",
        ),
        (
            {"channels": ["wall"]},
            "unknown channel 'wall' (did you mean 'walls'?): allowed are walls",
        ),
        ({"reward": {"deliver": 1}}, "unknown component of reward 'deliver'"),
        ({"handling": "manual"}, "unknown handling 'manual': allowed are automatic or action"),
        ({"facing": True}, "facing=True turns views by the heading of the robot"),
        ({"facing": True, "radius": None}, "facing=True turns windows and features"),
        ({"worlds": 0}, "worlds is at least 1; found 0"),
        ({"threads": 2}, "threads is 1 to 1; found 2"),
        ({"radius": 16}, "radius is 0 to 15; found 16"),
        ({"max_ticks": 501}, "max_ticks is 1 to 500; found 501"),
        ({"worlds": 10**9}, "worlds take"),
        ({"settings": "seed=1"}, "settings is a list of texts"),
        ({"settings": ["information=orders"]}, "robots see 1 cells far: it is at most 1"),
        ({"settings": ["strategy.allocation=independent-python"]}, "is not compiled"),
        (
            {"buffers": {"masks": np.zeros(3)}},
            "masks is a C-contiguous array of int8, shape (1, 6, 5)",
        ),
        ({"buffers": {"mask": np.zeros(3)}}, "unknown buffer 'mask' (did you mean 'masks'?)"),
    ],
)
def test_bad_input_is_one_sentence(options: dict[str, Any], said: str) -> None:
    with pytest.raises(InputError) as raised:
        Environment(TOURS, **options)
    assert said in str(raised.value)


def test_a_step_needs_a_reset_and_an_open_environment() -> None:
    env = Environment(TOURS, max_ticks=5)
    with pytest.raises(InputError, match=r"call reset\(\) before step\(\)"):
        env.step()
    env.reset()
    with pytest.raises(InputError, match="actions are integers of the shape"):
        env.step([[0.5] * 6])
    with pytest.raises(InputError, match="log=True"):
        env.save(0, "run.rec")
    env.close()
    with pytest.raises(InputError, match="closed"):
        env.step()


def test_the_seed_of_an_episode_has_the_demand_of_a_run() -> None:
    env = Environment(TOURS, 2, max_ticks=5)
    env.reset(seed=3)
    for w in range(2):
        run = Simulation(resolve(TOURS), int(env.seeds[w]))
        assert np.array_equal(run.world.stops.cell, env._world(w).world.stops.cell)
