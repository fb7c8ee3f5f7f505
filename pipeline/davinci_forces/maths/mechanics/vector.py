"""A number of compiled code that holds several samples, so that the processor computes with all of them at once.

It adds, subtracts, multiplies and negates like a float, with floats, too.  Import this module only beside kernels.
"""

import operator
from collections.abc import Callable
from typing import Any

from numba import types
from numba.core.cgutils import ir  # the compiler's own instructions
from numba.extending import intrinsic, lower_builtin, models, register_model, type_callable

LANES = 4  # samples
_INDEX = ir.IntType(32)
_VECTOR = ir.VectorType(ir.DoubleType(), LANES)
_STORED = ir.ArrayType(ir.DoubleType(), LANES)  # in memory, where it need not lie at a multiple of its size


class Vector(types.Type):  # type: ignore[misc]
    """LANES numbers of double precision."""

    def __init__(self) -> None:
        super().__init__(name=f"Vector{LANES}")


vector = Vector()


@register_model(Vector)
class _Model(models.PrimitiveModel):  # type: ignore[misc]
    def __init__(self, manager: Any, kind: Any) -> None:
        super().__init__(manager, kind, _VECTOR)

    def get_data_type(self) -> Any:
        return _STORED

    def as_data(self, builder: Any, value: Any) -> Any:
        stored = ir.Constant(_STORED, ir.Undefined)
        for lane in range(LANES):
            stored = builder.insert_value(stored, builder.extract_element(value, _INDEX(lane)), lane)
        return stored

    def from_data(self, builder: Any, stored: Any) -> Any:
        return _joined(builder, [builder.extract_value(stored, lane) for lane in range(LANES)])


def _joined(builder: Any, numbers: list[Any]) -> Any:
    """A vector of LANES numbers."""
    value = ir.Constant(_VECTOR, ir.Undefined)
    for lane, number in enumerate(numbers):
        value = builder.insert_element(value, number, _INDEX(lane))
    return value


def _define(operation: Callable[..., Any], instruction: str) -> None:
    """Let two numbers, at least one of them a vector, be operands."""

    @type_callable(operation)  # type: ignore[untyped-decorator]
    def _(context: Any) -> Callable[[Any, Any], Any]:
        def kind(a: Any, b: Any) -> Any:
            return vector if vector in (a, b) and {a, b} <= {vector, types.float64} else None

        return kind

    def emit(context: Any, builder: Any, signature: Any, operands: Any) -> Any:
        kinds = zip(operands, signature.args, strict=True)
        a, b = (x if kind == vector else _joined(builder, [x] * LANES) for x, kind in kinds)
        return getattr(builder, instruction)(a, b)

    for kinds in ((vector, vector), (vector, types.float64), (types.float64, vector)):
        lower_builtin(operation, *kinds)(emit)


for _operation, _instruction in ((operator.add, "fadd"), (operator.sub, "fsub"), (operator.mul, "fmul")):
    _define(_operation, _instruction)


@type_callable(operator.neg)  # type: ignore[untyped-decorator]
def _(context: Any) -> Callable[[Any], Any]:
    return lambda a: vector if a == vector else None


@lower_builtin(operator.neg, vector)  # type: ignore[untyped-decorator]
def _(context: Any, builder: Any, signature: Any, operands: Any) -> Any:
    return builder.fneg(operands[0])


def _places(context: Any, builder: Any, array: Any, kind: Any, start: Any, stride: Any) -> list[Any]:
    """Where LANES numbers of an array are, from `start` on, `stride` apart."""
    data, places = context.make_array(kind)(context, builder, array).data, []
    for _ in range(LANES):
        places.append(builder.gep(data, [start]))
        start = builder.add(start, stride)
    return places


@intrinsic  # type: ignore[untyped-decorator]
def gather(typing_context: Any, array: Any, start: Any, stride: Any) -> Any:
    """LANES numbers of a contiguous array."""

    def emit(context: Any, builder: Any, signature: Any, operands: Any) -> Any:
        places = _places(context, builder, operands[0], signature.args[0], *operands[1:])
        return _joined(builder, [builder.load(place) for place in places])

    return vector(array, types.intp, types.intp), emit


@intrinsic  # type: ignore[untyped-decorator]
def scatter(typing_context: Any, array: Any, start: Any, stride: Any, numbers: Any) -> Any:
    """Put LANES numbers into a contiguous array."""

    def emit(context: Any, builder: Any, signature: Any, operands: Any) -> Any:
        places = _places(context, builder, operands[0], signature.args[0], *operands[1:3])
        for lane, place in enumerate(places):
            builder.store(builder.extract_element(operands[3], _INDEX(lane)), place)
        return context.get_dummy_value()

    return types.void(array, types.intp, types.intp, vector), emit
