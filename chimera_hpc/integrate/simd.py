"""Packs: several lanes of float64 that one vector instruction works on.

A kernel is written once, over numbers; called with a ``float`` it works on one trajectory, called
with a `pack` it works on `LANES` of them, lane by lane with the very same IEEE operations in
the same order. That is why a trajectory has the same bits whatever its lane and its neighbours.

Arrays are (rows, lanes), C-contiguous. ``load(like, array, row)`` reads row ``row`` as the
kind of number that ``like`` is, ``store(array, row, value)`` writes it. A trajectory alone has its
rows one after the other in memory: there a pack is eight neighbouring rows, which `load_at`,
`load_some` and their partners reach by their offset, and sums over rows are added in eight turns
(`fold`) or in three levels (`SCAN`), an order that lanes side by side can keep too.

With ``NUMBA_DISABLE_JIT=1`` a pack is a NumPy array of `LANES` numbers.
"""

from __future__ import annotations

import ctypes
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


def _pointer(
    context: Any, builder: Any, signature: Any, args: Any, kind: str, first: int = 0
) -> Any:
    """Pointer into an array (rows, lanes), argument ``first``, at the place that follows it.

    ``kind`` says what the place counts and what is there: "number" and "pack" count numbers,
    "row" counts rows of packs.
    """
    array_type, at_type = signature.args[first : first + 2]
    offset = context.cast(builder, args[first + 1], at_type, types.intp)
    if kind == "row":
        offset = builder.mul(offset, ir.Constant(offset.type, LANES))
    struct = context.make_array(array_type)(context, builder, args[first])
    pointer = builder.gep(struct.data, [offset])
    return pointer if kind == "number" else builder.bitcast(pointer, _VECTOR.as_pointer())


def _spread(builder: Any, number: Any) -> Any:
    undefined = ir.Constant(_VECTOR, ir.Undefined)
    first = builder.insert_element(undefined, number, ir.Constant(ir.IntType(32), 0))
    mask = ir.Constant(ir.VectorType(ir.IntType(32), LANES), [0] * LANES)
    return builder.shuffle_vector(first, undefined, mask)


_NOTHING = ir.Constant(_VECTOR, [-0.0] * LANES)
SCAN = ((8, 0, 8, 2, 8, 4, 8, 6), (8, 8, 1, 1, 8, 8, 5, 5), (8, 8, 8, 8, 3, 3, 3, 3))
"""Running sums of eight in three levels: the place that is added to each place, 8 for none."""


def _places() -> Any:
    return ir.Constant(ir.VectorType(ir.IntType(64), LANES), list(range(LANES)))


def _spread_integer(builder: Any, number: Any) -> Any:
    kind = ir.VectorType(ir.IntType(64), LANES)
    first = builder.insert_element(ir.Constant(kind, ir.Undefined), number, ir.IntType(32)(0))
    mask = ir.Constant(ir.VectorType(ir.IntType(32), LANES), [0] * LANES)
    return builder.shuffle_vector(first, ir.Constant(kind, ir.Undefined), mask)


_config: Any = numba.config  # its attributes are made at run time
if _config.DISABLE_JIT:

    def splat(value: float) -> Any:
        """Give a pack with ``value`` in every lane."""
        return np.full(LANES, value)

    def load(like: Any, array: Any, row: int) -> Any:
        """Read row ``row`` of ``array`` (rows, lanes) as the kind of number ``like`` is."""
        return array[row, 0] if np.ndim(like) == 0 else load_at(array, row * LANES)

    def store(array: Any, row: int, value: Any) -> None:
        """Write a number or a pack into row ``row`` of ``array`` (rows, lanes)."""
        if np.ndim(value):
            store_at(array, row * LANES, value)
        else:
            array[row, 0] = value

    def across(like: Any, array: Any, row: int) -> Any:
        """Read the lanes' numbers as a pack; one lane's number stands in all places."""
        return np.full(LANES, array[row, 0]) if np.ndim(like) == 0 else array[row].copy()

    def load_at(array: Any, offset: int) -> Any:
        """Read a pack of neighbours from the numbers of ``array`` in the order of memory."""
        return array.reshape(-1)[offset : offset + LANES].copy()

    def store_at(array: Any, offset: int, pack: Any) -> None:
        """Write a pack over neighbours among the numbers of ``array`` in the order of memory."""
        array.reshape(-1)[offset : offset + LANES] = pack

    def load_some(array: Any, offset: int, low: int, high: int) -> Any:
        """Read places ``low <= j < high`` of a pack as `load_at` does; -0.0 elsewhere."""
        pack = np.full(LANES, -0.0)
        pack[low:high] = array.reshape(-1)[offset + low : offset + high]
        return pack

    def store_some(array: Any, offset: int, pack: Any, count: int) -> None:
        """Write the first ``count`` places of a pack as `store_at` does."""
        array.reshape(-1)[offset : offset + count] = pack[:count]

    def add_shifted(pack: Any, level: int) -> Any:
        """Do one level of `SCAN` within a pack."""
        source = np.array(SCAN[level])
        return pack + np.where(source < LANES, pack[source % LANES], -0.0)

    def last_of(pack: Any) -> Any:
        """Take the number in the last place of a pack."""
        return pack[LANES - 1]

    def fold(pack: Any) -> Any:
        """Add up a pack: halves onto each other until one number is left."""
        half = pack[:4] + pack[4:]
        quarter = half[:2] + half[2:]
        return quarter[0] + quarter[1]

    def stream_at(array: Any, offset: int, pack: Any) -> None:
        """Write as `store_at` does, past the caches; the place must begin a cache line."""
        store_at(array, offset, pack)

    def fetch(like: Any, array: Any, row: int) -> None:
        """Ask for row ``row``, which need not exist, to be in the first cache when it is used."""

    def transposed(*packs: Any) -> Any:
        """Turn eight packs round: pack m of the result holds place m of each."""
        return tuple(np.stack(packs).T.copy())

    _fused = ctypes.CDLL(None).fma  # of the C library
    _fused.restype, _fused.argtypes = ctypes.c_double, 3 * [ctypes.c_double]

    def fma(a: Any, b: Any, c: Any) -> Any:
        """Give ``a * b + c``, lane by lane, rounded once: IEEE 754's fusedMultiplyAdd."""
        columns = np.broadcast_arrays(a, b, c)
        each = [_fused(*numbers) for numbers in np.stack(columns).reshape(3, -1).T]
        return np.array(each) if len(each) > 1 else np.float64(each[0])

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
            return _spread(builder, args[0])

        return pack_type(types.float64), generate

    @intrinsic
    def load(typing_context: Any, like: Any, array: Any, row: Any) -> Any:
        """Read row ``row`` of ``array`` (rows, lanes) as the kind of number ``like`` is."""

        def generate(context: Any, builder: Any, signature: Any, args: Any) -> Any:
            kind = "row" if isinstance(like, PackType) else "number"
            pointer = _pointer(context, builder, signature, args, kind, first=1)
            return builder.load(pointer, align=8)

        result = pack_type if isinstance(like, PackType) else types.float64
        return result(like, array, row), generate

    @intrinsic
    def across(typing_context: Any, like: Any, array: Any, row: Any) -> Any:
        """Read the lanes' numbers as a pack; one lane's number stands in all places."""

        def generate(context: Any, builder: Any, signature: Any, args: Any) -> Any:
            kind = "row" if isinstance(like, PackType) else "number"
            pointer = _pointer(context, builder, signature, args, kind, first=1)
            value = builder.load(pointer, align=8)
            return value if kind == "row" else _spread(builder, value)

        return pack_type(like, array, row), generate

    @intrinsic
    def load_at(typing_context: Any, array: Any, offset: Any) -> Any:
        """Read a pack of neighbours from the numbers of ``array`` in the order of memory."""

        def generate(context: Any, builder: Any, signature: Any, args: Any) -> Any:
            pointer = _pointer(context, builder, signature, args, "pack")
            return builder.load(pointer, align=8)

        return pack_type(array, offset), generate

    @intrinsic
    def store_at(typing_context: Any, array: Any, offset: Any, pack: Any) -> Any:
        """Write a pack over neighbours among the numbers of ``array`` in the order of memory."""

        def generate(context: Any, builder: Any, signature: Any, args: Any) -> Any:
            pointer = _pointer(context, builder, signature, args, "pack")
            builder.store(args[2], pointer, align=8)
            return context.get_dummy_value()

        return types.void(array, offset, pack), generate

    @intrinsic
    def stream_at(typing_context: Any, array: Any, offset: Any, pack: Any) -> Any:
        """Write as `store_at` does, past the caches; the place must begin a cache line."""

        def generate(context: Any, builder: Any, signature: Any, args: Any) -> Any:
            pointer = _pointer(context, builder, signature, args, "pack")
            write = builder.store(args[2], pointer, align=8 * LANES)
            write.set_metadata("nontemporal", builder.module.add_metadata([ir.IntType(32)(1)]))
            return context.get_dummy_value()

        return types.void(array, offset, pack), generate

    @intrinsic
    def fetch(typing_context: Any, like: Any, array: Any, row: Any) -> Any:
        """Ask for row ``row``, which need not exist, to be in the first cache when it is used."""

        def generate(context: Any, builder: Any, signature: Any, args: Any) -> Any:
            kind = "row" if isinstance(like, PackType) else "number"
            pointer = _pointer(context, builder, signature, args, kind, first=1)
            pointer = builder.bitcast(pointer, ir.IntType(8).as_pointer())
            # To be read, kept in all caches, data: what a processor has of its own it may write.
            options = map(ir.IntType(32), (0, 3, 1))
            kind = ir.FunctionType(ir.VoidType(), [pointer.type, *3 * [ir.IntType(32)]])
            insert: Any = cgutils.get_or_insert_function
            builder.call(insert(builder.module, kind, "llvm.prefetch.p0"), [pointer, *options])
            return context.get_dummy_value()

        return types.void(like, array, row), generate

    @intrinsic
    def load_some(typing_context: Any, array: Any, offset: Any, low: Any, high: Any) -> Any:
        """Read places ``low <= j < high`` of a pack as `load_at` does; -0.0 elsewhere."""

        def generate(context: Any, builder: Any, signature: Any, args: Any) -> Any:
            pointer = _pointer(context, builder, signature, args, "pack")
            bounds = zip(args[2:], signature.args[2:], strict=True)
            low, high = (context.cast(builder, n, kind, types.intp) for n, kind in bounds)
            mask = builder.and_(
                builder.icmp_signed(">=", _places(), _spread_integer(builder, low)),
                builder.icmp_signed("<", _places(), _spread_integer(builder, high)),
            )
            kind = ir.FunctionType(_VECTOR, [pointer.type, ir.IntType(32), mask.type, _VECTOR])
            insert: Any = cgutils.get_or_insert_function
            function = insert(builder.module, kind, f"llvm.masked.load.v{LANES}f64.p0")
            return builder.call(function, [pointer, ir.IntType(32)(8), mask, _NOTHING])

        return pack_type(array, offset, low, high), generate

    @intrinsic
    def store_some(typing_context: Any, array: Any, offset: Any, pack: Any, count: Any) -> Any:
        """Write the first ``count`` places of a pack as `store_at` does."""

        def generate(context: Any, builder: Any, signature: Any, args: Any) -> Any:
            count = context.cast(builder, args[3], signature.args[3], types.intp)
            pointer = _pointer(context, builder, signature, args, "pack")
            mask = builder.icmp_signed("<", _places(), _spread_integer(builder, count))
            kind = ir.FunctionType(
                ir.VoidType(), [_VECTOR, pointer.type, ir.IntType(32), mask.type]
            )
            insert: Any = cgutils.get_or_insert_function
            function = insert(builder.module, kind, f"llvm.masked.store.v{LANES}f64.p0")
            builder.call(function, [args[2], pointer, ir.IntType(32)(8), mask])
            return context.get_dummy_value()

        return types.void(array, offset, pack, count), generate

    @intrinsic(prefer_literal=True)
    def add_shifted(typing_context: Any, pack: Any, level: Any) -> Any:
        """Do one level of `SCAN` within a pack."""
        places = SCAN[level.literal_value]

        def generate(context: Any, builder: Any, signature: Any, args: Any) -> Any:
            mask = ir.Constant(ir.VectorType(ir.IntType(32), LANES), list(places))
            return builder.fadd(args[0], builder.shuffle_vector(args[0], _NOTHING, mask))

        return pack_type(pack, level), generate

    @intrinsic
    def last_of(typing_context: Any, pack: Any) -> Any:
        """Take the number in the last place of a pack."""

        def generate(context: Any, builder: Any, signature: Any, args: Any) -> Any:
            return builder.extract_element(args[0], ir.IntType(32)(LANES - 1))

        return types.float64(pack), generate

    @intrinsic
    def fold(typing_context: Any, pack: Any) -> Any:
        """Add up a pack: halves onto each other until one number is left."""

        def generate(context: Any, builder: Any, signature: Any, args: Any) -> Any:
            total, width = args[0], LANES
            while width > 1:
                width //= 2
                low = [ir.Constant(ir.IntType(32), j) for j in range(width)]
                high = [ir.Constant(ir.IntType(32), j + width) for j in range(width)]
                kind = ir.VectorType(ir.IntType(32), width)
                parts = (
                    builder.shuffle_vector(total, total, ir.Constant(kind, half))
                    for half in (low, high)
                )
                total = builder.fadd(*parts)
            return builder.extract_element(total, ir.Constant(ir.IntType(32), 0))

        return types.float64(pack), generate

    @intrinsic
    def transposed(
        typing_context: Any, p0: Any, p1: Any, p2: Any, p3: Any, p4: Any, p5: Any, p6: Any, p7: Any
    ) -> Any:
        """Turn eight packs round: pack m of the result holds place m of each."""

        def generate(context: Any, builder: Any, signature: Any, args: Any) -> Any:
            # Blocks of 1, 2, then 4 places change sides between packs that are as far apart.
            packs = list(args)
            for width in (1, 2, 4):
                # Places of the lower and the upper pack of a pair; from 8 on they are the upper's.
                low = [place & ~width | (LANES if place & width else 0) for place in range(LANES)]
                high = [place + width for place in low]
                kind = ir.VectorType(ir.IntType(32), LANES)
                for j in range(LANES):
                    if not j & width:
                        pair = packs[j], packs[j + width]
                        packs[j] = builder.shuffle_vector(*pair, ir.Constant(kind, low))
                        packs[j + width] = builder.shuffle_vector(*pair, ir.Constant(kind, high))
            return context.make_tuple(builder, signature.return_type, packs)

        result = types.UniTuple(pack_type, LANES)  # type: ignore[no-untyped-call]
        return result(p0, p1, p2, p3, p4, p5, p6, p7), generate

    @intrinsic
    def store(typing_context: Any, array: Any, row: Any, value: Any) -> Any:
        """Write a number or a pack into row ``row`` of ``array`` (rows, lanes)."""

        def generate(context: Any, builder: Any, signature: Any, args: Any) -> Any:
            kind = "row" if isinstance(value, PackType) else "number"
            pointer = _pointer(context, builder, signature, args, kind)
            builder.store(args[2], pointer, align=8)
            return context.get_dummy_value()

        return types.void(array, row, value), generate

    @intrinsic
    def fma(typing_context: Any, a: Any, b: Any, c: Any) -> Any:
        """Give ``a * b + c``, lane by lane, rounded once: IEEE 754's fusedMultiplyAdd."""
        result = pack_type if pack_type in (a, b, c) else types.float64

        def generate(context: Any, builder: Any, signature: Any, args: Any) -> Any:
            if result is pack_type:
                args = [n if n.type == _VECTOR else _spread(builder, n) for n in args]
            kind = ir.FunctionType(args[0].type, [args[0].type] * 3)
            name = f"llvm.fma.{f'v{LANES}f64' if result is pack_type else 'f64'}"
            insert: Any = cgutils.get_or_insert_function
            return builder.call(insert(builder.module, kind, name), args)

        return result(*(n if n == pack_type else types.float64 for n in (a, b, c))), generate

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
