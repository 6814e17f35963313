"""When frames go out, told with made-up times; no terminal is asked."""

from __future__ import annotations

import asyncio
import math
import selectors
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from itertools import count, pairwise
from typing import Any

import pytest

from tui.terminal.frame_pacing import FrameClock, FramePacer
from tui.terminal.map_view import TerminalFrame


def play(pace: FramePacer, seconds: float, delay: float, size: int = 1000) -> int:
    """Frames that go out when each answer takes `delay` seconds and the clock ticks at 120 Hz."""
    now, due, frames = 0.0, 0.0, 0
    answers: list[float] = []
    while now < seconds:
        while answers and answers[0] <= now:
            pace.answered(answers.pop(0))
        if now >= due and pace.ready(now, 0):
            pace.sent(now, size)
            answers.append(now + delay)
            frames += 1
            due = now + pace.interval() - 1e-9
        now += 1 / 120
    return frames


def test_a_fast_link_gets_what_was_asked_for() -> None:
    assert play(FramePacer(30), 4.0, delay=0.002) in (120, 121)
    assert play(FramePacer(60), 4.0, delay=0.002) in (240, 241)


def test_two_small_frames_may_be_under_way_and_of_large_ones_only_on_a_short_way() -> None:
    for size, way, allowed in ((1000, 0.03, 2), (10_000, 0.03, 1), (10_000, 0.003, 2)):
        pace = FramePacer(30)
        pace.sent(0.0, size)
        assert pace.ready(0.0, 0) == (size == 1000), "nothing is known of the way yet"
        pace.answered(way)
        for _ in range(allowed):
            assert pace.ready(1.0, 0)
            pace.sent(1.0, size)
        assert not pace.ready(1.0, 0)
        pace.answered(1.05)
        assert pace.ready(1.05, 0)


def test_frames_of_which_nobody_is_asked_hold_none_back() -> None:
    pace = FramePacer(30)
    for _ in range(9):
        assert pace.ready(1.0, 0)
        pace.sent(1.0, 1000, asked=False)


def test_over_a_long_way_one_frame_is_under_way() -> None:
    pace = FramePacer(30)
    pace.sent(0.0, 1000)
    pace.answered(0.4)
    pace.sent(0.4, 1000)
    assert not pace.ready(0.45, 0)


def test_a_slow_link_is_asked_for_less_and_for_more_when_it_recovers() -> None:
    pace = FramePacer(30)
    frames = play(pace, 10.0, delay=0.19)
    assert 40 <= frames <= 55  # one at a time, 0.19 s each
    assert pace.figures(10.0).allowed == 10
    assert pace.strained
    assert math.isclose(pace.figures(10.0).round_trip, 0.19, abs_tol=0.01)
    assert math.isclose(pace.figures(10.0).fps, 5, abs_tol=1)
    now = 10.5
    for _ in range(400):
        pace.answered(now)
        if pace.ready(now, 0):
            pace.sent(now, 100)
        now += 1 / 30
    assert pace.figures(now).allowed == 30
    assert not pace.strained


@pytest.mark.parametrize("slow, fallen, recovered", [(2.0, 15, 30), (6.0, 10, 10)])
def test_a_frame_held_back_now_and_then_keeps_only_the_slowest_step(
    slow: float, fallen: int, recovered: int
) -> None:
    pace, now = FramePacer(30), 0.0
    for end, queued in (
        (slow + 0.01, lambda k: 3 * (k % 9 > 0)),
        (30.0, lambda k: 3 * (k % 20 == 0)),
    ):
        for frame in count():
            pace.answered(now)
            if pace.ready(now, queued(frame)):
                pace.sent(now, 100)
            if now >= end:
                break
            now += pace.interval()
        assert pace.figures(now).allowed == (fallen if end < 30 else recovered)


def test_a_link_between_two_steps_is_seldom_asked_for_the_faster_one() -> None:
    """It carries 14 frames a second: nearly all of 15, and less than that of 30."""
    pace, now, due, steps = FramePacer(30, max_kbit=112), 0.0, 0.0, [30]
    while now < 200:
        if now >= due and pace.ready(now, 0):
            pace.sent(now, 1000, asked=False)
            due = now + pace.interval()
        elif now >= due:
            due += pace.interval()
        now += 1 / 240
        if (allowed := pace.figures(now).allowed) != steps[-1]:
            steps.append(allowed)
    assert 3 <= len(steps) <= 16, steps  # a hundred if each calm window were a reason


def test_a_terminal_that_never_answers_is_served_by_time() -> None:
    pace = FramePacer(30)
    assert play(pace, 10.0, delay=math.inf) > 150
    assert not pace.figures(10.0).answers
    pace.answered(10.0)
    assert pace.figures(10.0).answers


def test_a_link_that_stalls_gets_a_frame_now_and_then() -> None:
    pace = FramePacer(30)
    pace.sent(0.0, 1000)
    pace.answered(0.05)
    assert play(pace, 10.0, delay=math.inf) <= 12
    assert pace.figures(10.0).answers


def test_the_writer_threads_queue_is_left_room() -> None:
    pace = FramePacer(30)
    assert pace.ready(0.0, queued=2)
    assert not pace.ready(0.0, queued=3)
    assert pace.skipped == 1


def test_frames_are_forgotten_though_nobody_asks_for_figures() -> None:
    pace = FramePacer(30)
    assert play(pace, 60.0, delay=0.01) > 1000 and len(pace._history) < 100


def test_a_cap_on_the_bits_is_kept() -> None:
    capped = FramePacer(30, max_kbit=80)  # 10 KB a second
    assert 45 <= play(capped, 5.0, delay=0.01) <= 54  # of 1 KB each, a quarter second at once


def test_an_inactive_window_and_an_obstructed_map_get_fewer_frames() -> None:
    pace = FramePacer(30)
    pace.obstructed = True
    assert pace.interval() == 0.1
    pace.blurred = True
    assert pace.interval() == 0.5
    pace.blurred = pace.obstructed = False
    assert pace.interval() == 1 / 30


class MadeUpTime(asyncio.SelectorEventLoop):
    """An event loop that never sleeps: its time jumps to the next timer."""

    def __init__(self) -> None:
        loop = self

        class Selector(selectors.DefaultSelector):
            def select(self, timeout: float | None = None) -> Any:
                loop.now += timeout or 0.0
                return super().select(0)

        self.now = 0.0
        super().__init__(Selector())

    def time(self) -> float:
        return self.now


class Screen:
    """Stands for the presenter: notes when frames go out, and answers if it is told how fast."""

    obstructed = False

    def __init__(self, loop: MadeUpTime) -> None:
        self.loop = loop
        self.times: list[float] = []
        self.answer: Callable[[], None] = lambda: None
        self.delay = 0.0

    @contextmanager
    def frame(self) -> Iterator[TerminalFrame]:
        frame = TerminalFrame(size=1000)
        yield frame
        if not frame.acknowledged:
            return
        frame.asked = True
        self.times.append(round(self.loop.now, 6))
        self.loop.call_later(self.delay, self.answer)

    def queued(self) -> int:
        return 0


def run_clock(
    seconds: float,
    *,
    draw: Callable[[MadeUpTime], None] = lambda _: None,
    delay: float = 0.0,
    wakes: tuple[float, ...] = (),
    expects: tuple[float, ...] = (),
    news: tuple[float, ...] | None = None,
    fps: int = 10,
) -> list[float]:
    """The times at which frames go out; with `news` only when there are some."""
    loop = MadeUpTime()
    screen = Screen(loop)
    screen.delay = delay
    fresh: list[int] = []

    def drawn() -> bool:
        draw(loop)
        some = news is None or bool(fresh)
        fresh.clear()
        return some

    async def run() -> None:
        clock = FrameClock(screen, drawn, FramePacer(fps))  # type: ignore[arg-type]
        screen.answer = lambda: clock.answered(loop.time())
        clock.start()
        for wake in wakes:
            loop.call_at(wake, clock.wake)
        for order in expects:
            loop.call_at(order, clock.expect)
        for new in news or ():
            loop.call_at(new, lambda: (fresh.append(0), clock.on_published()))
        await asyncio.sleep(seconds)
        clock.stop()

    with asyncio.Runner(loop_factory=lambda: loop) as runner:
        runner.run(run())
    return screen.times


def test_deadlines_are_absolute() -> None:
    def draw(loop: MadeUpTime) -> None:
        loop.now += 0.03  # drawing takes time, but the next frame is not later for it

    assert run_clock(0.45, draw=draw) == pytest.approx([0.03, 0.13, 0.23, 0.33, 0.43])


def test_frames_that_are_missed_are_not_made_up_for() -> None:
    def draw(loop: MadeUpTime) -> None:
        loop.now += 0.95 if loop.now < 0.05 else 0.0

    times = run_clock(1.3, draw=draw)
    assert times[0] == pytest.approx(0.95)
    assert len(times) <= 5 and all(b - a > 0.04 for a, b in pairwise(times))


def test_a_key_has_its_frame_at_once_and_the_next_one_comes_an_interval_later() -> None:
    assert run_clock(0.35, wakes=(0.12,)) == pytest.approx([0.0, 0.1, 0.12, 0.22, 0.32], abs=0.005)


def test_a_key_just_after_a_frame_has_its_own_at_once() -> None:
    assert run_clock(0.35, wakes=(0.102,)) == pytest.approx([0.0, 0.1, 0.102, 0.202, 0.302])


def test_many_keys_share_a_frame() -> None:
    wakes = tuple(0.15 + i / 1000 for i in range(40))
    times = run_clock(0.35, wakes=wakes)
    assert all(b - a >= 1 / 61 for a, b in pairwise(times))
    assert sum(0.149 < time < 0.195 for time in times) in (3, 4)


def test_a_frame_that_had_to_wait_goes_out_with_the_answer() -> None:
    assert run_clock(0.6, delay=0.12, fps=30)[:4] == pytest.approx(
        [0.0, 0.033333, 0.12, 0.153333], abs=0.002
    )


def test_the_clock_falls_into_step_with_the_news() -> None:
    news = tuple(0.05 + tick / 10 for tick in range(10))
    assert run_clock(1.0, news=news) == pytest.approx([round(at, 6) for at in news], abs=0.002)


def test_news_that_come_at_their_time_now_and_then_are_all_shown() -> None:
    """A tick for each frame, early and late by turns: none is skipped for it."""
    news = tuple(0.05 + tick / 60 + 0.004 * (tick % 3) for tick in range(60))
    assert len(run_clock(1.2, news=news, fps=60)) == 60


def test_news_by_the_thousand_get_the_frames_that_were_asked_for() -> None:
    news = tuple(tick / 1000 for tick in range(1000))
    assert 10 <= len(run_clock(0.999, news=news)) <= 12


def test_the_effect_of_an_order_is_shown_at_once() -> None:
    news = (0.01, 0.13, 0.135, 0.3)
    usual = run_clock(0.45, news=news)
    assert usual == pytest.approx([0.01, 0.13, 0.23, 0.33], abs=0.002)
    eager = run_clock(0.45, news=news, expects=(0.12,))
    assert eager == pytest.approx([0.01, 0.13, 0.1467, 0.3], abs=0.002)
