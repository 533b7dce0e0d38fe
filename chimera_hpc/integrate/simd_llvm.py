"""The functions of `simd` for compiled kernels: a vector is an LLVM vector of `LANES` float64."""

import operator

from llvmlite import ir
from numba import types
from numba.core import cgutils
from numba.extending import (
    intrinsic,
    models,
    overload,
    register_model,
)

from chimera_hpc.integrate.simd_constants import LANES, SCAN


class VectorType(types.Type):
    """numba's type of `LANES` float64 held in one LLVM vector."""

    def __init__(self):
        super().__init__(name=f"vector{LANES}")


vector_type = VectorType()
_DOUBLE, _INT32, _INT64 = ir.DoubleType(), ir.IntType(32), ir.IntType(64)
_VECTOR = ir.VectorType(_DOUBLE, LANES)
_NOTHING = ir.Constant(_VECTOR, [-0.0] * LANES)


@register_model(VectorType)
class _VectorModel(models.PrimitiveModel):
    def __init__(self, manager, vector):
        super().__init__(manager, vector, _VECTOR)


def _places(numbers):
    """Return a constant vector of indices for LLVM's shuffles."""
    numbers = list(numbers)
    return ir.Constant(ir.VectorType(_INT32, len(numbers)), numbers)


def _pointer(context, builder, signature, args, kind, first=0):
    """Return a pointer into an array (rows, lanes).

    The array is argument ``first``, the offset is the argument after it. With ``kind`` "number" or
    "vector", the offset counts numbers and the pointer is to that type. With "row", the offset
    counts rows, which are vectors.
    """
    array_type, at_type = signature.args[first : first + 2]
    offset = context.cast(builder, args[first + 1], at_type, types.intp)
    if kind == "row":
        offset = builder.mul(offset, ir.Constant(offset.type, LANES))
    struct = context.make_array(array_type)(context, builder, args[first])
    pointer = builder.gep(struct.data, [offset])
    return pointer if kind == "number" else builder.bitcast(pointer, _VECTOR.as_pointer())


def _kind_of(like):
    return "row" if isinstance(like, VectorType) else "number"


def _broadcast(builder, number):
    """Return a vector with an LLVM number, float64 or int64, in every lane."""
    undefined = ir.Constant(ir.VectorType(number.type, LANES), ir.Undefined)
    first = builder.insert_element(undefined, number, _INT32(0))
    return builder.shuffle_vector(first, undefined, _places([0] * LANES))


def _places_from(builder, condition, number):
    """Return the mask of the elements j with ``j condition number``."""
    places = ir.Constant(ir.VectorType(_INT64, LANES), list(range(LANES)))
    return builder.icmp_signed(condition, places, _broadcast(builder, number))


def _call(builder, name, result, args):
    """Call an intrinsic function of LLVM."""
    kind = ir.FunctionType(result, [arg.type for arg in args])
    return builder.call(cgutils.get_or_insert_function(builder.module, kind, name), args)


@intrinsic
def broadcast(typing_context, value):
    """Return a vector with ``value`` in every lane."""

    def generate(context, builder, signature, args):
        return _broadcast(builder, args[0])

    return vector_type(types.float64), generate


@intrinsic
def load(typing_context, like, array, row):
    """Read row ``row`` of ``array`` (rows, lanes) as the type of ``like``."""

    def generate(context, builder, signature, args):
        pointer = _pointer(context, builder, signature, args, _kind_of(like), first=1)
        return builder.load(pointer, align=8)

    result = vector_type if isinstance(like, VectorType) else types.float64
    return result(like, array, row), generate


@intrinsic
def store(typing_context, array, row, value):
    """Write a number or a vector into row ``row`` of ``array`` (rows, lanes)."""

    def generate(context, builder, signature, args):
        pointer = _pointer(context, builder, signature, args, _kind_of(value))
        builder.store(args[2], pointer, align=8)
        return context.get_dummy_value()

    return types.void(array, row, value), generate


@intrinsic
def across(typing_context, like, array, row):
    """Read the lanes' numbers as a vector. The number of a single lane is broadcast."""

    def generate(context, builder, signature, args):
        kind = _kind_of(like)
        pointer = _pointer(context, builder, signature, args, kind, first=1)
        value = builder.load(pointer, align=8)
        return value if kind == "row" else _broadcast(builder, value)

    return vector_type(like, array, row), generate


@intrinsic
def load_at(typing_context, array, offset):
    """Read `LANES` contiguous numbers of ``array``."""

    def generate(context, builder, signature, args):
        pointer = _pointer(context, builder, signature, args, "vector")
        return builder.load(pointer, align=8)

    return vector_type(array, offset), generate


@intrinsic
def store_at(typing_context, array, offset, vector):
    """Write a vector to contiguous numbers of ``array``."""

    def generate(context, builder, signature, args):
        pointer = _pointer(context, builder, signature, args, "vector")
        builder.store(args[2], pointer, align=8)
        return context.get_dummy_value()

    return types.void(array, offset, vector), generate


@intrinsic
def integer_at(typing_context, array, offset):
    """Read one number of an int64 ``array``; the offset must not be negative."""

    def generate(context, builder, signature, args):
        return builder.load(_pointer(context, builder, signature, args, "number"), align=8)

    return types.int64(array, offset), generate


@intrinsic
def real_at(typing_context, array, offset):
    """Read the bits of one number of an int64 ``array`` as a float64."""

    def generate(context, builder, signature, args):
        pointer = _pointer(context, builder, signature, args, "number")
        return builder.load(builder.bitcast(pointer, _DOUBLE.as_pointer()), align=8)

    return types.float64(array, offset), generate


@intrinsic
def stream_at(typing_context, array, offset, vector):
    """Write as `store_at` does, but bypass the caches. The address must start a cache line."""

    def generate(context, builder, signature, args):
        pointer = _pointer(context, builder, signature, args, "vector")
        write = builder.store(args[2], pointer, align=8 * LANES)
        write.set_metadata("nontemporal", builder.module.add_metadata([_INT32(1)]))
        return context.get_dummy_value()

    return types.void(array, offset, vector), generate


@intrinsic
def load_some(typing_context, array, offset, low, high):
    """Read elements ``low <= j < high`` of a vector as `load_at` does; -0.0 elsewhere."""

    def generate(context, builder, signature, args):
        pointer = _pointer(context, builder, signature, args, "vector")
        bounds = zip(args[2:], signature.args[2:], strict=True)
        low, high = (context.cast(builder, n, kind, types.intp) for n, kind in bounds)
        mask = builder.and_(_places_from(builder, ">=", low), _places_from(builder, "<", high))
        arguments = [pointer, _INT32(8), mask, _NOTHING]
        return _call(builder, f"llvm.masked.load.v{LANES}f64.p0", _VECTOR, arguments)

    return vector_type(array, offset, low, high), generate


@intrinsic
def store_some(typing_context, array, offset, vector, count):
    """Write the first ``count`` elements of a vector as `store_at` does."""

    def generate(context, builder, signature, args):
        count = context.cast(builder, args[3], signature.args[3], types.intp)
        pointer = _pointer(context, builder, signature, args, "vector")
        arguments = [args[2], pointer, _INT32(8), _places_from(builder, "<", count)]
        _call(builder, f"llvm.masked.store.v{LANES}f64.p0", ir.VoidType(), arguments)
        return context.get_dummy_value()

    return types.void(array, offset, vector, count), generate


@intrinsic(prefer_literal=True)
def add_shifted(typing_context, vector, level):
    """Do one level of `SCAN` within a vector."""
    mask = _places(SCAN[level.literal_value])

    def generate(context, builder, signature, args):
        return builder.fadd(args[0], builder.shuffle_vector(args[0], _NOTHING, mask))

    return vector_type(vector, level), generate


@intrinsic
def last_of(typing_context, vector):
    """Return the last element of a vector."""

    def generate(context, builder, signature, args):
        return builder.extract_element(args[0], _INT32(LANES - 1))

    return types.float64(vector), generate


@intrinsic
def fold(typing_context, vector):
    """Sum a vector: add its halves until one number is left."""

    def generate(context, builder, signature, args):
        total, width = args[0], LANES
        while width > 1:
            width //= 2
            low = builder.shuffle_vector(total, total, _places(range(width)))
            high = builder.shuffle_vector(total, total, _places(range(width, 2 * width)))
            total = builder.fadd(low, high)
        return builder.extract_element(total, _INT32(0))

    return types.float64(vector), generate


@intrinsic
def transposed(typing_context, vectors):
    """Transpose eight vectors: vector m of the result holds element m of each."""

    def generate(context, builder, signature, args):
        rows = cgutils.unpack_tuple(builder, args[0], LANES)
        for width in (1, 2, 4):
            # Swaps blocks of `width` elements between rows that are `width` apart. Indices from
            # `LANES` on refer to the higher row.
            low = [place & ~width | (LANES if place & width else 0) for place in range(LANES)]
            high = [place + width for place in low]
            for j in range(LANES):
                if not j & width:
                    pair = rows[j], rows[j + width]
                    rows[j] = builder.shuffle_vector(*pair, _places(low))
                    rows[j + width] = builder.shuffle_vector(*pair, _places(high))
        return context.make_tuple(builder, signature.return_type, rows)

    return vectors(vectors), generate


@intrinsic
def fma(typing_context, a, b, c):
    """Return ``a * b + c``, lane by lane, rounded once: IEEE 754's fusedMultiplyAdd."""
    result = vector_type if vector_type in (a, b, c) else types.float64

    def generate(context, builder, signature, args):
        if result is vector_type:
            args = [n if n.type == _VECTOR else _broadcast(builder, n) for n in args]
        name = f"llvm.fma.{f'v{LANES}f64' if result is vector_type else 'f64'}"
        return _call(builder, name, args[0].type, list(args))

    return result(*(n if n == vector_type else types.float64 for n in (a, b, c))), generate


@intrinsic
def larger(typing_context, a, b):
    """Return the larger of two numbers, lane by lane; ``b`` where either is NaN."""

    def generate(context, builder, signature, args):
        return builder.select(builder.fcmp_ordered(">", args[0], args[1]), *args)

    return a(a, b), generate


@intrinsic
def magnitude(typing_context, a):
    """Return the absolute value, lane by lane."""

    def generate(context, builder, signature, args):
        name = f"llvm.fabs.{'f64' if args[0].type == _DOUBLE else f'v{LANES}f64'}"
        return _call(builder, name, args[0].type, list(args))

    return a(a), generate


def _arithmetic(instruction):
    @intrinsic
    def operate(typing_context, a, b):
        def generate(context, builder, signature, args):
            return getattr(builder, instruction)(*args)

        return vector_type(a, b), generate

    return operate


def _overload(operation, instruction):
    operate = _arithmetic(instruction)

    @overload(operation)
    def lanewise(a, b):
        if isinstance(a, VectorType) and isinstance(b, VectorType):
            return lambda a, b: operate(a, b)
        if isinstance(a, VectorType) and isinstance(b, types.Float):
            return lambda a, b: operate(a, broadcast(b))
        if isinstance(a, types.Float) and isinstance(b, VectorType):
            return lambda a, b: operate(broadcast(a), b)
        return None


for _operation, _instruction in (
    (operator.add, "fadd"),
    (operator.sub, "fsub"),
    (operator.mul, "fmul"),
    (operator.truediv, "fdiv"),
):
    _overload(_operation, _instruction)
