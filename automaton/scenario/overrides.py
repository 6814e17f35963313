"""Single values of a scenario replaced from the command line: `--set fleet.robots=5`."""

from __future__ import annotations

import copy
from collections.abc import Iterable
from dataclasses import replace
from typing import Any

from automaton.errors import InputError
from automaton.scenario.document import Document, Keys, Override, parse


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
    if isinstance(value, str) and keys[0] == "strategy" and len(keys) == 2:
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
