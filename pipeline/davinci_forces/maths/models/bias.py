"""The bias of one joint, in functions that run on arrays of samples and, compiled, sample by sample.

    b(q, dq) = c_1 + c_s sin q + c_c cos q + c_q q + c_v dq + c_f sign(dq) + c_z z                     (7.15), (7.16)

with z the deflection of the friction's presliding element, which the measured motion drives (Dahl 1968):

    z+ = s - (s - z) exp(-|dq| T_s / x_0),        s = sign(dq)

exact over a sample at constant velocity.  Coefficients are a tuple in the order of `COEFFICIENTS`.
"""

from typing import Any

import numpy as np

COEFFICIENTS = ("1", "sin q", "cos q", "q", "dq", "sign(dq)", "z")
VISCOUS, COULOMB = COEFFICIENTS.index("dq"), COEFFICIENTS.index("sign(dq)")
Coefficients = tuple[float, float, float, float, float, float, float]


def bias(c: Coefficients, q: Any, dq: Any, z: Any) -> tuple[Any, Any, Any]:
    """b and its derivatives by q and dq, of floats or of arrays of one shape.

    The jump of sign(dq) has no derivative; it is taken as zero, as section 7.1.2 does.
    """
    sine, cosine = np.sin(q), np.cos(q)
    b = c[0] + c[1] * sine + c[2] * cosine + c[3] * q + c[4] * dq + c[5] * np.sign(dq) + c[6] * z
    return b, c[1] * cosine - c[2] * sine + c[3], c[4]


def deflect(z: Any, dq: Any, T_s: float, x_0: float) -> Any:
    """The deflection z, -1 to 1, one sampling time T_s [s] later; it reverses within the displacement `x_0`."""
    side = np.sign(dq)
    return side - (side - z) * np.exp(-np.abs(dq) * T_s / x_0)
