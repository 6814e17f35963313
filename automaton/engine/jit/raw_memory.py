"""Bytes at bare addresses: what has no type where it is copied."""

import ctypes

from llvmlite import ir
from numba import types
from numba.extending import intrinsic, overload

from automaton.engine.jit.numba_parts import cgutils


def copy_bytes(to, source, count):
    """Copy bytes from one address to another; the two do not overlap."""
    ctypes.memmove(int(to), int(source), int(count))


def clear_bytes(to, count):
    """Fill with zeros."""
    ctypes.memset(int(to), 0, int(count))


@intrinsic
def _copy_bytes(context, to, source, count):
    def generate(context, builder, signature, arguments):
        pointer = ir.IntType(8).as_pointer()
        to, source = (builder.inttoptr(address, pointer) for address in arguments[:2])
        cgutils.raw_memcpy(builder, to, source, arguments[2], 1)
        return context.get_dummy_value()

    return types.void(types.int64, types.int64, types.int64), generate


@intrinsic
def _clear_bytes(context, to, count):
    def generate(context, builder, signature, arguments):
        to = builder.inttoptr(arguments[0], ir.IntType(8).as_pointer())
        cgutils.memset(builder, to, arguments[1], 0)
        return context.get_dummy_value()

    return types.void(types.int64, types.int64), generate


@overload(copy_bytes)
def _compiled_copy(to, source, count):
    return lambda to, source, count: _copy_bytes(to, source, count)


@overload(clear_bytes)
def _compiled_clear(to, count):
    return lambda to, count: _clear_bytes(to, count)
