"""Packs: several lanes of float64 that one vector instruction works on.

A kernel is written once, over numbers; called with a ``float`` it works on one trajectory, called
with a `pack` it works on `LANES` of them, lane by lane with the very same IEEE operations in
the same order. That is why a trajectory has the same bits whatever its lane and its neighbours.

Arrays are (rows, lanes), C-contiguous. ``load(like, array, row)`` reads row ``row`` as the
kind of number that ``like`` is, ``store(array, row, value)`` writes it.

With ``NUMBA_DISABLE_JIT=1`` a pack is a NumPy array of `LANES` numbers.
"""

from __future__ import annotations

import operator
from typing import Any

import numba
import numpy as np
from llvmlite import ir
from numba.core import cgutils, types
from numba.extending import (
    intrinsic,
    models,
    overload,
    register_model,
)

LANES = 8
"""Lanes in a pack: eight float64 fill one 512-bit register, or two of 256 bits."""


class PackType(types.Type):
    """Type of `LANES` float64 held in one LLVM vector."""

    def __init__(self) -> None:
        super().__init__(name=f"pack{LANES}")


pack_type = PackType()
_VECTOR = ir.VectorType(ir.DoubleType(), LANES)


@register_model(PackType)
class _PackModel(models.PrimitiveModel):
    def __init__(self, manager: Any, pack: Any) -> None:
        super().__init__(manager, pack, _VECTOR)  # type: ignore[no-untyped-call]


def _row_pointer(context: Any, builder: Any, array_type: Any, array: Any, row: Any) -> Any:
    struct = context.make_array(array_type)(context, builder, array)
    return builder.gep(struct.data, [row])


_config: Any = numba.config  # its attributes are made at run time
if _config.DISABLE_JIT:

    def splat(value: float) -> Any:
        """Give a pack with ``value`` in every lane."""
        return np.full(LANES, value)

    def load(like: Any, array: Any, row: int) -> Any:
        """Read row ``row`` of ``array`` (rows, lanes) as the kind of number ``like`` is."""
        return array[row, 0] if np.ndim(like) == 0 else array[row].copy()

    def store(array: Any, row: int, value: Any) -> None:
        """Write a number or a pack into row ``row`` of ``array`` (rows, lanes)."""
        array[row] = value

    def larger(a: Any, b: Any) -> Any:
        """Larger of two numbers, lane by lane; ``b`` where either is NaN."""
        return np.where(a > b, a, b) if np.ndim(a) else (a if a > b else b)

    def magnitude(a: Any) -> Any:
        """Absolute value, lane by lane."""
        return np.abs(a)

else:

    @intrinsic
    def splat(typing_context: Any, value: Any) -> Any:
        """Give a pack with ``value`` in every lane."""

        def generate(context: Any, builder: Any, signature: Any, args: Any) -> Any:
            zero = ir.Constant(_VECTOR, ir.Undefined)
            first = builder.insert_element(zero, args[0], ir.Constant(ir.IntType(32), 0))
            mask = ir.Constant(ir.VectorType(ir.IntType(32), LANES), [0] * LANES)
            return builder.shuffle_vector(first, zero, mask)

        return pack_type(types.float64), generate

    @intrinsic
    def load(typing_context: Any, like: Any, array: Any, row: Any) -> Any:
        """Read row ``row`` of ``array`` (rows, lanes) as the kind of number ``like`` is."""

        def generate(context: Any, builder: Any, signature: Any, args: Any) -> Any:
            _, array_type, row_type = signature.args
            row = context.cast(builder, args[2], row_type, types.intp)
            if isinstance(like, PackType):
                row = builder.mul(row, ir.Constant(row.type, LANES))
            pointer = _row_pointer(context, builder, array_type, args[1], row)
            if isinstance(like, PackType):
                pointer = builder.bitcast(pointer, _VECTOR.as_pointer())
            return builder.load(pointer, align=8)

        result = pack_type if isinstance(like, PackType) else types.float64
        return result(like, array, row), generate

    @intrinsic
    def store(typing_context: Any, array: Any, row: Any, value: Any) -> Any:
        """Write a number or a pack into row ``row`` of ``array`` (rows, lanes)."""

        def generate(context: Any, builder: Any, signature: Any, args: Any) -> Any:
            array_type, row_type, _ = signature.args
            row = context.cast(builder, args[1], row_type, types.intp)
            if isinstance(value, PackType):
                row = builder.mul(row, ir.Constant(row.type, LANES))
            pointer = _row_pointer(context, builder, array_type, args[0], row)
            if isinstance(value, PackType):
                pointer = builder.bitcast(pointer, _VECTOR.as_pointer())
            builder.store(args[2], pointer, align=8)
            return context.get_dummy_value()

        return types.void(array, row, value), generate

    @intrinsic
    def larger(typing_context: Any, a: Any, b: Any) -> Any:
        """Larger of two numbers, lane by lane; ``b`` where either is NaN."""

        def generate(context: Any, builder: Any, signature: Any, args: Any) -> Any:
            return builder.select(builder.fcmp_ordered(">", args[0], args[1]), *args)

        return a(a, b), generate

    @intrinsic
    def magnitude(typing_context: Any, a: Any) -> Any:
        """Absolute value, lane by lane."""

        def generate(context: Any, builder: Any, signature: Any, args: Any) -> Any:
            kind = args[0].type
            name = f"llvm.fabs.{'f64' if kind == ir.DoubleType() else f'v{LANES}f64'}"
            kind = ir.FunctionType(kind, [kind])
            insert: Any = cgutils.get_or_insert_function
            return builder.call(insert(builder.module, kind, name), args)

        return a(a), generate

    def _arithmetic(instruction: str) -> Any:
        @intrinsic
        def operate(typing_context: Any, a: Any, b: Any) -> Any:
            def generate(context: Any, builder: Any, signature: Any, args: Any) -> Any:
                return getattr(builder, instruction)(*args)

            return pack_type(a, b), generate

        return operate

    def _overload(operation: Any, instruction: str) -> None:
        operate = _arithmetic(instruction)

        @overload(operation)
        def lanewise(a, b):  # type: ignore[no-untyped-def]
            if isinstance(a, PackType) and isinstance(b, PackType):
                return lambda a, b: operate(a, b)
            if isinstance(a, PackType) and isinstance(b, types.Float):
                return lambda a, b: operate(a, splat(b))
            if isinstance(a, types.Float) and isinstance(b, PackType):
                return lambda a, b: operate(splat(a), b)
            return None

    for _operation, _instruction in (
        (operator.add, "fadd"),
        (operator.sub, "fsub"),
        (operator.mul, "fmul"),
        (operator.truediv, "fdiv"),
    ):
        _overload(_operation, _instruction)
