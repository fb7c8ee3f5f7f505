"""Compute exact velocities and accelerations of every averaged period from its harmonics."""

from collections.abc import Iterator

import numpy as np

from davinci_forces.maths.periods import harmonics as fourier
from davinci_forces.records import Average, Column, Diagnostic, Spectrum, Trajectory, diagnostic
from davinci_forces.robots.robot import Joint


def run(average: Average, joint: Joint, *, harmonics: int) -> Iterator[Trajectory | Spectrum | Diagnostic]:
    """Compute position, velocity and acceleration from the harmonics of the excitation.  (6.34)

    With `harmonics` 0 these are the joint's, and more where the motion itself has more.
    """
    amplitude = fourier.amplitudes(average.q)
    orders = harmonics or max(joint.harmonics, fourier.last_above(amplitude))
    q, dq, ddq = derivatives(average, orders)
    yield Trajectory.like(average, harmonics=orders, q=q, dq=dq, ddq=ddq)
    yield Spectrum(average.log, average.joint, orders, np.arange(len(amplitude)) / average.period, amplitude)
    largest, share = fourier.largest_omitted(amplitude, orders)
    if share > fourier.MIN_SHARE:
        what = f"harmonic {largest} of the position is {share:.1%} of the largest, but only {orders} harmonics are kept"
        text = f"{average.log}/{average.joint}: {what}; raise `harmonics` in [settings] if it was commanded"
        yield diagnostic("differentiate", f"{average.log}.{average.joint}", "warning", text)


def derivatives(average: Average, harmonics: int) -> Iterator[Column]:
    """Position, velocity and acceleration (K,) from the first harmonics of an averaged position.  (6.34)"""
    omega = 2 * np.pi / average.period
    kept = fourier.Harmonics(average.t, omega, harmonics)
    c = kept.project(average.q)
    for _ in range(3):
        yield kept.evaluate(c)
        c = fourier.derivative(c, omega)
