"""Facts as English: one table of phrases, used in both directions.

A phrase is a template such as "turns for {busy} more tick(s)" and the values that it fixes. It is
written when its fixed values hold and none of its named values is the default; read, it gives back
both. What has its default value is not mentioned.
"""

from __future__ import annotations

import re
from collections.abc import Iterable

from automaton.engine.robot_states import BATTERY_PERCENT
from automaton.errors import InputError

Pair = tuple[int, int]
Value = int | Pair | None  # a number, or a cell (x, y), or no cell
Facts = dict[str, Value]

CELLS = {
    "claim",
    "goal_cell",
    "slot",
    "place",
    "current_slot",
    "target",
}  # the named values that are cells
PERCENT_FIELDS = {
    "charge",
    "charge_target",
}  # the named values that are shares of a full battery, in percent
PLACEHOLDER = re.compile(r"\{(\w+)\}")
BETWEEN_FACTS = re.compile(r", (?![^(]*\))")  # a comma, but not the one inside of (x, y)


class Phrase:
    """One way to say something, and what it says."""

    def __init__(self, template: str, **fixed: Value) -> None:
        self.template = template
        self.fixed = fixed
        self.named = PLACEHOLDER.findall(template)
        self.pattern = re.compile(_pattern(template))

    def write(self, facts: Facts, default: Facts) -> str | None:
        """The phrase with the values of `facts`, None if it does not apply."""
        if any(facts[name] != value for name, value in self.fixed.items()):
            return None
        if any(facts[name] == default[name] for name in self.named):
            return None
        if all(facts[name] == default[name] for name in (*self.fixed, *self.named)):
            return None
        text = self.template
        for name in self.named:
            value = facts[name]
            text = text.replace(
                f"{{{name}}}", percents(value) if name in PERCENT_FIELDS else str(value)
            )
            text = text.replace("(s)", "" if value == 1 else "s") if name not in CELLS else text
        return text

    def read(self, text: str) -> Facts | None:
        """The values that a text in the words of this phrase gives, None if it has other words."""
        match = self.pattern.fullmatch(text)
        if match is None:
            return None
        said: Facts = dict(self.fixed)
        for name, value in match.groupdict().items():
            if name in PERCENT_FIELDS:
                said[name] = round(float(value) * BATTERY_PERCENT)
            else:
                said[name] = pair(value) if name in CELLS else int(value)
        return said


def percents(value: Value) -> str:
    """A share of a full battery, in percent, with all its digits."""
    assert isinstance(value, int)
    return f"{value / BATTERY_PERCENT:.7f}".rstrip("0").rstrip(".")


def _pattern(template: str) -> str:
    pattern = re.escape(template).replace(r"\(s\)", "s?")
    for name in PLACEHOLDER.findall(template):
        value = r"\(-?\d+, -?\d+\)" if name in CELLS else r"-?\d+"
        value = r"\d+(?:\.\d+)?" if name in PERCENT_FIELDS else value
        pattern = pattern.replace(rf"\{{{name}\}}", f"(?P<{name}>{value})")
    return pattern


def pair(text: str) -> Pair:
    """(x, y) as numbers."""
    x, y = re.findall(r"-?\d+", text)
    return int(x), int(y)


def write_facts(groups: Iterable[Iterable[Phrase]], facts: Facts, default: Facts) -> list[str]:
    """Of each group the first phrase that applies."""
    written = []
    for group in groups:
        said = (phrase.write(facts, default) for phrase in group)
        text = next((one for one in said if one is not None), None)
        if text is not None:
            written.append(text)
    return written


def read_facts(groups: Iterable[Iterable[Phrase]], text: str, subject: str) -> Facts:
    """The values that comma-separated facts give. Raises InputError for unknown words."""
    phrases = [phrase for group in groups for phrase in group]
    facts: Facts = {}
    for one in BETWEEN_FACTS.split(text) if text else ():
        said = next((found for phrase in phrases if (found := phrase.read(one)) is not None), None)
        if said is None:
            raise InputError(f"'{one}' says nothing that is known about {subject}")
        facts.update(said)
    return facts


def write_route(steps: Iterable[int], at: int) -> str:
    """Directions as letters, small ones for steps already driven; more than 3 alike are counted.

    eeSSE   two steps east are driven, south, south and east are to come
    12eS    12 steps east are driven
    """
    letters = "".join("ESWN"[step] for step in steps)
    letters = letters[:at].lower() + letters[at:]
    return re.sub(r"(.)\1{3,}", lambda run: f"{len(run[0])}{run[1]}", letters)


def read_route(text: str) -> tuple[list[int], int]:
    """Directions of a route and how many of them are driven. Raises InputError."""
    if not re.fullmatch(r"(\d*[eswn])*(\d*[ESWN])*", text):
        raise InputError(
            f"'{text}' is not a route; small letters eswn are driven, ESWN are to come"
        )
    runs = re.findall(r"(\d*)([eswnESWN])", text)
    letters = "".join(letter * int(count or 1) for count, letter in runs)
    return ["ESWN".index(letter) for letter in letters.upper()], sum(map(str.islower, letters))
