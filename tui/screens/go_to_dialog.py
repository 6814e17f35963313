"""Go to a tick: by number, relative to the present, as a share of the run, or by its time."""

from __future__ import annotations

import re
from fractions import Fraction

from textual.app import ComposeResult
from textual.widgets import Input, Static

from automaton.errors import InputError
from automaton.scenario.quantities import Scale, clock_text, is_clock_time
from automaton.units import Unit
from tui.playback.panel_view import View
from tui.screens.dialog import Dialog
from tui.widgets.typed_fields import TypedInput

AMOUNT = re.compile(r"([+-]?)\s*(\d[\d,]{0,17}(?:\.\d+)?)\s*(%|[^\W\d]\w*)?")


def tick_of(text: str, now: int, head: int, end: int | None, scale: Scale) -> int:
    """The tick that a text means, be it after the end; `head` is the last so far. Raises InputError."""
    if is_clock_time(text.strip()):
        return scale.tick_at(text.strip())
    of = scale.unit
    found = AMOUNT.fullmatch(text.strip())
    if found is None:
        raise InputError(f"'{text.strip()}' is not a tick; expected {examples(scale)}")
    sign, amount, name = found[1], float(found[2].replace(",", "")), found[3] or "ticks"
    ticks = round(_ticks(amount, name, head if end is None else end, of))
    if sign:
        return max(0, now + (ticks if sign == "+" else -ticks))
    return ticks


def _ticks(amount: float, name: str, last: int, of: Unit) -> float:
    if name == "%":
        if amount > 100:
            raise InputError(f"{amount:g} % lies after the end; a run goes from 0 % to 100 %")
        return last * amount / 100
    if name in ("tick", "ticks"):
        return amount
    if name in (of.name, of.plural):
        return amount / of.size
    known = "ticks" if of.name == "tick" else f"ticks or {of.plural}"
    raise InputError(f"there is no unit '{name}' here; time is counted in {known}")


def examples(scale: Scale) -> str:
    """What can be written."""
    of = scale.unit
    time = "" if scale.clock is None else f", {clock_text(scale.clock, Fraction(3600))}"
    timed = "" if of.name == "tick" else f", {30 * of.size:g} {of.plural}"
    return f"1200, +100, -50, 50 %{timed}{time}"


class GoToScreen(Dialog[int]):
    """The result is a tick of the run."""

    HEADING = "Go to tick"
    ACCEPT = "Go there"

    def __init__(self, view: View) -> None:
        super().__init__()
        self._view = view
        self._scale = view.run.resolved.scenario.units.scale

    def inside(self) -> ComposeResult:
        playback = self._view.playback
        last = (
            f"ends at {playback.end:,}"
            if playback.end is not None
            else f"has come to {playback.head:,}"
        )
        yield TypedInput(placeholder=examples(self._scale), compact=True)
        yield Static(
            f"now {playback.tick:,}; the run {last}; write {examples(self._scale)}",
            classes="hint",
            markup=False,
        )

    def on_input_changed(self) -> None:
        self.complain("")

    def on_input_submitted(self) -> None:
        self.accept()

    def accept(self) -> None:
        """Close with the tick."""
        playback = self._view.playback
        text = self.query_one(Input).value
        try:
            tick = tick_of(text, playback.tick, playback.head, playback.end, self._scale)
        except InputError as error:
            self.complain(str(error))
            return
        self.dismiss(tick)
