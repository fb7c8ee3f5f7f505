"""The deflection along a motion, compiled; imported where it is used, since that takes time."""

from typing import Any

from davinci_forces.maths.compiled import compile_and_store, inline
from davinci_forces.maths.models import terms

deflect = inline(terms.deflect)


@compile_and_store
def deflections(dq: Any, T_s: float, x_0: float, z: float, out: Any) -> None:
    """Write the deflection at each sample (N,) of velocities dq (N,), from z at the first."""
    for k in range(len(dq)):
        out[k] = z
        z = deflect(z, dq[k], T_s, x_0)
