"""Data against the structs of the schema, with sentences that say what was expected and found."""

from __future__ import annotations

import re
from typing import Any, Final, TypeVar

import msgspec

from automaton.errors import InputError, alternatives, nearest
from automaton.scenario.document import Document, Keys
from automaton.scenario.quantities import KEY, TIME
from automaton.scenario.schema import INSTEAD, MEMORY_PATTERN, TICK_PATTERN

T = TypeVar("T")

TIME_PATTERN: Final = r"^\s*[-+]?[0-9.]"  # what is read as a quantity later, when the tick is known
MSER_OR_TIME: Final = rf"^mser-5$|{TIME_PATTERN}"

AT: Final = re.compile(r"^(?P<what>.*?)(?: - at `\$(?P<path>[^`]*)`)?$", re.DOTALL)
PART: Final = re.compile(r"\.(\w+)|\[(\d+)\]|\[\.\.\.\]")
FIELD: Final = re.compile(r"field `(.*)`")


def validated(document: Document, value: Any, wanted: type[T], at: Keys = ()) -> T:
    """`value`, found at the keys `at` of the document, as a struct. Raises InputError."""
    try:
        return msgspec.convert(value, wanted)
    except msgspec.ValidationError as error:
        match = AT.match(str(error))
        assert match is not None, "every text matches"
        inner = _keys(value, wanted, match["path"] or "")
        raise _explained(document, value, wanted, at, inner, match["what"]) from None


def _keys(value: Any, wanted: Any, path: str) -> Keys:
    """The keys of a path of msgspec, which writes [...] for whatever key of a mapping."""
    keys: Keys = ()
    for name, index in PART.findall(path):
        if name or index:
            keys = (*keys, int(index) if index else name)
        elif isinstance(entries := _value_at(value, keys), dict):
            bad = (key for key in entries if not _fits(_with_one(value, keys, key), wanted))
            keys = (*keys, next(bad, ""))
    return keys


def _with_one(value: Any, keys: Keys, key: str) -> Any:
    """The value with one entry alone in the mapping at some keys."""
    if not keys:
        return {key: value[key]}
    if isinstance(value, dict):
        return {**value, keys[0]: _with_one(value[keys[0]], keys[1:], key)}
    return [_with_one(one, keys[1:], key) if k == keys[0] else one for k, one in enumerate(value)]


def _fits(value: Any, wanted: Any) -> bool:
    try:
        msgspec.convert(value, wanted)
    except msgspec.ValidationError:
        return False
    return True


def _explained(
    document: Document, value: Any, wanted: Any, at: Keys, inner: Keys, what: str
) -> InputError:
    import msgspec.inspect  # only needed on the way to an error

    keys = at + inner
    expected = _type_at(msgspec.inspect.type_info(wanted), inner)
    found = _value_at(value, inner)
    field = FIELD.search(what)
    if field and what.startswith("Object contains unknown"):
        names = _names(expected)
        refusals = [getattr(getattr(one, "cls", None), "refused", {}) for one in _options(expected)]
        if any(field[1] in one for one in refusals):
            said = next(one[field[1]] for one in refusals if field[1] in one)
            return document.error((*keys, field[1]), f"{dotted((*keys, field[1]))}: {said}")
        return document.error(
            (*keys, field[1]),
            f"unknown key '{field[1]}'{_inside(keys)}{nearest(field[1], names)}; "
            + (f"allowed: {', '.join(names)}" if names else "there are no keys here"),
        )
    if field and what.startswith("Object missing"):
        return document.error(keys, f"the key '{field[1]}' is missing{_inside(keys)}")
    if what.startswith(("Expected", "Invalid", "Integer value")):
        hint = nearest(found, _words(expected)) if isinstance(found, str) else ""
        if isinstance(found, bool):
            hint = _now_written(expected, found)
        sentence = f"{dotted(keys) or 'it'} must be {described(expected)}, found {shown(found)}"
        return document.error(keys, sentence + hint)
    # A struct's own check; it begins with the key that is wrong, if it is one key.
    first = what.split(" ", 1)[0]
    if isinstance(found, dict) and first in found:
        return document.error((*keys, first), f"{dotted((*keys, first))}{what[len(first) :]}")
    missing = what.startswith("the key '") and what.endswith("is missing")
    return document.error(keys, what + (_inside(keys) if missing else ""))


def _now_written(expected: Any, value: bool) -> str:
    """What to write for a value that the field took before, or ""."""
    word = (getattr(expected, "extra", None) or {}).get(INSTEAD, {}).get(value)
    return f"; {shown(value)} is now {word}" if word else ""


def described(expected: Any) -> str:
    """What a type of `msgspec.inspect` accepts, in words."""
    from msgspec import inspect

    if isinstance(expected, inspect.Metadata):
        quantity = (expected.extra or {}).get(KEY)
        return described(expected.type) + ("" if quantity is None else f", or {quantity.described}")
    if isinstance(expected, inspect.UnionType):
        kinds = [kind for kind in expected.types if not isinstance(kind, inspect.NoneType)]
        return ", or ".join(described(kind) for kind in kinds)
    if isinstance(expected, inspect.LiteralType):
        return alternatives(str(value) for value in expected.values)
    if isinstance(expected, inspect.IntType | inspect.FloatType):
        return ("a whole number" if isinstance(expected, inspect.IntType) else "a number") + _range(
            expected
        )
    if isinstance(expected, inspect.BoolType):
        return "true or false"
    if isinstance(expected, inspect.StrType):
        return _text(expected.pattern)
    if isinstance(expected, inspect.TupleType):
        items = [described(item) for item in expected.item_types]
        return "a cell [x, y]" if items == ["a whole number"] * 2 else f"[{', '.join(items)}]"
    if isinstance(expected, inspect.VarTupleType | inspect.ListType):
        return f"a list (each {described(expected.item_type)})"
    if isinstance(expected, inspect.StructType):
        names = ", ".join(field.encode_name for field in expected.fields)
        return f"a mapping with the keys {names}" if "," in names else f"{{{names}: ...}}"
    return "a mapping"


def shown(value: Any) -> str:
    """A value as an error shows it: short."""
    if value is None:
        return "nothing"
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, dict):
        return "a mapping"
    text = repr(value)
    if isinstance(value, list):
        if len(text) > 40:
            return f"a list of {len(value)}"
        text = f"[{', '.join('null' if one is None else shown(one) for one in value)}]"
    return text if len(text) <= 60 else text[:57] + "..."


def _range(expected: Any) -> str:
    if expected.ge is not None and expected.le is not None:
        return f" from {expected.ge} to {expected.le}"
    if expected.gt is not None and expected.le is not None:
        return f" above {expected.gt} and at most {expected.le}"
    if expected.ge is not None:
        return f" of at least {expected.ge}"
    if expected.gt is not None:
        return f" above {expected.gt}"
    return f" of at most {expected.le}" if expected.le is not None else ""


def _options(expected: Any) -> list[Any]:
    """The alternatives of a type, annotations and unions opened."""
    from msgspec import inspect

    if isinstance(expected, inspect.Metadata):
        return _options(expected.type)
    if isinstance(expected, inspect.UnionType):
        return [option for kind in expected.types for option in _options(kind)]
    return [expected]


def _type_at(expected: Any, inner: Keys) -> Any:
    from msgspec import inspect

    for key in inner:
        following = None
        for option in _options(expected):
            if isinstance(option, inspect.StructType):
                fields = {field.encode_name: field.type for field in option.fields}
                following = fields.get(str(key), following)
            elif isinstance(option, inspect.VarTupleType | inspect.ListType):
                following = option.item_type
            elif isinstance(option, inspect.DictType):
                following = option.value_type
            elif isinstance(option, inspect.TupleType) and isinstance(key, int):
                following = option.item_types[min(key, len(option.item_types) - 1)]
        expected = following
    return expected


def _value_at(value: Any, inner: Keys) -> Any:
    for key in inner:
        try:
            value = value[key]
        except (KeyError, IndexError, TypeError):
            return None
    return value


def _names(expected: Any) -> list[str]:
    options = _options(expected)
    return [field.encode_name for option in options for field in getattr(option, "fields", ())]


def _words(expected: Any) -> list[str]:
    options = _options(expected)
    return [str(value) for option in options for value in getattr(option, "values", ())]


def dotted(keys: Keys) -> str:
    """The keys that lead to a value as text: "orders.list[3].release"."""
    text = ""
    for key in keys:
        text += f"[{key}]" if isinstance(key, int) else f".{key}"
    return text.removeprefix(".")


def _inside(keys: Keys) -> str:
    return f" in {dotted(keys)}" if keys else ""


def _text(pattern: str | None) -> str:
    """What text may look like."""
    if pattern == TICK_PATTERN:
        return 'a number above 0 and a name, such as "0.5 s"'
    if pattern == MEMORY_PATTERN:
        return 'a number above 0 and KiB, MiB, GiB or TiB, such as "512 MiB"'
    if pattern == TIME_PATTERN:
        return TIME.described
    if pattern == MSER_OR_TIME:
        return f"mser-5, or {TIME.described}"
    return "text in one line" if pattern else "text"
