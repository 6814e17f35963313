"""Outputs of the league's first round, 2023, with the keys of those of 2024.

Tasks had one cell each and were dealt out in turn. `tasks` is [task, row, column], numbered as they
were given to robots; `events` has for each robot [task, tick, "assigned" or "finished"]. There is
neither `version` nor `actualSchedule`.
"""

from __future__ import annotations

from typing import Any, Final

import msgspec

from automaton.errors import InputError
from automaton.scenario.document import Document
from automaton.scenario.validation import shown, validated

VERSION_2023: Final = "2023 LoRR"
ASSIGNED, FINISHED = "assigned", "finished"


class Parts2023(msgspec.Struct, rename="camel"):
    """The keys that mean something else than in 2024."""

    team_size: int
    events: list[list[tuple[int, int, str]]]
    tasks: list[tuple[int, int, int]]


def is_of_2023(data: dict[str, Any]) -> bool:
    """Whether an output is of 2023: events come robot by robot."""
    events = data.get("events")
    if data.keys() & {"version", "actualSchedule"} or not isinstance(events, list):
        return False
    return any(isinstance(one, list) and one and isinstance(one[0], list) for one in events)


def as_of_2024(data: dict[str, Any], file: str) -> dict[str, Any]:
    """Return the output with the keys of 2024; the j-th task of robot r of n becomes task j n + r.

    Raises InputError.
    """
    said = validated(Document(data={}, file=file), data, Parts2023)
    n = said.team_size
    if len(said.events) != n:
        raise InputError(f"events has {len(said.events):,} entries, teamSize is {n:,}", file)
    places = {task: [row, column] for task, row, column in said.tasks}
    number: dict[int, int] = {}  # by task
    events, tasks = [], []
    for robot, entries in enumerate(said.events):
        following = robot
        for task, tick, what in entries:
            if what == ASSIGNED and task in places and task not in number:
                number[task] = following
                tasks.append([following, tick, places[task]])
                following += n
            elif what == FINISHED and task in number:
                events.append([tick, robot, number[task], 1])
            else:
                text = f"events[{robot}] has {shown([task, tick, what])}: tasks are assigned once"
                raise InputError(f"{text} and then finished", file)
    return {
        **data,
        "version": VERSION_2023,
        "actualSchedule": [""] * n,
        "events": events,
        "tasks": tasks,
    }
