"""Named changes of a scenario, as in the points of a study or in a file of their own.

    - {name: today}                                    the scenario as it is
    - {name: one more robot, set: {fleet.robots: 4}}   some keys changed

`read_changes` reads a file with such a list, `checked_changes` checks a list in any document. Both
refuse unknown keys and equal names; `sweep_plan.resolve_changes` refuses a change without effect.
"""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Annotated, Any, Final, NamedTuple

import msgspec
import yaml
from msgspec import Meta

from automaton.errors import InputError, InvalidValueError, Keys, nearest
from automaton.scenario.document import Document, Override, keys_of, parse
from automaton.scenario.schema import ConfigSection, Scenario, SingleLine
from automaton.scenario.text_files import read_text
from automaton.scenario.validation import shown, validated

Levels = dict[str, Any]  # key of a scenario, such as "fleet.robots" -> its value
FIXED_KEYS: Final = ("name", "summary", "seed")  # keys of a scenario that no run depends on
ENTRY_EXAMPLE: Final = "{name: one more robot, set: {fleet.robots: 4}}"
BASE_NAMES: Final = ("today", "as it is")  # of the scenario as it is, if no entry names it
LIST_KEYS: Final = ("points",)  # of the entries in the document of a file of changes


class NamedPoint(ConfigSection, frozen=True, kw_only=True):
    """A point with a name: a scenario with some settings changed."""

    name: Annotated[
        SingleLine,
        Meta(description="Name of the point in tables, charts and rows; each name once."),
    ]
    settings: Annotated[
        Levels | None,
        Meta(
            description="Settings that differ from the scenario, {KEY: VALUE, ...}; without "
            "`set`, the scenario runs unchanged."
        ),
    ] = msgspec.field(name="set", default=None)


class NamedChange(NamedTuple):
    """A checked entry of a list of changes."""

    name: str
    settings: Levels | None  # None: the scenario as it is
    place: tuple[str | None, int | None]  # file and line of `set`, or of the entry
    overrides: tuple[Override, ...]  # the settings, each with its file and line


def is_named(entry: Any) -> bool:
    """Whether an entry of a list of points has the form {name: ..., set: ...}."""
    return isinstance(entry, dict) and ("name" in entry or "set" in entry)


def check_key(key: str) -> str | None:
    """Why a key is not a key of a scenario that can be changed; None if it is."""
    if "" in key.split("."):
        return f"'{key}' is not a key of a scenario, such as fleet.robots"
    names, first = Scenario.__struct_fields__, key.split(".")[0]
    if first not in names:
        return f"unknown key '{first}'{nearest(first, names)}; allowed: {', '.join(names)}"
    return None


def check_settings(document: Document, where: Keys, settings: Levels) -> None:
    """Raise InputError for a key at `where` that cannot be set."""
    for key in settings:
        objection = check_key(key)
        if objection is None and key in FIXED_KEYS:
            why = "all points have the same seeds" if key == "seed" else "it does not change runs"
            objection = f"{key} cannot be set here: {why}"
        if objection:
            raise document.error((*where, key), objection)


def checked_changes(
    document: Document, entries: Sequence[Any], where: Keys = LIST_KEYS
) -> tuple[NamedChange, ...]:
    """The changes in the list of a document at the keys `where`. Raises InputError with the line."""
    first: dict[str, int] = {}
    changes = []
    for number, entry in enumerate(entries):
        change = _checked(document, (*where, number), entry)
        same = first.setdefault(change.name, number)
        if same != number:
            line = document.line((*where, same, "name"))
            earlier = f" (first in line {line})" if line is not None else ""
            text = f"the name '{change.name}' appears twice{earlier}"
            raise document.error((*where, number, "name"), text)
        changes.append(change)
    return tuple(changes)


def _checked(document: Document, keys: Keys, entry: Any) -> NamedChange:
    if not is_named(entry):
        content = shown(entry)
        if isinstance(entry, dict):
            content = f"the keys {', '.join(entry)}" if entry else "no keys"
        text = f"an entry has a name and the settings to change, such as {ENTRY_EXAMPLE}; found {content}"
        raise document.error(keys, text)
    if "name" not in entry:
        text = f"this entry has no name; write it as in {ENTRY_EXAMPLE}"
        raise document.error(keys, text)
    try:
        point = validated(entry, NamedPoint)
    except InvalidValueError as error:
        raise document.error((*keys, *error.keys), error.message) from None
    settings = point.settings or {}
    check_settings(document, (*keys, "set"), settings)
    overrides = tuple(
        Override(place_of(document, (*keys, "set", key)), keys_of(key), value)
        for key, value in settings.items()
    )
    place = (document.file, document.line((*keys, "set")))
    return NamedChange(point.name, point.settings, place, overrides)


def place_of(document: Document, keys: Keys) -> str:
    """The place of a value for errors: "FILE:LINE", or its keys if the document has no text."""
    if document.root is None:
        return ".".join(map(str, keys))
    return f"{document.file}:{document.line(keys)}"


def read_changes(file: str | Path) -> tuple[NamedChange, ...]:
    """The changes that a file lists. Raises InputError with file and line."""
    document = changes_document(file)
    return checked_changes(document, document.data[LIST_KEYS[0]])


def changes_document(file: str | Path) -> Document:
    """The unchecked list of changes in a file, at the key `points` as in a study. Raises InputError."""
    name = str(file)
    if os.path.isdir(file):
        raise InputError("is a folder, not a file with a list of changes", name)
    if not os.path.exists(file):
        raise InputError("no such file", name)
    text = read_text(Path(file))
    entries, root = parse(text, name)
    if not entries or root is None:
        raise InputError(f"is empty; list the changes, such as - {ENTRY_EXAMPLE}", name)
    if not isinstance(entries, list):
        text = f"must be a list of changes, such as - {ENTRY_EXAMPLE}; found {shown(entries)}"
        raise InputError(text, name, root.start_mark.line + 1)
    return Document({LIST_KEYS[0]: entries}, file=name, root=under(LIST_KEYS[0], root))


def what_if_study(
    file: str | Path, study: Mapping[str, Any], overrides: Sequence[Override] = ()
) -> Document:
    """A study of the changes in a file against the scenario as it is, its first point if none is.

    `study`: all other keys; `overrides`: the arguments that gave some of them. Raises InputError.
    """
    document = changes_document(file)
    entries = document.data[LIST_KEYS[0]]
    changes = checked_changes(document, entries)
    names = [change.name for change in changes]
    base = next((change.name for change in changes if change.settings is None), None)
    if all(change.settings is None for change in changes):
        raise document.error((*LIST_KEYS, 0), "no entry has `set`, so there is nothing to compare")
    root = document.root
    if base is None:
        base = next((name for name in BASE_NAMES if name not in names), BASE_NAMES[-1])
        entries, root = [{"name": base}, *entries], with_first(root)
    analysis = {**study.get("analysis", {}), "baseline": base}
    data = {**study, LIST_KEYS[0]: entries, "analysis": analysis}
    return replace(document, data=data, root=root, overrides=tuple(overrides))


def with_first(root: Any) -> yaml.Node:
    """A document of changes with an empty entry before the others, which keep their lines."""
    (name, entries), start = root.value[0], root.start_mark
    empty = yaml.MappingNode("tag:yaml.org,2002:map", [], start, start)
    longer = yaml.SequenceNode(entries.tag, [empty, *entries.value], start, entries.end_mark)
    return yaml.MappingNode(root.tag, [(name, longer)], start, root.end_mark)


def under(key: str, node: yaml.Node) -> yaml.Node:
    """A mapping with this node at a key, so that errors in a study made from it have its lines."""
    tags = "tag:yaml.org,2002:map", "tag:yaml.org,2002:str"
    name = yaml.ScalarNode(tags[1], key, node.start_mark, node.start_mark)
    return yaml.MappingNode(tags[0], [(name, node)], node.start_mark, node.end_mark)
