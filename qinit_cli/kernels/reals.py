# mypy: allow-untyped-defs, allow-untyped-calls
# mypy: disable-error-code="untyped-decorator, misc"
"""Eight numbers side by side, as a type that compiled functions calculate with.

A function written with +, -, *, comparisons, `chosen` and `nearest` is compiled for one number or for eight
at once, with the same results to the last bit, and runs on numpy arrays uncompiled.
"""

from __future__ import annotations

import operator
from collections.abc import Callable
from typing import Any

import numpy as np
from llvmlite import ir
from numba import extending, types
from numba.extending import lower_builtin, models, overload, register_model, type_callable

intrinsic: Any = extending.intrinsic  # it is called with values, not with what its definition names

EIGHT = 8
_NUMBERS = ir.VectorType(ir.DoubleType(), EIGHT)
_WHOLE = ir.VectorType(ir.IntType(32), EIGHT)
_BITS = ir.VectorType(ir.IntType(1), EIGHT)
_ORDER = ir.VectorType(ir.IntType(32), EIGHT)


class _Reals(types.Type):
    """Eight float64."""

    def __init__(self) -> None:
        super().__init__(name="EightReals")


class _Flags(types.Type):
    """Eight truth values."""

    def __init__(self) -> None:
        super().__init__(name="EightFlags")


_reals, _flags = _Reals(), _Flags()


@register_model(_Reals)
class _RealsModel(models.PrimitiveModel):
    def __init__(self, manager: Any, kind: Any) -> None:
        super().__init__(manager, kind, _NUMBERS)


@register_model(_Flags)
class _FlagsModel(models.PrimitiveModel):
    def __init__(self, manager: Any, kind: Any) -> None:
        super().__init__(manager, kind, _BITS)


@intrinsic
def load_reals(typing: Any, array: Any, position: Any) -> Any:
    """Eight numbers of a contiguous f8 array (n,), from `position` on; position is not checked."""

    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        return builder.load(_place(context, builder, signature, arguments, _NUMBERS), align=8)

    return _reals(array, types.intp), generate


@intrinsic
def store_reals(typing: Any, array: Any, position: Any, reals: Any) -> Any:
    """Writes eight numbers into such an array."""

    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        builder.store(arguments[2], _place(context, builder, signature, arguments, _NUMBERS), align=8)
        return context.get_dummy_value()

    return types.void(array, types.intp, reals), generate


@intrinsic
def store_whole(typing: Any, array: Any, position: Any, reals: Any) -> Any:
    """Writes the whole parts of eight numbers, 0 to 2^31 - 1, into a contiguous u4 array (n,)."""

    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        whole = builder.fptosi(arguments[2], _WHOLE)
        builder.store(whole, _place(context, builder, signature, arguments, _WHOLE), align=4)
        return context.get_dummy_value()

    return types.void(array, types.intp, reals), generate


@intrinsic
def reals(typing: Any, a: Any, b: Any, c: Any, d: Any, e: Any, f: Any, g: Any, h: Any) -> Any:
    """Eight numbers put side by side."""

    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        vector = ir.Constant(_NUMBERS, ir.Undefined)
        for place, number in enumerate(arguments):
            vector = builder.insert_element(vector, number, ir.Constant(ir.IntType(32), place))
        return vector

    return _reals(*[types.float64] * EIGHT), generate


@intrinsic
def bits(typing: Any, flags: Any) -> Any:
    """An integer with a bit for each of eight truth values."""

    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        return builder.zext(builder.bitcast(arguments[0], ir.IntType(EIGHT)), ir.IntType(64))

    return types.int64(flags), generate


@intrinsic
def total(typing: Any, reals: Any) -> Any:
    """The sum of eight numbers: fours apart first, then twos, then neighbours."""

    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        summed = arguments[0]
        for apart in (4, 2, 1):
            order = ir.Constant(_ORDER, [(place + apart) % EIGHT for place in range(EIGHT)])
            summed = builder.fadd(summed, builder.shuffle_vector(summed, summed, order))
        return builder.extract_element(summed, ir.Constant(ir.IntType(32), 0))

    return types.float64(reals), generate


def chosen(condition, yes, no):
    """`yes` where the condition holds, else `no`."""
    return np.where(condition, yes, no)


def nearest(number):
    """The nearest whole number, even of two."""
    return np.rint(number)


def whole(number):
    """The number without its fraction."""
    return np.trunc(number)


@overload(chosen)
def _chosen(condition, yes, no):
    if condition is _flags:
        return lambda condition, yes, no: _select(condition, yes, no)
    return lambda condition, yes, no: yes if condition else no


@overload(nearest)
def _nearest(number):
    return (lambda number: _rint(number)) if number is _reals else (lambda number: np.rint(number))


@overload(whole)
def _whole_part(number):
    return (lambda number: _trunc(number)) if number is _reals else (lambda number: np.trunc(number))


@intrinsic
def _select(typing: Any, condition: Any, yes: Any, no: Any) -> Any:
    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        yes, no = (_eight(builder, each) for each in arguments[1:])
        return builder.select(arguments[0], yes, no)

    return _reals(condition, _number(yes), _number(no)), generate


def _rounding(name: str) -> Any:
    @intrinsic
    def apply(typing: Any, number: Any) -> Any:
        def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
            kind = ir.FunctionType(_NUMBERS, [_NUMBERS])
            return builder.call(builder.module.declare_intrinsic(f"llvm.{name}.v8f64", (), kind), arguments)

        return _reals(number), generate

    return apply


_rint, _trunc = _rounding("rint"), _rounding("trunc")


def _define(
    function: Callable[..., Any], result: types.Type, kinds: list[Any], emit: Callable[..., Any]
) -> None:
    """Makes an operator known for eight numbers, or for eight and one that is then spread."""

    @type_callable(function)
    def typed(context: Any) -> Any:
        return lambda left, right: result if (left, right) in kinds else None

    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        return emit(builder, *(_eight(builder, each) for each in arguments))

    for pair in kinds:
        lower_builtin(function, *pair)(generate)


def _comparison(sign: str) -> Callable[..., Any]:
    return lambda builder, left, right: builder.fcmp_ordered(sign, left, right)


_mixed = [(_reals, _reals), (_reals, types.float64), (types.float64, _reals)]
_define(operator.add, _reals, _mixed, lambda builder, left, right: builder.fadd(left, right))
_define(operator.sub, _reals, _mixed, lambda builder, left, right: builder.fsub(left, right))
_define(operator.mul, _reals, _mixed, lambda builder, left, right: builder.fmul(left, right))
_define(operator.lt, _flags, _mixed, _comparison("<"))
_define(operator.gt, _flags, _mixed, _comparison(">"))
_define(operator.ge, _flags, _mixed, _comparison(">="))
_define(operator.eq, _flags, _mixed, _comparison("=="))
_define(operator.and_, _flags, [(_flags, _flags)], lambda builder, left, right: builder.and_(left, right))
_define(operator.or_, _flags, [(_flags, _flags)], lambda builder, left, right: builder.or_(left, right))


def _number(kind: Any) -> Any:
    return kind if kind is _reals else types.float64


def _eight(builder: Any, value: Any) -> Any:
    """The value if it is a vector, else eight times the value."""
    return value if isinstance(value.type, ir.VectorType) else _spread(builder, value)


def _spread(builder: Any, number: Any) -> Any:
    undefined = ir.Constant(_NUMBERS, ir.Undefined)
    first = builder.insert_element(undefined, number, ir.Constant(ir.IntType(32), 0))
    return builder.shuffle_vector(first, undefined, ir.Constant(_ORDER, [0] * EIGHT))


def _place(context: Any, builder: Any, signature: Any, arguments: Any, vector: Any) -> Any:
    """Where the vector stands: the array is the first argument, the position the second."""
    data = context.make_array(signature.args[0])(context, builder, arguments[0]).data
    return builder.bitcast(builder.gep(data, [arguments[1]]), vector.as_pointer())
