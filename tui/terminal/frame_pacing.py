"""Frame pacing: a clock that does not drift, throttled by the terminal's answers.

frame + ESC[6n  ->  link  ->  terminal
     ^                           |       at most two frames are in flight at any time,
     +------ cursor position ----+       so a slow link shows fewer pictures, never older ones
"""

from __future__ import annotations

import asyncio
import contextlib
import gc
import math
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass

from tui.terminal.map_view import Presenter

SLOWER = (30, 15, 10)  # frames per second: the steps down for a slow link
BLURRED = 0.5  # seconds between frames while the terminal window has no focus
OBSTRUCTED = 0.1  # seconds between frames while the compositor repaints whole rows
WOKEN = 1 / 60  # seconds: minimum interval between frames that keys and the mouse request, or
# this share of the usual interval if shorter, so that the clock catches up after a late frame
WAKE_INTERVAL_SHARE = 0.6
EXPECTED = 0.05  # seconds after a request during which news is shown at once
ANSWER_TIMEOUT_S = 2.0  # seconds without an answer after which frames in flight count as lost
LONG_WAY = 0.150  # seconds of round trip from which only one frame is in flight
SHORT_WAY = 0.02  # seconds of round trip up to which two large frames may be in flight
# bytes of a frame from which only one frame is in flight on a longer round trip
LARGE_FRAME_BYTES = 8192
# The terminal does not keep up if it needs longer than this for each frame of average size or more, while
# frames are in flight for this share of the time, in so many more windows of measurement than not. The
# fastest frame counts, since a busy machine delays some answers, but a slow link delays all.
KEEPING_UP_S = 0.1
LATE_SHARE = 0.8
MAX_LATE_WINDOWS = 3
FEW_HELD = 0.1  # share of the frames that are due
LEAST_GAIN = 1.1  # times what the slower step would deliver: else a faster one is not worth it
MAX_PATIENCE = 32  # windows of measurement between two tries of a faster step
BARE_FRAME_BYTES = 512  # up to which the time to the answer is that of the way alone
QUEUED = 2  # writes that may wait in Textual's writer thread: its queue blocks the program at 30
LINK_WINDOW_S = 2.0  # seconds over which the link is measured


@dataclass(frozen=True)
class LinkFigures:
    """Measurements of the link, for the status line."""

    round_trip: float  # seconds from a frame to its answer; NaN before the first answer
    kilobytes: float  # of map data per second
    fps: float  # frames sent per second
    allowed: int  # frames per second at the current step
    answers: bool  # False: this terminal does not answer, so that time alone paces frames


class FramePacer:
    """Decides when a frame may be sent, without asyncio or Textual: times are arguments."""

    def __init__(self, fps: int = 30, max_kbit: float | None = None) -> None:
        self._rungs = (fps, *(slower for slower in SLOWER if slower < fps))
        self._rung = 0
        self._calm = 0  # successive windows with hardly a frame held back,
        self._patience = 1  # and how many of them a faster step needs
        self._tried = False  # a faster step was taken at the end of the last window
        self._rate = max_kbit * 125.0 if max_kbit else math.inf  # bytes per second
        self._credit = 0.0
        self._credited = 0.0
        self._under_way: deque[tuple[float, int]] = deque()  # when they were sent, bytes
        self._heard = 0.0
        self._ever_heard = False
        self._answers = True
        self._round_trip = math.nan
        self._last_size = 0
        self._history: deque[tuple[float, int]] = deque()
        self._sent = self._held = 0
        self._judged = 0.0
        self._late = 0  # windows of measurement, less those in time
        self._passed: list[tuple[int, float]] = []  # bytes and seconds of frames in this window,
        self._flying = 0.0  # and for how long any was in flight
        self._way: float | None = None  # seconds from a bare question to its answer
        self.has_images = False  # only then is it measured whether the terminal keeps up
        self.blurred = False
        self.obstructed = False
        self.skipped = 0

    @property
    def strained(self) -> bool:
        """The link is at its slowest step: panels should update once a second."""
        return len(self._rungs) > 1 and self._rung == len(self._rungs) - 1

    @property
    def is_late(self) -> bool:
        """Whether the terminal has not kept up with images for some seconds."""
        return self._late >= MAX_LATE_WINDOWS

    @property
    def needs_bare_question(self) -> bool:
        """Whether the next frame should be a question alone, which measures the way."""
        return self.has_images and self._late > 0 and self._way is None

    def interval(self) -> float:
        """Seconds between two frames at present."""
        usual = 1 / self._rungs[self._rung]
        return max(usual, BLURRED if self.blurred else 0.0, OBSTRUCTED if self.obstructed else 0.0)

    def ready(self, now: float, queued: int) -> bool:
        """Whether a frame may be sent now; `queued` writes still wait in this process."""
        self._give_up(now)
        self._judge(now)
        if self._rate < math.inf:
            earned = self._credit + (now - self._credited) * self._rate
            self._credit = min(earned, self._rate / 4)  # a burst of a quarter second
            self._credited = now
        window = 1 if self.needs_bare_question else self._window()
        free = queued <= QUEUED and len(self._under_way) < window and self._credit >= 0
        if not free:
            self._held += 1
            self.skipped += 1
        return free

    def sent(self, now: float, size: int, asked: bool = True) -> None:
        """Record a frame of `size` bytes; asked: it ended with a cursor position request."""
        if asked and self._answers:
            self._under_way.append((now, size))
        self._last_size = size
        self._credit -= size if self._rate < math.inf else 0
        self._history.append((now, size))
        self._forget(now)
        self._sent += 1

    def answered(self, now: float) -> None:
        """Record an answer: the terminal has shown everything before the oldest open request."""
        heard, self._heard = self._heard, now
        self._ever_heard = self._answers = True
        if self._under_way:
            sent, size = self._under_way.popleft()
            sample = now - sent
            self._pass(size, now - max(sent, heard), with_way=sent >= heard)
            known = not math.isnan(self._round_trip)
            self._round_trip += (sample - self._round_trip) / 4 if known else 0.0
            self._round_trip = self._round_trip if known else sample

    def figures(self, now: float) -> LinkFigures:
        """Measurements over the last two seconds."""
        self._forget(now)
        return LinkFigures(
            self._round_trip,
            sum(size for _, size in self._history) / LINK_WINDOW_S / 1000,
            len(self._history) / LINK_WINDOW_S,
            self._rungs[self._rung],
            self._answers,
        )

    def _forget(self, now: float) -> None:
        while self._history and self._history[0][0] < now - LINK_WINDOW_S:
            self._history.popleft()

    def _window(self) -> float:
        if not self._answers:
            return math.inf
        # A round trip of NaN is not known yet.
        large = self._last_size > LARGE_FRAME_BYTES and not self._round_trip <= SHORT_WAY
        return 1 if self._round_trip > LONG_WAY or large else 2

    def _pass(self, size: int, seconds: float, with_way: bool) -> None:
        """Record for how long a frame kept the terminal; `with_way`: including the way."""
        self._flying += seconds
        own = seconds - (self._way or 0.0) * with_way
        if size > BARE_FRAME_BYTES and own > 0:
            self._passed.append((size, own))
        elif size <= BARE_FRAME_BYTES and with_way:
            self._way = seconds

    def _give_up(self, now: float) -> None:
        """After a timeout, stop asking a terminal that never answered; others have only stalled."""
        if self._under_way and now - max(self._heard, self._under_way[-1][0]) > ANSWER_TIMEOUT_S:
            if self._ever_heard:
                self._pass(self._under_way[-1][1], ANSWER_TIMEOUT_S, with_way=False)
            self._under_way.clear()
            self._answers = self._ever_heard

    def _judge(self, now: float) -> None:
        """Go a step slower if too many frames were held back, a step faster if hardly any was.

        From the slowest step, at which panels are seldom updated, only if none was. If the link turns
        out not to carry the faster step, the next try comes twice as late.
        """
        if now - self._judged < LINK_WINDOW_S:
            return
        due, slower = self._sent + self._held, self._rung + 1
        if self._passed and self.has_images:  # else a frame is still in flight, or all is text
            mean = sum(size for size, _ in self._passed) / len(self._passed)
            fastest = min(seconds for size, seconds in self._passed if size >= mean)
            is_late = fastest > KEEPING_UP_S and self._flying > LATE_SHARE * LINK_WINDOW_S
            # After a timeout, answers to earlier frames come as if they were quick.
            self._late = self._late + 1 if is_late else max(0, self._late - 1)
        self._passed, self._flying, self._way = [], 0.0, None
        # An attempt may be held back several times before its frame goes out.
        share = self._sent / due * self._rungs[self._rung] if due else 0.0
        delivered = max(share, self._sent / (now - self._judged))
        tried, self._tried = self._tried, False
        is_calm = self._held <= (0.0 if self.strained else FEW_HELD) * due
        self._calm = self._calm + 1 if is_calm else 0
        least = self._rungs[slower] if slower < len(self._rungs) else 0.0
        least *= LEAST_GAIN if tried else 1.0
        if self._rung and self._calm >= self._patience:
            self._rung, self._tried, self._calm = self._rung - 1, True, 0
        elif not is_calm and due >= 10 and delivered < least:
            self._rung = slower
            self._patience = min(2 * self._patience, MAX_PATIENCE) if tried else 1
        elif tried:  # the link carries it
            self._patience = 1
        self._sent = self._held = 0
        self._judged = now


class FrameClock:
    """Draw frames in one task with absolute deadlines (a late Textual timer skips ticks).

    `draw` presents the changes since its last call and returns whether there were any. Without
    changes nothing is written, and the next published state gets a frame at once. The clock thereby
    falls into step with a player that makes one tick per frame.
    """

    def __init__(self, presenter: Presenter, draw: Callable[[], bool], pace: FramePacer) -> None:
        self._presenter = presenter
        self._draw = draw
        self.pace = pace
        self._alarm = asyncio.Event()
        self._task: asyncio.Task[None] | None = None
        self._loop: asyncio.AbstractEventLoop | None = None
        self._woken = -math.inf  # when the last frame was sent that was requested
        self._waits = False
        self._idle = False  # the last call of `draw` had nothing to draw
        self._expecting = -math.inf  # until this time news is shown at once

    def start(self) -> None:
        """Start drawing; call it in the event loop."""
        self._loop = asyncio.get_running_loop()
        self._task = self._loop.create_task(self._run(), name="frames")
        self._task.add_done_callback(self._ended)

    def stop(self) -> None:
        """Stop drawing."""
        if self._task is not None:
            self._task.cancel()

    def wake(self) -> None:
        """Draw as soon as possible, for example after a key press."""
        self._alarm.set()

    def expect(self) -> None:
        """Show the next published state at once, since a request was sent."""
        self._expecting = asyncio.get_running_loop().time() + EXPECTED

    def on_published(self) -> None:
        """Note that there may be something new to draw; callable from any thread."""
        if self._loop is not None and (self._idle or self._loop.time() < self._expecting):
            self._idle = False
            with contextlib.suppress(RuntimeError):  # the program has ended
                self._loop.call_soon_threadsafe(self._alarm.set)

    def answered(self, at: float) -> None:
        """Record the terminal's answer, read at a time; call it for each `events.CursorPosition`."""
        self.pace.answered(at)
        if self._waits:
            self._alarm.set()

    def figures(self) -> LinkFigures:
        """Present measurements of the link."""
        return self.pace.figures(asyncio.get_running_loop().time())

    async def _run(self) -> None:
        time = asyncio.get_running_loop().time
        deadline = time()
        while True:
            woken = await self._sleep(deadline)
            now = time()
            self.pace.obstructed = self._presenter.obstructed
            self._waits = not self.pace.ready(now, self._presenter.queued())
            if not self._waits and self._frame(now) and woken:
                self._woken = now
            interval = self.pace.interval()
            deadline = (now if woken else deadline) + interval
            late = time() - deadline
            if late > 0:  # skip frames that were missed
                deadline += math.ceil(late / interval) * interval

    async def _sleep(self, deadline: float) -> bool:
        """Sleep until the deadline, or shorter if woken; returns whether it was woken."""
        loop = asyncio.get_running_loop()
        timer = loop.call_at(deadline, self._alarm.set)
        await self._alarm.wait()
        timer.cancel()
        woken = loop.time() < deadline
        pause = self._woken + min(WOKEN, WAKE_INTERVAL_SHARE * self.pace.interval()) - loop.time()
        if woken and pause > 0:
            await asyncio.sleep(min(pause, deadline - loop.time()))
        self._alarm.clear()
        return woken

    def _frame(self, now: float) -> bool:
        with self._presenter.frame() as frame:
            if self.pace.needs_bare_question or self._draw():
                frame.acknowledged = True
        self._idle = not frame.acknowledged
        if frame.acknowledged:
            self.pace.sent(now, frame.size, frame.asked)
        return frame.acknowledged

    def _ended(self, task: asyncio.Task[None]) -> None:
        if not task.cancelled() and (error := task.exception()) is not None:
            self._presenter.fail(error)


def quiet_collector() -> None:
    """Collect garbage once, then exclude all present objects from collection.

    A full collection takes at least 90 ms, a visible stutter.
    """
    gc.collect()
    gc.freeze()
    gc.set_threshold(50_000, 20, 100)
