"""The results of a simulation: motion and efforts."""

from dataclasses import dataclass

from davinci_forces.maths.arrays import Array


@dataclass(frozen=True)
class SimulatedMotion:
    """What truly happened at one joint, at the recorder's instants; every array is (N,)."""

    q: Array
    dq: Array
    tau: Array  # what the motor gave
    tau_ext: Array  # what the joint exerted on its surroundings


@dataclass(frozen=True)
class SimulatedRun:
    """What truly happened in one recording: its clock (N,) [s], its joints, and the tip where it is known."""

    t: Array
    motions: dict[str, SimulatedMotion]
    force: Array | None = None  # (N, 3) [N] of the tip on its surroundings, base frame
