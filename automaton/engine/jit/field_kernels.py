"""Kernels that process all fields of a struct, generated from the declarations.

A loop over arrays of different types does not compile, so each field has its own lines. The kernels
have no cache of their own: they are compiled into their callers, whose cache is named by all
imported sources, including the declarations.
"""

from __future__ import annotations

import linecache
from collections.abc import Iterable, Mapping
from operator import itemgetter
from textwrap import indent
from typing import Any, Final

import numpy as np

from automaton.engine.jit.kernel import kernel
from automaton.engine.jit.structs import CALL, DECISION, MEASURED, VISIBLE, Field, Struct

# no negative index: for a signed index Numba reads the array's length (`bench`, limited view: + 25
# %)
UNSIGNED_INDEX: Final = "    u = np.uint64(i)"
ELEMENTS: Final = {"n": "identity[i]"}  # the element number along an extent, if not i


def hiding(struct: type[Struct], extent: str, measured: bool = True) -> Any:
    """A kernel (s, i): hides element i in all arrays along an extent.

    `measured`: whether it also hides measured fields.
    """
    arrays = _sorted_out(hidden_fields(struct, extent), measured)
    lines = [UNSIGNED_INDEX]
    lines += [
        _for_each("s", name, one, f"s.{name}[@] = {one.hidden}", "u")
        for name, one in sorted(arrays.items(), key=lambda item: not item[1].used)
    ]  # rows of different lengths come first, while their lengths are known
    return kernel(written_out(f"hide_{struct.__name__}_{extent}", "s, i", lines), cached=False)


def showing(struct: type[Struct], extent: str, measured: bool = True) -> Any:
    """A kernel (a, b, i): copies element i from b to a, in all arrays along an extent.

    `measured`: whether it also copies measured fields.
    """
    lines = [UNSIGNED_INDEX]
    lines += [
        _for_each("b", name, one, f"a.{name}[@] = b.{name}[@]", "u")
        for name, one in _sorted_out(hidden_fields(struct, extent), measured).items()
    ]
    return kernel(written_out(f"show_{struct.__name__}_{extent}", "a, b, i", lines), cached=False)


def hidden_fields(struct: type[Struct], extent: str) -> dict[str, Field]:
    """The arrays along an extent that limited sight may hide."""
    return {
        name: one
        for name, one in struct._declared.items()
        if one.extents[:1] == (extent,) and one.hidden is not VISIBLE
    }


def _sorted_out(arrays: Mapping[str, Field], measured: bool) -> dict[str, Field]:
    return {name: one for name, one in arrays.items() if measured or one.role != MEASURED}


def digested_fields(world: type[Struct]) -> dict[int, tuple[str, str, Field]]:
    """The fields in the digest, by number: the struct in the world, the field, its declaration."""
    covered = [
        (one.digest, part, name, one)
        for part, struct in {"": world, **world.struct_classes()}.items()
        for name, one in struct._declared.items()
        if one.digest is not None
    ]
    covered.sort(key=itemgetter(0))
    if [number for number, *_ in covered] != list(range(len(covered))):
        raise TypeError(
            "the arrays of the digest are numbered 0, 1, 2, ..., each with its own number"
        )
    return {number: (part, name, one) for number, part, name, one in covered}


def digest_names(world: type[Struct]) -> tuple[str, ...]:
    """The names of the fields in the digest, by number."""
    covered = digested_fields(world).values()
    return tuple(f"{part}.{name}" if part else "tick" for part, name, _ in covered)


def digesting(world: type[Struct], add_value: Any, values: Iterable[Any]) -> Any:
    """A kernel (world, out): writes the digests of all arrays of the state to out, (D,) uint64.

    `add_value`: (out, number, element, value). `values`: the kernels that declarations name. Arrays
    of robots use identities, others indices.
    """
    names = {function.__name__: function for function in values} | {"add_value": add_value}
    body = ["    out[:] = np.uint64(0)", "    identity = world.robots.identity"]
    body += [f"    {part} = world.{part}" for part in world.struct_classes()]
    loops: dict[str, list[str]] = {}
    for number, (part, name, one) in digested_fields(world).items():
        if not one.extents or not part:
            body.append(f"    out[{number}] = {one.by}({part or 'world'})")
            continue
        extent = one.extents[0]
        lines = loops.setdefault(f"{part} {extent}", [])
        if not lines:
            lines.append(f"    for i in range({part}.{name}.shape[0]):")
            lines.append(f"        e = np.int64({ELEMENTS.get(extent, 'i')})")
        if one.by:
            lines.append(f"        add_value(out, {number}, e, {one.by}({part}, i))")
            continue
        element = "e" if len(one.extents) == 1 else f"e * {part}.{name}.shape[1] + j"
        value = f"add_value(out, {number}, {element}, np.int64({part}.{name}[@]))"
        lines.append(indent(_for_each(part, name, one, value), "    "))
    body += [line for lines in loops.values() for line in lines]
    return kernel(written_out("digest_arrays", "world, out", body, names), cached=False)


def clearing(struct: type[Struct]) -> Any:
    """A kernel (s, count): sets the first `count` decisions and the fields of a call to their
    defaults."""
    for_call = [
        f"    s.{name} = {one.default}" if one.is_cell else f"    s.{name}[:] = {one.default}"
        for name, one in struct._declared.items()
        if one.role == CALL
    ]
    each = [
        f"        s.{name}[k] = {one.default}"
        for name, one in struct._declared.items()
        if one.role == DECISION
    ]
    lines = [*for_call, "    for k in range(count):", *each]
    return kernel(written_out(f"clear_{struct.__name__}", "s, count", lines), cached=False)


def decision_values(struct: type[Struct]) -> tuple[str, ...]:
    """The fields of the decision about one robot, in the order of the decision stream."""
    return tuple(name for name, one in struct._declared.items() if one.role == DECISION)


def appending(struct: type[Struct]) -> Any:
    """A kernel (s, k, words, at): writes decision k to words[at:]; returns the number of words, 0
    if it has its defaults."""
    values = decision_values(struct)
    unchanged = " and ".join(f"s.{name}[k] == {struct._declared[name].default}" for name in values)
    lines = [f"    if {unchanged}:", "        return 0"]
    lines += [f"    words[at + {word}] = s.{name}[k]" for word, name in enumerate(values)]
    lines += [f"    return {len(values)}"]
    return kernel(written_out(f"append_{struct.__name__}", "s, k, words, at", lines), cached=False)


def reading(struct: type[Struct]) -> Any:
    """A kernel (s, k, words, at): reads decision k from words[at:]."""
    lines = [
        f"    s.{name}[k] = words[at + {word}]" for word, name in enumerate(decision_values(struct))
    ]
    return kernel(written_out(f"read_{struct.__name__}", "s, k, words, at", lines), cached=False)


def _for_each(owner: str, name: str, declared: Field, statement: str, element: str = "i") -> str:
    """A statement for each value of an element in an array; @ stands for its index."""
    lines, ndim = [], len(declared.extents)
    for axis in range(1, ndim):
        end = f"{declared.used}[{element}]" if declared.used else f"{name}.shape[{axis}]"
        lines.append("    " * axis + f"for {'ijk'[axis]} in range({owner}.{end}):")
    index = ", ".join([element, "j", "k"][:ndim])
    return "\n".join([*lines, "    " * ndim + statement.replace("@", index)])


def written_out(
    name: str, parameters: str, body: Iterable[str], names: Mapping[str, Any] | None = None
) -> Any:
    """Make a function from these lines, which tracebacks show."""
    source = "\n".join([f"def {name}({parameters}):", *(body or ["    pass"]), ""])
    file = f"<{name}, written out from declarations>"
    linecache.cache[file] = (len(source), None, source.splitlines(keepends=True), file)
    defined = {"np": np, **(names or {}), "__name__": __name__}
    exec(compile(source, file, "exec"), defined)
    return defined[name]
