"""A YAML text as data with line numbers, in which the guesses of YAML 1.1 are errors.

PyYAML's own constructor reads `no` as false, `1:30` as 90 and `010` as 8, and lets a key appear
twice. Here each of these is an error with its line.
Single values are replaced from the command line: `--set fleet.robots=5`.
"""

from __future__ import annotations

import copy
import re
from collections.abc import Iterable
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, Final

import yaml
from yaml.reader import Reader

from automaton.errors import WHOLE_LIST, InputError, Keys
from automaton.printable import cleaned_document
from automaton.scenario.text_files import ListFile

MAX_NODES: Final = 100_000  # values after aliases are expanded: an alias bomb is refused unread
MAX_NESTING: Final = 40
DEEP: Final = f"nested more than {MAX_NESTING} levels deep"
LOADER: Final = getattr(yaml, "CSafeLoader", yaml.SafeLoader)
TAG: Final = "tag:yaml.org,2002:"
TEXT_TAGS: Final = (TAG + "str", TAG + "timestamp", TAG + "value", TAG + "merge")
PLAIN_WHOLE: Final = re.compile(r"[-+]?(0|[1-9][0-9]{0,30})")
PLAIN_FRACTION: Final = re.compile(r"[-+]?([0-9]+\.[0-9]*|\.[0-9]+)([eE][-+]?[0-9]+)?")
LEADING_TAB: Final = re.compile(r"^ *\t[ \t]*[^\s#]", re.MULTILINE)
CONTROL: Final = Reader.NON_PRINTABLE


@dataclass(frozen=True)
class Override:
    """One value from the command line, by `--set KEY=VALUE` or a dedicated option."""

    argument: str  # as typed: "--set fleet.robots=5"
    keys: Keys
    value: Any


@dataclass(frozen=True)
class Document:
    """The data of a scenario and its source text."""

    data: dict[str, Any]
    file: str | None = None  # as errors name it
    folder: Path = field(default_factory=Path)  # base of its relative paths
    text: str = ""
    root: yaml.Node | None = None
    overrides: tuple[Override, ...] = ()
    listed: tuple[ListFile, ...] = ()  # files from which its lists were read

    def error(self, keys: Keys, message: str) -> InputError:
        """An error about the value at `keys`, with its line or the --set that gave it."""
        for listed in self.listed:
            if keys[: len(listed.keys)] == listed.keys < keys:
                entry = keys[len(listed.keys)]
                if isinstance(listed.lines, dict) and entry not in listed.lines:
                    continue  # it was written beside the name of the file
                line = None if entry == WHOLE_LIST else int(listed.lines[entry])
                return InputError(message, listed.file, line)
        for override in reversed(self.overrides):
            shared = min(len(keys), len(override.keys))
            new = len(keys) == shared and self.node(keys) is None
            if keys[:shared] == override.keys[:shared] and (shared == len(override.keys) or new):
                return InputError(message, override.argument)
        return InputError(message, self.file, self.line(keys))

    def line(self, keys: Keys) -> int | None:
        """Line of the deepest part of `keys` that the text holds; None without text."""
        return find_node(self.root, keys)[1] if self.root is not None else None

    def node(self, keys: Keys) -> yaml.Node | None:
        """The node of the value at `keys`, or None if the text does not hold it."""
        if self.root is None:
            return None
        node, _, depth = find_node(self.root, keys)
        return node if depth == len(keys) else None


def find_node(root: yaml.Node, keys: Keys) -> tuple[yaml.Node, int, int]:
    """The deepest part of `keys` that the text holds: node, line, number of keys."""
    node, line = root, root.start_mark.line + 1
    for depth, key in enumerate(keys):
        if isinstance(node, yaml.MappingNode):
            pair = next((pair for pair in node.value if pair[0].value == str(key)), None)
            if pair is None:
                return node, line, depth
            line, node = pair[0].start_mark.line + 1, pair[1]
        elif isinstance(node, yaml.SequenceNode) and isinstance(key, int) and key < len(node.value):
            node = node.value[key]
            line = node.start_mark.line + 1
        else:
            if isinstance(node, yaml.ScalarNode) and node.style == "|" and isinstance(key, int):
                line = (
                    node.start_mark.line + 2 + key
                )  # of a block, each of whose rows has its own line
            return node, line, depth
    return node, line, len(keys)


def parse(text: str, file: str | None) -> tuple[Any, yaml.Node | None]:
    """The data of a YAML text and its root node; (None, None) for a text without content.

    Raises InputError with `file` and the line.
    """
    _refuse_unreadable(text, file)
    try:
        _refuse_unbounded(text, file)
        root = yaml.compose(text, Loader=LOADER)
    except yaml.MarkedYAMLError as error:
        raise _unparsable(error, file) from None
    except yaml.YAMLError as error:
        raise InputError(f"not valid YAML: {str(error).splitlines()[0]}", file) from None
    if root is None:
        return None, None
    _measure(root, file, {})
    return cleaned_document(_data(root, file)), root


def _refuse_unreadable(text: str, file: str | None) -> None:
    if control := CONTROL.search(text):
        line = text.count("\n", 0, control.start()) + 1
        code = f"U+{ord(control[0]):04X}"
        raise InputError(f"is not a text file (it holds the control character {code})", file, line)
    if tab := LEADING_TAB.search(text):
        line = text.count("\n", 0, tab.start()) + 1
        raise InputError("the line begins with a tab; indent with spaces", file, line)


def _refuse_unbounded(text: str, file: str | None) -> None:
    # Reading single events takes linear time and constant depth for any text.
    depth = 0
    for number, event in enumerate(yaml.parse(text, Loader=LOADER)):
        depth += isinstance(event, yaml.CollectionStartEvent)
        depth -= isinstance(event, yaml.CollectionEndEvent)
        mark: Any = event.start_mark
        line = mark.line + 1
        if depth > MAX_NESTING:
            raise InputError(DEEP, file, line)
        if number > MAX_NODES:
            raise InputError(f"holds more than {MAX_NODES:,} values", file, line)


def _unparsable(error: yaml.MarkedYAMLError, file: str | None) -> InputError:
    mark: Any = error.problem_mark or error.context_mark
    problem = str(error.problem)
    if "nesting depth" in problem:  # the libyaml of PyYAML 6.0.4 counts, too
        return InputError(DEEP, file, mark.line + 1)
    if "cannot start any token" in problem:
        problem = "a character that cannot begin a value; put the value in quotes"
    elif "mapping values are not allowed" in problem:
        problem = "this ':' or this indentation is not allowed here"
    elif "another document" in problem:
        problem = "a second document begins here; a scenario is a single one"
    elif "expected key" in problem:
        problem += (
            "; check the indentation (the first row of a picture must not begin with a blank)"
        )
    line = mark.line + 1 if mark is not None else None
    begun: Any = error.context_mark
    if begun is not None and line is not None and begun.line + 1 < line:
        problem += f" (in the value that begins in line {begun.line + 1})"
    return InputError(f"not valid YAML: {problem}", file, line)


def _measure(
    node: yaml.Node, file: str | None, sizes: dict[int, tuple[int, int]]
) -> tuple[int, int]:
    """(values, depth) of a node with its aliases expanded; each node is visited once."""
    line = node.start_mark.line + 1
    if id(node) in sizes:
        size, depth = sizes[id(node)]
        if size == 0:
            raise InputError("an alias refers to the value that it is part of", file, line)
        return size, depth
    sizes[id(node)] = (0, 0)
    size, depth = 1, 0
    for child in _children(node):
        child_size, child_depth = _measure(child, file, sizes)
        size, depth = size + child_size, max(depth, child_depth + 1)
    if size > MAX_NODES or depth > MAX_NESTING:
        raise InputError(
            f"aliases expand to more than {MAX_NODES:,} values or {MAX_NESTING} levels", file, line
        )
    sizes[id(node)] = (size, depth)
    return size, depth


def _children(node: yaml.Node) -> list[yaml.Node]:
    if isinstance(node, yaml.MappingNode):
        return [part for pair in node.value for part in pair]
    return list(node.value) if isinstance(node, yaml.SequenceNode) else []


def _data(node: yaml.Node, file: str | None) -> Any:
    if isinstance(node, yaml.ScalarNode):
        return _scalar(node, file)
    if node.tag not in (TAG + "map", TAG + "seq"):
        raise _unsupported(node, file)
    if isinstance(node, yaml.SequenceNode):
        return [_data(item, file) for item in node.value]
    lines: dict[str, int] = {}
    data: dict[str, Any] = {}
    for name, value in node.value:
        line = name.start_mark.line + 1
        if not isinstance(name, yaml.ScalarNode):
            raise InputError("a key must be a plain word, found a list or a mapping", file, line)
        # Keys are taken as typed: `no`, `~` and `1` are symbols of a legend, not values.
        if name.value in lines:
            first = lines[name.value]
            raise InputError(
                f"the key '{name.value}' appears twice (first in line {first})", file, line
            )
        lines[name.value] = line
        data[name.value] = _data(value, file)
    return data


def _scalar(node: yaml.ScalarNode, file: str | None) -> Any:
    text, tag, line = node.value, node.tag, node.start_mark.line + 1
    if tag in TEXT_TAGS:
        return text
    if tag == TAG + "null":
        return None
    if tag == TAG + "bool":
        if text in ("true", "false"):
            return text == "true"
        raise InputError(
            f"'{text}' means true or false in YAML; write true or false, or quote it: '{text}'",
            file,
            line,
        )
    if tag == TAG + "int" and PLAIN_WHOLE.fullmatch(text):
        return int(text)
    if tag == TAG + "float" and PLAIN_FRACTION.fullmatch(text):
        return float(text)
    if tag in (TAG + "int", TAG + "float"):
        shown = text if len(text) <= 40 else text[:37] + "..."
        raise InputError(
            f"YAML reads {shown} as a number in a special notation; "
            f'write a plain decimal number, or quote it: "{shown}"',
            file,
            line,
        )
    raise _unsupported(node, file)


def _unsupported(node: yaml.Node, file: str | None) -> InputError:
    tag = str(node.tag).replace(TAG, "!!")
    return InputError(f"the tag {tag} has no meaning here", file, node.start_mark.line + 1)


# Values from the command line replace those of the text.


def override(document: Document, settings: Iterable[str | Override]) -> Document:
    """The document with each KEY=VALUE applied in order; VALUE is YAML. Raises InputError."""
    overrides = tuple(
        parse_setting(setting) if isinstance(setting, str) else setting for setting in settings
    )
    if not overrides:
        return document
    data = copy.copy(document.data)
    for setting in overrides:
        _put(data, setting)
    return replace(document, data=data, overrides=document.overrides + overrides)


def parse_setting(text: str) -> Override:
    """Split "fleet.robots=5" into its keys and its typed value."""
    name, equals, value = text.partition("=")
    keys = keys_of(name)
    if not equals or "" in keys:
        raise InputError("expected KEY=VALUE such as fleet.robots=5", f"--set {text}")
    try:
        return Override(f"--set {text}", keys, parse(value, None)[0])
    except InputError as error:
        raise InputError(error.message, f"--set {text}") from None


def keys_of(name: str) -> Keys:
    """The keys of a value: "fleet.start.0" -> ("fleet", "start", 0)."""
    return tuple(int(key) if key.isdecimal() else key for key in name.strip().split("."))


def _put(data: dict[str, Any], setting: Override) -> None:
    """Set a value; its parents are copied."""
    inner: Any = data
    for depth, key in enumerate(setting.keys):
        last = depth == len(setting.keys) - 1
        if isinstance(inner, list):
            _require_index(inner, key, depth, setting)
            if last:
                inner[int(key)] = setting.value
            else:
                inner[int(key)] = inner = copy.copy(inner[int(key)])
        elif isinstance(inner, dict):
            if last:
                inner[str(key)] = setting.value
            else:
                opened = _opened(inner.get(str(key)), setting.keys[: depth + 1])
                inner[str(key)] = inner = copy.copy(opened)
        else:
            where = _dotted(setting.keys[:depth])
            raise InputError(f"{where} has no keys that can be set", setting.argument)


def _opened(value: Any, keys: Keys) -> Any:
    """The parent of a further key: a missing part is created, a strategy's name becomes {name: NAME}."""
    if value is None:
        return {}
    if isinstance(value, str) and len(keys) > 1 and keys[-2] == "strategy":
        return {"name": value}
    return value


def _require_index(items: list[Any], key: str | int, depth: int, setting: Override) -> None:
    if not isinstance(key, int) or key >= len(items):
        where = _dotted(setting.keys[:depth])
        raise InputError(
            f"{where} is a list of {len(items)}; expected a number from 0 to {len(items) - 1}, "
            f"found '{key}'",
            setting.argument,
        )


def _dotted(keys: Keys) -> str:
    return ".".join(map(str, keys))
