"""Explain why a robot waits at a tick of a recording: the chain of causes, and the time lost so far.

Exit code 0: explained; 2: bad input, such as a robot or a tick that the recording does not have.
"""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import TYPE_CHECKING, Any

from automaton.commands.arguments import (
    add_json_argument,
    add_recording_argument,
    print_document,
    print_json,
    tick_or_time,
    whole,
)
from automaton.documents.report_document import INDENT, Block, Listed, ReportDocument, Table
from automaton.errors import InputError
from automaton.recording.recording_reader import read_recording
from automaton.units import count, percent

if TYPE_CHECKING:
    from automaton.history.explanation import Explanation
    from automaton.history.snapshot import Snapshot
    from automaton.history.watched_run import ReplayedRun
    from automaton.scenario.quantities import Scale


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """The arguments of `automaton explain`."""
    add = parser.add_argument
    add_recording_argument(parser)
    text = "explain this robot; the first is 0"
    add("--robot", type=whole("a robot", 0), required=True, metavar="R", help=text)
    text = "explain this tick, or this clock time"
    add("--at", type=tick_or_time, required=True, metavar="T", help=text)
    add_json_argument(parser)


def run(args: argparse.Namespace) -> int:
    """Play the recording up to the tick, and explain the wait."""
    recording = read_recording(args.file)
    robots = recording.header["scenario"]["fleet"]["robots"]
    if args.robot >= robots:
        there = "only robot 0" if robots == 1 else f"robots 0 to {robots - 1}"
        raise InputError(f"there is no robot {args.robot}: it has {there}", str(args.file))
    if isinstance(args.at, int):
        check_tick(args.file, args.at, recording.ticks)
    from automaton.history.explanation import explain
    from automaton.history.snapshot import take_snapshot
    from automaton.history.state_words import detour_words
    from automaton.history.watched_run import ReplayedRun

    recorded = ReplayedRun(recording)
    if isinstance(args.at, str):
        args.at = tick_at(args.file, recorded, args.at)
        check_tick(args.file, args.at, recording.ticks)
    shown = shown_at(recorded, args.at)
    snapshot = take_snapshot(shown.shown, args.robot)
    found = explain(snapshot, shown.floor_plan, args.robot)
    if args.json:
        print_json(as_json(args, found, snapshot))
        return 0

    name, seed = recording.header["scenario"]["name"], recording.header["seed"]
    title = f"{name}, seed {seed}, tick {args.at:,} of {recording.ticks:,}"
    due = due_lines(snapshot, args.robot, shown.resolved.scenario.units.scale)
    said = [text for text in (detour_words(snapshot, args.robot), *due) if text]
    blocks = [*chain_blocks(title, found), *lost_blocks(said, snapshot, args.robot)]
    print_document(ReportDocument(title, blocks))
    return 0


def check_tick(file: Path, at: int, last: int) -> None:
    """Raise InputError for a tick that a recording does not have."""
    if at > last:
        raise InputError(f"there is no tick {at}: it has ticks 0 to {last}", str(file))


def tick_at(file: Path, recorded: ReplayedRun, time: str) -> int:
    try:
        return recorded.resolved.scenario.units.scale.tick_at(time)
    except InputError as error:
        raise InputError(str(error), str(file)) from None


def shown_at(recorded: ReplayedRun, at: int) -> ReplayedRun:
    """Play the run up to this tick."""
    while recorded.tick < at:
        recorded.show(at, 1.0)
    return recorded


def chain_blocks(title: str, found: Explanation) -> list[Block]:
    """A sentence for each robot of the chain, with its rule, and the wait cycle if there is one."""
    lines, blocks = [title, *([found.cycle_line] if found.down else [])], list[Block]()
    for link in found.chain:
        alone = len(found.chain) == 1 and not link.cause
        lines.append(f"{link.text}: it does not wait" if alone else link.text)
        if link.rule:
            rule = f"rule: {link.rule.removeprefix('rule of ')}"
            blocks += [Listed(lines, mark=""), Listed([rule], mark=INDENT)]
            lines = []
    lines += [found.cycle_line] if found.cycle_line and not found.down else []
    lines += found.obstacles
    return [*blocks, *([Listed(lines, mark="")] if lines else [])]


def due_lines(snapshot: Snapshot, robot: int, scale: Scale) -> list[str]:
    """When the robot's order is due, and how late it is; [] without a due time."""
    from automaton.engine.state import NIL
    from automaton.history.state_words import due_words, has_due_time, has_trips

    order = int(snapshot.robots.order[robot])
    if order == NIL or not has_due_time(snapshot.orders, order):
        return []
    what = "trip" if has_trips(snapshot) else "order"
    return [due_words(snapshot.orders, order, snapshot.tick, scale, what)]


def lost_by_cause(snapshot: Snapshot, robot: int) -> list[tuple[int, int]]:
    """(cause, ticks lost to it so far), largest first; time without an order is not lost but idle."""
    from automaton.engine.observation import CAUSE_NO_ORDER, CAUSE_NOT_WAITING

    lost = snapshot.robots.lost[robot].tolist()
    found = [
        (cause, ticks)
        for cause, ticks in enumerate(lost)
        if ticks and cause not in (CAUSE_NOT_WAITING, CAUSE_NO_ORDER)
    ]
    return sorted(found, key=lambda pair: -pair[1])


def lost_blocks(said: list[str], snapshot: Snapshot, robot: int) -> list[Block]:
    """Other sentences about the robot, and its lost time so far, by cause."""
    from automaton.engine.observation import CAUSES

    lost, ticks = lost_by_cause(snapshot, robot), max(1, snapshot.tick)
    if not lost:
        return [Listed([*said, "no time lost so far"], mark="")]
    total = sum(taken for _, taken in lost)
    share = f"time lost so far: {percent(total / ticks, 0)} of {count(ticks, 'tick')}"
    rows = [
        [CAUSES[cause].name, f"{taken:,}", percent(taken / ticks, 0), CAUSES[cause].meaning]
        for cause, taken in lost
    ]
    table = Table(("lost time", "ticks", "share", "cause"), rows, also_left=(3,))
    return [Listed([*said, share], mark=""), table]


def as_json(args: argparse.Namespace, found: Explanation, snapshot: Snapshot) -> dict[str, Any]:
    """The explanation as one object; times are in ticks."""
    from automaton.engine.observation import CAUSES
    from automaton.engine.state import NIL
    from automaton.history.state_words import has_due_time, has_trips, ticks_late

    order = int(snapshot.robots.order[args.robot])
    is_due = order != NIL and has_due_time(snapshot.orders, order)
    is_trip = has_trips(snapshot)
    links = [
        {**link._asdict(), "blocker": None if link.blocker == NIL else link.blocker}
        for link in found.chain
    ]
    return {
        "file": str(args.file),
        "robot": args.robot,
        "tick": args.at,
        "order": None if order == NIL or is_trip else order,
        "trip": order if order != NIL and is_trip else None,
        "due": int(snapshot.orders.due[order]) if is_due else None,
        "late": max(0, ticks_late(snapshot.orders, order, snapshot.tick)) if is_due else None,
        "detour": snapshot.detour,
        "waits": bool(found.chain[0].cause),
        "chain": links,
        "wait_cycle": []
        if found.cycle == NIL
        else [link.robot for link in found.chain[found.cycle :]],
        "down_in_cycle": list(found.down),
        "obstacles": list(found.obstacles),
        "lost": {CAUSES[cause].name: taken for cause, taken in lost_by_cause(snapshot, args.robot)},
        "lines": found.lines,
    }
