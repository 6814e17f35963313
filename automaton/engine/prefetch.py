"""A hint to the memory that an element will be needed soon; it changes no result.

A million robots on 16 million cells are 2 times faster with it (`automaton bench --only step`).
"""

from llvmlite import ir
from numba import types
from numba.extending import intrinsic

from automaton.engine.jit.kernel import jit_is_on

FOR_WRITING = 1
KEEP_CLOSE = 3  # of 0..3
DATA = 1


@intrinsic
def _prefetch(typing, array, index):
    def generate(context, builder, signature, arguments):
        data = context.make_array(signature.args[0])(context, builder, arguments[0]).data
        place = builder.bitcast(builder.gep(data, [arguments[1]]), ir.IntType(8).as_pointer())
        number = ir.IntType(32)
        kind = ir.FunctionType(ir.VoidType(), [place.type, number, number, number])
        hint = builder.module.declare_intrinsic("llvm.prefetch", [place.type], kind)
        builder.call(hint, [place, number(FOR_WRITING), number(KEEP_CLOSE), number(DATA)])
        return context.get_dummy_value()

    return types.void(array, index), generate


def _ignored(array, index):
    """Without the JIT there is nothing to hint at."""


prefetch = _prefetch if jit_is_on() else _ignored
