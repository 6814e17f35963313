"""When the next picture goes out: a clock that does not drift, held back by what the terminal answers.

frame + ESC[6n  ->  link  ->  terminal
     ^                           |       at most two frames are under way at any time,
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

SLOWER = (30, 15, 10)  # frames a second to which a slow link is taken down, step by step
BLURRED = 0.5  # seconds between frames while the terminal's window is not the active one
OBSTRUCTED = 0.1  # seconds between frames while the compositor has to repaint whole rows
WOKEN = 1 / 60  # seconds between frames that keys and the mouse ask for,
# and at most this share of the usual time between two: one that was late is made up for
WAKE_INTERVAL_SHARE = 0.6
EXPECTED = 0.05  # seconds within which the effect of a request is shown at once
ANSWER_TIMEOUT_S = 2.0  # seconds without an answer after which frames under way count as lost
LONG_WAY = 0.150  # seconds there and back from which one frame under way is enough
SHORT_WAY = 0.02  # seconds there and back up to which a large frame is through at once
# bytes of a frame from which one frame under way is enough on a longer way
LARGE_FRAME_BYTES = 8192
QUEUED = 2  # writes that may wait in Textual's writer thread: its queue blocks the program at 30
LINK_WINDOW_S = 2.0  # seconds over which the link is judged


@dataclass(frozen=True)
class LinkFigures:
    """What the link carries, for the status line."""

    round_trip: float  # seconds from a frame to its answer; NaN before the first answer
    kilobytes: float  # of the map in a second
    fps: float  # frames that went out in a second
    allowed: int  # frames a second that the link is trusted with
    answers: bool  # False: this terminal does not answer, frames go by time alone


class FramePacer:
    """Says when a frame may go; knows nothing of asyncio or Textual, times are arguments."""

    def __init__(self, fps: int = 30, max_kbit: float | None = None) -> None:
        self._rungs = (fps, *(slower for slower in SLOWER if slower < fps))
        self._rung = 0
        self._rate = max_kbit * 125.0 if max_kbit else math.inf  # bytes a second
        self._credit = 0.0
        self._credited = 0.0
        self._under_way: deque[float] = deque()
        self._heard = 0.0
        self._ever_heard = False
        self._answers = True
        self._round_trip = math.nan
        self._last_size = 0
        self._history: deque[tuple[float, int]] = deque()
        self._sent = self._held = 0
        self._judged = 0.0
        self.blurred = False
        self.obstructed = False
        self.skipped = 0

    @property
    def strained(self) -> bool:
        """The link is at its slowest step: panels should update once a second."""
        return len(self._rungs) > 1 and self._rung == len(self._rungs) - 1

    def interval(self) -> float:
        """Seconds between two frames at present."""
        usual = 1 / self._rungs[self._rung]
        return max(usual, BLURRED if self.blurred else 0.0, OBSTRUCTED if self.obstructed else 0.0)

    def ready(self, now: float, queued: int) -> bool:
        """Whether a frame may go now; `queued` writes still wait in this process."""
        self._give_up(now)
        self._judge(now)
        if self._rate < math.inf:
            earned = self._credit + (now - self._credited) * self._rate
            self._credit = min(earned, self._rate / 4)  # a quarter of a second may come at once
            self._credited = now
        free = queued <= QUEUED and len(self._under_way) < self._window() and self._credit >= 0
        if not free:
            self._held += 1
            self.skipped += 1
        return free

    def sent(self, now: float, size: int, asked: bool = True) -> None:
        """A frame of so many bytes went out; asked: with a question behind it."""
        if asked and self._answers:
            self._under_way.append(now)
        self._last_size = size
        self._credit -= size if self._rate < math.inf else 0
        self._history.append((now, size))
        self._sent += 1

    def answered(self, now: float) -> None:
        """The terminal answered: what was sent before its oldest question is on the screen."""
        self._heard = now
        self._ever_heard = self._answers = True
        if self._under_way:
            sample = now - self._under_way.popleft()
            known = not math.isnan(self._round_trip)
            self._round_trip += (sample - self._round_trip) / 4 if known else 0.0
            self._round_trip = self._round_trip if known else sample

    def figures(self, now: float) -> LinkFigures:
        """The last two seconds."""
        while self._history and self._history[0][0] < now - LINK_WINDOW_S:
            self._history.popleft()
        return LinkFigures(
            self._round_trip,
            sum(size for _, size in self._history) / LINK_WINDOW_S / 1000,
            len(self._history) / LINK_WINDOW_S,
            self._rungs[self._rung],
            self._answers,
        )

    def _window(self) -> float:
        if not self._answers:
            return math.inf
        # NaN: not known yet
        large = self._last_size > LARGE_FRAME_BYTES and not self._round_trip <= SHORT_WAY
        return 1 if self._round_trip > LONG_WAY or large else 2

    def _give_up(self, now: float) -> None:
        """A terminal that never answered is not asked to; one that did has only stalled."""
        if self._under_way and now - max(self._heard, self._under_way[-1]) > ANSWER_TIMEOUT_S:
            self._under_way.clear()
            self._answers = self._ever_heard

    def _judge(self, now: float) -> None:
        """Too many frames held back: a step slower; none held back: a step faster."""
        if now - self._judged < LINK_WINDOW_S:
            return
        due, slower = self._sent + self._held, self._rung + 1
        if not self._held:
            self._rung = max(0, self._rung - 1)
        elif due >= 10 and slower < len(self._rungs):
            delivered = self._sent / due * self._rungs[self._rung]
            self._rung = slower if delivered < self._rungs[slower] else self._rung
        self._sent = self._held = 0
        self._judged = now


class FrameClock:
    """One task with absolute deadlines (a Textual timer skips ticks when it is late).

    `draw` presents what has changed since it was last called and says whether anything had;
    if nothing had, not a byte is written, and news get a frame as soon as they are published. So the
    clock falls into step with a player that makes a tick for each frame.
    """

    def __init__(self, presenter: Presenter, draw: Callable[[], bool], pace: FramePacer) -> None:
        self._presenter = presenter
        self._draw = draw
        self.pace = pace
        self._alarm = asyncio.Event()
        self._task: asyncio.Task[None] | None = None
        self._loop: asyncio.AbstractEventLoop | None = None
        self._last = -math.inf
        self._waits = False
        self._idle = False  # there was nothing to draw
        self._expecting = -math.inf  # until when news are shown at once

    def start(self) -> None:
        """Begin; from the event loop."""
        self._loop = asyncio.get_running_loop()
        self._task = self._loop.create_task(self._run(), name="frames")
        self._task.add_done_callback(self._ended)

    def stop(self) -> None:
        """No frame from here on."""
        if self._task is not None:
            self._task.cancel()

    def wake(self) -> None:
        """A frame as soon as possible: a key was pressed, a robot has moved after a long rest."""
        self._alarm.set()

    def expect(self) -> None:
        """A request was sent: what is published next is to be shown at once."""
        self._expecting = asyncio.get_running_loop().time() + EXPECTED

    def on_published(self) -> None:
        """There may be something new to draw; from any thread."""
        if self._loop is not None and (self._idle or self._loop.time() < self._expecting):
            self._idle = False
            with contextlib.suppress(RuntimeError):  # the program has just ended
                self._loop.call_soon_threadsafe(self._alarm.set)

    def answered(self) -> None:
        """To be called for each `events.CursorPosition`."""
        self.pace.answered(asyncio.get_running_loop().time())
        if self._waits:
            self._alarm.set()

    def figures(self) -> LinkFigures:
        """What the link carries at present."""
        return self.pace.figures(asyncio.get_running_loop().time())

    async def _run(self) -> None:
        time = asyncio.get_running_loop().time
        deadline = time()
        while True:
            woken = await self._sleep(deadline)
            now = time()
            self.pace.obstructed = self._presenter.obstructed
            self._waits = not self.pace.ready(now, self._presenter.queued())
            if not self._waits:
                self._frame(now)
            interval = self.pace.interval()
            deadline = (now if woken else deadline) + interval
            late = time() - deadline
            if late > 0:  # frames that were missed are not made up for
                deadline += math.ceil(late / interval) * interval

    async def _sleep(self, deadline: float) -> bool:
        """Until the deadline, or shortly if woken; True if woken."""
        loop = asyncio.get_running_loop()
        timer = loop.call_at(deadline, self._alarm.set)
        await self._alarm.wait()
        timer.cancel()
        woken = loop.time() < deadline
        pause = self._last + min(WOKEN, WAKE_INTERVAL_SHARE * self.pace.interval()) - loop.time()
        if woken and pause > 0:
            await asyncio.sleep(min(pause, deadline - loop.time()))
        self._alarm.clear()
        return woken

    def _frame(self, now: float) -> None:
        with self._presenter.frame() as frame:
            if self._draw():
                frame.acknowledged = True
        self._idle = not frame.acknowledged
        if frame.acknowledged:
            self._last = now
            self.pace.sent(now, frame.size, frame.asked)

    def _ended(self, task: asyncio.Task[None]) -> None:
        if not task.cancelled() and (error := task.exception()) is not None:
            self._presenter.fail(error)


def quiet_collector() -> None:
    """Collect once, then leave what has been made so far alone; 1.5 s after the start.

    A full collection takes 90 ms and more, which is a visible stutter.
    """
    gc.collect()
    gc.freeze()
    gc.set_threshold(50_000, 20, 100)
