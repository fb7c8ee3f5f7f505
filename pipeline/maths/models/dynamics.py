"""The dynamics of one joint, in both directions, from its terms and their parameters."""

import math
from collections.abc import Callable, Sequence
from types import CodeType

import numpy as np

from pipeline.maths.arrays import Array
from pipeline.maths.constants import GRAVITY
from pipeline.maths.models.terms import Term

ScalarBias = Callable[[float, float], tuple[float, float, float]]

_ARRAYS = {"g": GRAVITY, "sin": np.sin, "cos": np.cos, "tanh": np.tanh, "exp": np.exp, "sign": np.sign, "abs": np.abs}
_SCALARS = {"g": GRAVITY, "sin": math.sin, "cos": math.cos, "tanh": math.tanh, "exp": math.exp, "abs": abs}


def regressor(terms: Sequence[Term], q: Array, dq: Array, ddq: Array) -> Array:
    """Phi, with tau = Phi theta.

    `q`, `dq` and `ddq` are (K,) in the joint's units; returns (K, p) for p terms.  (6.9), (6.12), (6.14), (6.38)
    """
    return np.column_stack([term.a * ddq + _on_arrays(term.b, q, dq) for term in terms])


def inverse(terms: Sequence[Term], theta: Array, q: Array, dq: Array, ddq: Array) -> Array:
    """The effort (K,) that produces this motion with nothing touching the robot.  (7.27)"""
    return np.asarray(regressor(terms, q, dq, ddq) @ theta)


def forward(terms: Sequence[Term], theta: Array, q: Array, dq: Array, tau: Array) -> Array:
    """The acceleration (K,) that this effort produces.  (4.41)"""
    return np.asarray((tau - regressor(terms, q, dq, np.zeros_like(q)) @ theta) / mass(terms, theta))


def mass(terms: Sequence[Term], theta: Array) -> float:
    """What multiplies the acceleration: M, constant for a joint that moves alone.  (6.5)"""
    return float(sum(p * term.a for p, term in zip(theta, terms, strict=True)))


def scalar_bias(terms: Sequence[Term], theta: Array) -> ScalarBias:
    """A function of two floats that gives b = V + F + G and its derivatives by q and dq.  (7.15), (7.16)

    It is written out from the terms' expressions with the parameters as numbers, so that numba compiles it and
    plain Python runs it as it stands, and both do the same arithmetic in the same order.
    """
    lines = ["def bias(q, dq):", "    sign = (1.0 if dq > 0.0 else 0.0) - (1.0 if dq < 0.0 else 0.0)"]
    for part in ("b", "b_q", "b_dq"):
        weighted = [f"{float(p)!r} * ({_scalar(getattr(term, part))})" for p, term in zip(theta, terms, strict=True)]
        lines.append(f"    {part} = " + " + ".join(weighted))
    lines.append("    return b, b_q, b_dq")
    namespace: dict[str, object] = dict(_SCALARS)
    exec("\n".join(lines), namespace)
    return namespace["bias"]  # type: ignore[return-value]


def _scalar(expression: str) -> str:
    return expression.replace("sign(dq)", "sign")


def _on_arrays(expression: str, q: Array, dq: Array) -> Array:
    return np.asarray(eval(_compiled(expression), {**_ARRAYS, "q": q, "dq": dq})) * np.ones_like(q)


def _compiled(expression: str) -> CodeType:
    return compile(expression, "<term>", "eval")
