# mypy: disable-error-code="no-untyped-call, untyped-decorator, misc"
"""The vector operations of the loops that LLVM does not find by itself.

Draws come from xoshiro256++ in eight interleaved lanes; LLVM, which must assume that a block of draws and the
state of its stream share memory, would keep neither in registers (measured: five times slower). A state's row
of four values is changed and scanned as one vector. Both are plain LLVM vectors: on a machine with narrower
registers they become halves or quarters, with the same results.
"""

from __future__ import annotations

from typing import Any

from llvmlite import ir
from numba import extending, types
from numba.extending import models, register_model

intrinsic: Any = extending.intrinsic  # it is called with values, not with what its definition names

LANES = 8
WIDTH = 4

_WORDS = ir.VectorType(ir.IntType(64), LANES)
_ROW = ir.VectorType(ir.DoubleType(), WIDTH)
_ENTRIES = ir.VectorType(ir.IntType(64), WIDTH)
_ORDER = ir.VectorType(ir.IntType(32), WIDTH)


class _Words(types.Type):
    """Eight 64-bit words side by side."""

    def __init__(self) -> None:
        super().__init__(name="EightWords")


_words = _Words()


@register_model(_Words)
class _WordsModel(models.PrimitiveModel):
    def __init__(self, manager: Any, kind: Any) -> None:
        super().__init__(manager, kind, _WORDS)


@intrinsic
def load_words(typing: Any, array: Any, position: Any) -> Any:
    """Eight words of a contiguous u8 array (n,), from `position` on; position is not checked."""

    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        return builder.load(_place(context, builder, signature, arguments, _WORDS), align=8)

    return _words(array, types.intp), generate


@intrinsic
def store_words(typing: Any, array: Any, position: Any, words: Any) -> Any:
    """Writes eight words into a contiguous u8 array (n,), from `position` on; position is not checked."""

    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        builder.store(arguments[2], _place(context, builder, signature, arguments, _WORDS), align=8)
        return context.get_dummy_value()

    return types.void(array, types.intp, words), generate


@intrinsic
def next_words(typing: Any, a: Any, b: Any, c: Any, d: Any) -> Any:
    """One step of xoshiro256++ in each lane: the eight draws, then the four words of state."""

    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        a, b, c, d = arguments
        draws = builder.add(_rotated(builder, builder.add(a, d), 23), a)
        shifted = builder.shl(b, _eight(17))
        c = builder.xor(c, a)
        d = builder.xor(d, b)
        b = builder.xor(b, c)
        a = builder.xor(a, d)
        c = builder.xor(c, shifted)
        d = _rotated(builder, d, 45)
        return context.make_tuple(builder, signature.return_type, [draws, a, b, c, d])

    return types.UniTuple(_words, 5)(a, b, c, d), generate


@intrinsic
def add_to_entry(typing: Any, table: Any, row: Any, entry: Any, change: Any) -> Any:
    """The largest of four values from `row` on after adding `change` to one, and which of them equal it.

    The ties are bits 0 to 3 of an integer. The table is f8, one-dimensional and contiguous; row and entry are
    not checked.
    """

    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        entry, change = arguments[2:]
        place = _place(context, builder, signature, arguments, _ROW)
        before = builder.load(place, align=8)
        order = ir.Constant(_ENTRIES, [0, 1, 2, 3])
        chosen = builder.icmp_unsigned("==", _spread(builder, entry, _ENTRIES), order)
        # -0.0 changes no number it is added to; choosing between rows instead would become a masked store, which
        # the next load of the row has to wait for
        nothing = ir.Constant(_ROW, [-0.0] * WIDTH)
        after = builder.fadd(before, builder.select(chosen, _spread(builder, change, _ROW), nothing))
        builder.store(after, place, align=8)
        return _best_and_ties(context, builder, signature, after)

    signature = types.Tuple((types.float64, types.uint64))(table, types.intp, types.intp, types.float64)
    return signature, generate


@intrinsic
def put_entry(typing: Any, table: Any, row: Any, entry: Any, value: Any) -> Any:
    """As add_to_entry, after setting one of the four values; the others are not written."""

    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        row, entry, value = arguments[1:]
        before = builder.load(_place(context, builder, signature, arguments, _ROW), align=8)
        order = ir.Constant(_ENTRIES, [0, 1, 2, 3])
        chosen = builder.icmp_unsigned("==", _spread(builder, entry, _ENTRIES), order)
        after = builder.select(chosen, _spread(builder, value, _ROW), before)
        one = [arguments[0], builder.add(row, entry)]
        builder.store(value, _place(context, builder, signature, one, ir.DoubleType()), align=8)
        return _best_and_ties(context, builder, signature, after)

    signature = types.Tuple((types.float64, types.uint64))(table, types.intp, types.intp, types.float64)
    return signature, generate


def _best_and_ties(context: Any, builder: Any, signature: Any, row: Any) -> Any:
    best = _larger(builder, _larger(builder, row, [1, 0, 3, 2]), [2, 3, 0, 1])
    equal = builder.bitcast(builder.fcmp_ordered("==", row, best), ir.IntType(WIDTH))
    first = builder.extract_element(best, ir.Constant(ir.IntType(32), 0))
    return context.make_tuple(builder, signature.return_type, [first, builder.zext(equal, ir.IntType(64))])


def _place(context: Any, builder: Any, signature: Any, arguments: Any, vector: Any) -> Any:
    """Where the vector stands: the array is the first argument, the position the second."""
    data = context.make_array(signature.args[0])(context, builder, arguments[0]).data
    return builder.bitcast(builder.gep(data, [arguments[1]]), vector.as_pointer())


def _eight(value: int) -> Any:
    return ir.Constant(_WORDS, [value] * LANES)


def _rotated(builder: Any, words: Any, count: int) -> Any:
    return builder.or_(builder.shl(words, _eight(count)), builder.lshr(words, _eight(64 - count)))


def _spread(builder: Any, scalar: Any, vector: Any) -> Any:
    """The scalar in every place of the vector."""
    undefined = ir.Constant(vector, ir.Undefined)
    first = builder.insert_element(undefined, scalar, ir.Constant(ir.IntType(32), 0))
    return builder.shuffle_vector(first, undefined, ir.Constant(_ORDER, [0] * WIDTH))


def _larger(builder: Any, row: Any, order: list[int]) -> Any:
    """Place by place the larger of the row and its rearrangement."""
    moved = builder.shuffle_vector(row, ir.Constant(_ROW, ir.Undefined), ir.Constant(_ORDER, order))
    return builder.select(builder.fcmp_ordered(">", row, moved), row, moved)
