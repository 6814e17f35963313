"""A YAML text as data that remembers its lines, and that refuses what YAML 1.1 would guess.

PyYAML's own constructor reads `no` as false, `1:30` as 90 and `010` as 8, and lets a key appear
twice. Here each of these is an error with its line, so that nothing in a scenario is a surprise.
Single values are replaced from the command line: `--set fleet.robots=5`.
"""

from __future__ import annotations

import copy
import hashlib
import os
import re
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, Final, NamedTuple

import yaml
from yaml.reader import Reader

from automaton.errors import InputError, nearest
from automaton.printable import cleaned_document
from automaton.units import count

Keys = tuple[str | int, ...]  # the way to a value: ("fleet", "start", 0)

MAX_NODES: Final = 100_000  # values after aliases are expanded: a bomb of aliases is refused unread
MAX_DEPTH: Final = 40
DEEP: Final = f"nested more than {MAX_DEPTH} levels deep"
LOADER: Final = getattr(yaml, "CSafeLoader", yaml.SafeLoader)
TAG: Final = "tag:yaml.org,2002:"
TEXT_TAGS: Final = (TAG + "str", TAG + "timestamp", TAG + "value", TAG + "merge")
WHOLE: Final = re.compile(r"[-+]?(0|[1-9][0-9]{0,30})")
FRACTION: Final = re.compile(r"[-+]?([0-9]+\.[0-9]*|\.[0-9]+)([eE][-+]?[0-9]+)?")
LEADING_TAB: Final = re.compile(r"^ *\t[ \t]*[^\s#]", re.MULTILINE)
CONTROL: Final = Reader.NON_PRINTABLE


@dataclass(frozen=True)
class Override:
    """One value given on the command line, by `--set KEY=VALUE` or an option of its own."""

    argument: str  # as typed: "--set fleet.robots=5"
    keys: Keys
    value: Any


class ListFile(NamedTuple):
    """A file whose lines became the entries of a list or a mapping of a scenario."""

    keys: Keys  # the way to that list
    file: str  # as errors name it
    lines: Any  # where each entry stands, from 1: of a list by its index, of a mapping by its key


@dataclass(frozen=True)
class Document:
    """The data of a scenario with the text that it comes from."""

    data: dict[str, Any]
    file: str | None = None  # as errors name it
    folder: Path = field(default_factory=Path)  # what relative paths in it refer to
    text: str = ""
    root: yaml.Node | None = None
    overrides: tuple[Override, ...] = ()
    listed: tuple[ListFile, ...] = ()  # files that lists of it come from

    def error(self, keys: Keys, message: str) -> InputError:
        """An error about the value at `keys`: placed at its line, or at the --set that gave it."""
        for listed in self.listed:
            if keys[: len(listed.keys)] == listed.keys < keys:
                line = int(listed.lines[keys[len(listed.keys)]])
                return InputError(message, listed.file, line)
        for override in reversed(self.overrides):
            shared = min(len(keys), len(override.keys))
            new = len(keys) == shared and self.node(keys) is None
            if keys[:shared] == override.keys[:shared] and (shared == len(override.keys) or new):
                return InputError(message, override.argument)
        return InputError(message, self.file, self.line(keys))

    def line(self, keys: Keys) -> int | None:
        """Line of the deepest part of the way to `keys` that the text holds; None without text."""
        return find_node(self.root, keys)[1] if self.root is not None else None

    def node(self, keys: Keys) -> yaml.Node | None:
        """The node of the value at `keys`, or None if the text does not hold it."""
        if self.root is None:
            return None
        node, _, depth = find_node(self.root, keys)
        return node if depth == len(keys) else None


def find_node(root: yaml.Node, keys: Keys) -> tuple[yaml.Node, int, int]:
    """The deepest part of the way to `keys` that the text holds: node, line, how many of the keys."""
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
    # Reading events one by one stays linear and shallow, whatever the text holds.
    depth = 0
    for number, event in enumerate(yaml.parse(text, Loader=LOADER)):
        depth += isinstance(event, yaml.CollectionStartEvent)
        depth -= isinstance(event, yaml.CollectionEndEvent)
        mark: Any = event.start_mark
        line = mark.line + 1
        if depth > MAX_DEPTH:
            raise InputError(DEEP, file, line)
        if number > MAX_NODES:
            raise InputError(f"holds more than {MAX_NODES:,} values", file, line)


def _unparsable(error: yaml.MarkedYAMLError, file: str | None) -> InputError:
    mark: Any = error.problem_mark or error.context_mark
    problem = str(error.problem)
    if "nesting depth" in problem:  # libyaml counts too, as PyYAML 6.0.4 brings it
        return InputError(DEEP, file, mark.line + 1)
    if "cannot start any token" in problem:
        problem = "a character that cannot begin a value; put the value in quotes"
    elif "mapping values are not allowed" in problem:
        problem = "a ':' or an indentation that does not fit here"
    elif "another document" in problem:
        problem = "a second document begins here; a scenario is a single one"
    elif "expected key" in problem:
        problem += (
            "; check the indentation (the first row of a picture must not begin with a blank)"
        )
    line = mark.line + 1 if mark is not None else None
    begun: Any = error.context_mark
    if begun is not None and line is not None and begun.line + 1 < line:
        problem += f" (in what begins in line {begun.line + 1})"
    return InputError(f"not valid YAML: {problem}", file, line)


def _measure(
    node: yaml.Node, file: str | None, sizes: dict[int, tuple[int, int]]
) -> tuple[int, int]:
    """(values, depth) of a node with its aliases expanded, each node being visited once."""
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
    if size > MAX_NODES or depth > MAX_DEPTH:
        raise InputError(
            f"aliases expand to more than {MAX_NODES:,} values or {MAX_DEPTH} levels", file, line
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
    if tag == TAG + "int" and WHOLE.fullmatch(text):
        return int(text)
    if tag == TAG + "float" and FRACTION.fullmatch(text):
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


def override(document: Document, settings: Iterable[str | Override]) -> Document:
    """The document with each KEY=VALUE applied in turn; VALUE is YAML. Raises InputError."""
    overrides = tuple(
        parse_setting(setting) if isinstance(setting, str) else setting for setting in settings
    )
    if not overrides:
        return document
    data = copy.deepcopy(document.data)
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
    """The way to a value: "fleet.start.0" -> ("fleet", "start", 0)."""
    return tuple(int(key) if key.isdecimal() else key for key in name.strip().split("."))


def _put(data: dict[str, Any], setting: Override) -> None:
    inner: Any = data
    for depth, key in enumerate(setting.keys):
        last = depth == len(setting.keys) - 1
        if isinstance(inner, list):
            _require_index(inner, key, depth, setting)
            if last:
                inner[int(key)] = setting.value
            else:
                inner = inner[int(key)]
        elif isinstance(inner, dict):
            if last:
                inner[str(key)] = setting.value
            else:
                inner[str(key)] = inner = _opened(inner.get(str(key)), setting.keys[: depth + 1])
        else:
            where = _dotted(setting.keys[:depth])
            raise InputError(f"{where} has no parts that could be set", setting.argument)


def _opened(value: Any, keys: Keys) -> Any:
    """What a further key is looked up in: a missing part is begun, a strategy's name unfolded."""
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


# Scenarios as files: found by path or by the name of a shipped one, read within limits.


MAX_BYTES: Final = 8_000_000
STUDY_KEYS: Final = frozenset(
    ("scenario", "factors", "points", "replications", "analysis", "common_random_numbers")
)
SHIPPED_FOLDER: Final = Path(__file__).resolve().parent.parent.parent / "layouts"


# What recordings begin with (automaton.recording.frames): scenarios know none.
RECORDING_START: Final = b"\x93AUTOMATON\r\n"
STUDIES_ARE_SWEPT: Final = "`automaton sweep STUDY --out FOLDER` does its runs"


def shipped() -> dict[str, Path]:
    """The scenarios that come with the package, by name."""
    return {
        path.stem: path
        for path in sorted(SHIPPED_FOLDER.glob("*.yaml"), key=lambda path: path.stem)
    }


def find(name: str | Path) -> Path:
    """The file of a scenario: a path, or the name of a shipped one. Raises InputError."""
    path = Path(name)  # os.path takes a name that is too long for one that there is not
    if os.path.isfile(path):
        return path
    known = shipped()
    if str(name) in known:
        return known[str(name)]
    if os.path.isdir(path):
        raise InputError("is a folder, not a scenario file", str(name))
    if os.path.exists(path):
        raise InputError("is not a regular file", str(name))
    if os.sep in str(name) or path.suffix in (".yaml", ".yml"):
        raise InputError("no such file", str(name))
    if str(name) in {path.stem for path in (SHIPPED_FOLDER / "studies").glob("*.yaml")}:
        raise InputError(f"'{name}' is a study; {STUDIES_ARE_SWEPT}")
    hint = nearest(str(name), known) or f"; there are {', '.join(known)}"
    raise InputError(f"no file and no shipped scenario is called '{name}'{hint}")


def is_recording(path: Path) -> bool:
    """Whether a file begins as recordings do. Raises OSError."""
    if not os.path.isfile(path):
        return False
    with path.open("rb") as stream:
        return stream.read(len(RECORDING_START)) == RECORDING_START


def read_text(path: Path) -> str:
    """The text of a file of at most MAX_BYTES bytes. Raises InputError."""
    file = str(path)
    try:
        if is_recording(path):
            raise InputError("is a recording, not a scenario; automaton replay shows it", file)
        size = path.stat().st_size
        if size > MAX_BYTES:
            limit = MAX_BYTES // 1_000_000
            message = f"has {size / 1e6:,.1f} MB; scenarios and floors may have {limit} MB at most"
            raise InputError(message, file)
        if not os.path.isfile(path):
            raise InputError("is not a regular file", file)
        with path.open("rb") as stream:
            content = stream.read(MAX_BYTES)
    except OSError as error:
        reason = (error.strerror or str(error)).lower()
        raise InputError(f"cannot be read: {reason}", file) from None
    if content.startswith((b"\xff\xfe", b"\xfe\xff")):
        raise InputError("is UTF-16 text; save it as UTF-8", file)
    if b"\0" in content[:4096]:
        raise InputError("is not a text file (it holds zero bytes)", file)
    try:
        return content.decode("utf-8-sig").replace("\r\n", "\n")
    except UnicodeDecodeError as error:
        line = content.count(b"\n", 0, error.start) + 1
        byte = content[error.start]
        raise InputError(f"is not UTF-8 text (byte {byte:#04x})", file, line) from None


def content_hash(file: Path) -> str:
    """16 hex digits of the content of a file; "" if it cannot be read, or is not a regular file."""
    if not os.path.isfile(file):
        return ""
    try:
        with file.open("rb") as stream:
            return hashlib.file_digest(stream, "sha256").hexdigest()[:16]
    except OSError:
        return ""


def is_study(data: dict[str, Any]) -> bool:
    """Whether what a file says means to be a study and not a scenario."""
    return "layout" not in data and not STUDY_KEYS.isdisjoint(data)


def read(name: str | Path) -> Document:
    """Read a scenario by path or by shipped name, without checking what it says."""
    path = find(name)
    text = read_text(path)
    file = str(path)
    data, root = parse(text, file)
    if data is None:
        raise InputError("is empty; a scenario needs at least name, layout and fleet", file)
    if not isinstance(data, dict):
        raise InputError("a scenario has keys such as name, layout and fleet; found none", file, 1)
    return Document(data=data, file=file, folder=path.parent, text=text, root=root)


# Lines of a text file, with the place of whatever is wrong in them.


WHOLE_NUMBER: Final = re.compile(r"[+-]?[0-9]{1,10}")
MAX_SHOWN: Final = 30  # characters of what is wrong


class Line(NamedTuple):
    """A line with content."""

    number: int  # in its file, from 1
    text: str  # without blanks at its end


def lines_of(path: Path) -> list[str]:
    """Return the lines of a text file, blanks at their ends included. Raises InputError."""
    if not os.path.exists(path):
        raise InputError("no such file", str(path))
    return read_text(path).replace("\r", "\n").split("\n")


def content_lines(path: Path) -> list[Line]:
    """Return the lines of a file that are neither empty nor comments. Raises InputError."""
    lines = (Line(number, text.rstrip()) for number, text in enumerate(lines_of(path), 1))
    return [line for line in lines if line.text and not line.text.lstrip().startswith("#")]


def quoted(text: str) -> str:
    """Return a text as an error shows it, or 'nothing'."""
    shown = text if len(text) <= MAX_SHOWN else text[: MAX_SHOWN - 3] + "..."
    return repr(shown) if text else "nothing"


def whole_number(text: str, what: str, file: str, line: int, column: int = 0) -> int:
    """Return a text as a whole number. `column`: of its file, from 1; 0: not said.

    Raises InputError.
    """
    word = text.strip()
    if not WHOLE_NUMBER.fullmatch(word):
        place = f"column {column}: " if column else ""
        raise InputError(f"{place}{what} must be a whole number, found {quoted(word)}", file, line)
    return int(word)


def split_columns(text: str, separator: str) -> Iterator[tuple[int, str]]:
    """Yield (column from 1, text) of what lies between separators, blanks included."""
    column = 1
    for part in text.split(separator):
        yield column, part
        column += len(part) + len(separator)


def counted_lines(lines: Sequence[Line], what: str, file: str) -> Sequence[Line]:
    """Return the lines below the count that comes first; `what`: "agent", "task".

    Raises InputError where there are more or fewer lines than the count says.
    """
    if not lines:
        raise InputError(f"is empty; its first line must be the number of {what}s", file)
    stated = whole_number(lines[0].text, f"the number of {what}s", file, lines[0].number)
    below = lines[1:]
    if len(below) != stated or not stated:
        line = below[stated].number if 0 <= stated < len(below) else lines[0].number
        raise InputError(
            f"line {lines[0].number} says {count(stated, what)}, the file has {len(below):,}",
            file,
            line,
        )
    return below


# The files that a scenario consists of: its own, and those that its texts name.


MAX_NAME: Final = 255  # characters of a file's name; pictures of floors are texts, too


def named_files(scenario: str | Path) -> tuple[Path, ...]:
    """The file of a scenario, and the files beside it that it names; its own first.

    A scenario that cannot be read names no others. Raises InputError if there is no such scenario.
    """
    own = find(scenario)
    try:
        document = read(own)
    except InputError:
        return (own,)
    paths = (document.folder / text for text in _texts(document.data))
    return (own, *dict.fromkeys(path for path in paths if os.path.isfile(path) and path != own))


def _texts(value: Any) -> Iterator[str]:
    """The texts of a document that may be names of files."""
    if isinstance(value, dict):
        for inner in value.values():
            yield from _texts(inner)
    elif isinstance(value, list):
        for inner in value:
            yield from _texts(inner)
    elif isinstance(value, str) and 0 < len(value) <= MAX_NAME and value.isprintable():
        yield value
