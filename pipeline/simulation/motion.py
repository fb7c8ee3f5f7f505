"""What a simulation found out."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Motion:
    """What truly happened at one joint, at the recorder's instants; every array is (N,)."""

    q: Array
    dq: Array
    tau: Array  # what the motor gave
    tau_ext: Array  # what the joint exerted on its surroundings


@dataclass(frozen=True)
class Run:
    """What truly happened in one recording: its clock (N,) [s], its joints, and the tip where it is known."""

    t: Array
    motions: dict[str, Motion]
    force: Array | None = None  # (N, 3) [N] of the tip on its surroundings, base frame
