"""LLVM types, vectors with a lane for each vehicle, and the exponential in plain operations."""

from __future__ import annotations

from math import factorial, inf
from typing import Any

from llvmlite import ir

NUMBER = ir.DoubleType()
LOGICAL = ir.IntType(1)
INTEGER = ir.IntType(64)
CODE = ir.IntType(16)

LOG2_E = 1.4426950408889634
# ln 2 in two parts; the first ends in zero bits, so that k · LN2[0] is exact
LN2 = (6.93147180369123816490e-01, 1.90821492927058770002e-10)
ROUND_TO_INTEGER = 6755399441055744.0  # 1.5 · 2^52: adding it leaves no bits for a fraction
EXP_RANGE = (-708.0, 709.0)  # range in which the exponential is a normal number
# series of the exponential, exact to rounding for |x| ≤ ln 2 / 2
EXP_COEFFICIENTS = [1.0 / factorial(k) for k in range(14)]
BIAS, MANTISSA = 1023, 52  # bias of a float64's exponent, and the number of mantissa bits


def exponential(builder: ir.IRBuilder, x: Any) -> Any:
    """Return e^x = 2^k e^r with k the integer nearest to x / ln 2: a series for e^r, the bits of 2^k."""
    b, like = builder, x.type

    def c(value: float) -> Any:
        return filled(like, NUMBER(value))

    low, high = b.fcmp_ordered("<", x, c(EXP_RANGE[0])), b.fcmp_ordered(">", x, c(EXP_RANGE[1]))
    inside = b.select(low, c(EXP_RANGE[0]), b.select(high, c(EXP_RANGE[1]), x))
    k = b.fsub(b.fadd(b.fmul(inside, c(LOG2_E)), c(ROUND_TO_INTEGER)), c(ROUND_TO_INTEGER))
    r = b.fsub(b.fsub(inside, b.fmul(k, c(LN2[0]))), b.fmul(k, c(LN2[1])))
    series = c(EXP_COEFFICIENTS[-1])
    for coefficient in EXP_COEFFICIENTS[-2::-1]:
        series = b.fadd(b.fmul(series, r), c(coefficient))
    integers = shaped(like, INTEGER)
    biased = b.add(b.fptosi(k, integers), filled(integers, INTEGER(BIAS)))
    power = b.bitcast(b.shl(biased, filled(integers, INTEGER(MANTISSA))), like)
    return b.select(low, c(0.0), b.select(high, c(inf), b.fmul(series, power)))


def shaped(like: Any, type_: Any) -> Any:
    """Return a type with as many lanes as another."""
    return ir.VectorType(type_, like.count) if isinstance(like, ir.VectorType) else type_


def filled(type_: Any, constant: Any) -> Any:
    """Return a constant in every lane of a type."""
    return ir.Constant(type_, [constant] * type_.count) if isinstance(type_, ir.VectorType) else constant
