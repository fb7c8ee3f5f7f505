"""The bias of one joint: functions for arrays of samples; `filters.sample` has those of one sample.

    b(q, dq) = c_1 + c_s sin q + c_c cos q + c_q q + c_v dq + c_f sign(dq) + c_z z                     (7.15), (7.16)

z is the deflection of the presliding friction, which follows from the measured motion (Dahl 1968):

    z+ = s - (s - z) exp(-|dq| T_s / x_0),        s = sign(dq)

This is exact for constant velocity over a sample.  Coefficients are a tuple in the order of `COEFFICIENTS`.
"""

from typing import Any

import numpy as np

COEFFICIENTS = ("1", "sin q", "cos q", "q", "dq", "sign(dq)", "z")
VISCOUS, COULOMB = COEFFICIENTS.index("dq"), COEFFICIENTS.index("sign(dq)")
Coefficients = tuple[float, ...]


def bias(c: Coefficients, q: Any, dq: Any, z: Any) -> tuple[Any, Any, Any]:
    """b and its derivatives by q and dq, for floats or for arrays of one shape.

    The derivative of sign(dq) is taken as zero, as in section 7.1.2.
    """
    sine, cosine = np.sin(q), np.cos(q)
    b = c[0] + c[1] * sine + c[2] * cosine + c[3] * q + c[4] * dq + c[5] * np.sign(dq) + c[6] * z
    return b, c[1] * cosine - c[2] * sine + c[3], c[4]


def deflect(z: Any, dq: Any, T_s: float, x_0: float) -> Any:
    """The deflection z, -1 to 1, one sampling time T_s [s] later; it reverses within the displacement `x_0`."""
    sign = np.sign(dq)
    return sign - (sign - z) * np.exp(-np.abs(dq) * T_s / x_0)
