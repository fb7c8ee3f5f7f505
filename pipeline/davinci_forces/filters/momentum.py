"""The observer of the generalised momentum (De Luca and Mattone 2003), the most common observer of the field.

    p = M dq,    dp/dt = tau - b + dM/dt dq - tau_ext
    tau_ext^ = z - K p,    dz/dt = K (tau - b + dM/dt dq + K p - z)

It returns the external effort through a first-order lag of 1 / K, without accelerations.  K is optimal for a random
walk of `q_tau` per sample with the noise of effort and velocity, so that all filters are tuned alike.
"""

from collections.abc import Iterator

import numpy as np

from davinci_forces.filters.problem import Block, NoiseModel, Recording, Tracked, column
from davinci_forces.maths.arrays import Array, row_blocks
from davinci_forces.maths.models.terms import bias

NAME = "Momentum observer"


def blocks(recording: Recording, noise: NoiseModel) -> Iterator[Block]:
    """Run the observer, exact for a drive that is constant over a sample."""
    from scipy.signal import lfilter

    N, T_s, state = recording.samples, recording.T_s, np.zeros(0)
    K, decay = gain(float(np.mean(column(recording, lambda part: part.joint.inertia))), T_s, noise)
    for rows in row_blocks(N):
        first = max(rows.start - 1, 0)
        beside = recording.part(slice(first, min(rows.stop + 1, N))).joint.inertia  # neighbours give its derivative
        joint, q, dq, _, tau, _, initial_std = recording.part(rows)
        M, inside = joint.inertia, slice(rows.start - first, rows.stop - first)
        p, inertia_rate_effort = M * dq, (np.gradient(beside, T_s)[inside] if N > 1 else np.zeros(1)) * dq
        drive = tau - bias(joint.coefficients, q, dq, 0.0)[0] - joint.known + inertia_rate_effort
        # z[k+1] = decay z[k] + (1 - decay) (drive[k] + K p[k]); z[0] = K p[0] stands for no external effort at first.
        state = state if rows.start else np.array([K * p[0]])
        z, state = lfilter([0.0, 1.0 - decay], [1.0, -decay], drive + K * p, zi=state)
        std = deviation(M, rows.start, K, decay, T_s, noise, initial_std)
        yield rows, Tracked(q, dq, z - K * p, std, *np.zeros((3, len(q))))


def gain(M: float, T_s: float, noise: NoiseModel) -> tuple[float, float]:
    """Compute K [1/s], and the factor by which the observer decays over a sample."""
    ratio = noise.q_tau * T_s / (M * float(np.hypot(noise.q_dq, noise.r_dq)))
    share = 0.5 * ratio * (np.sqrt(ratio**2 + 4.0) - ratio)
    return -float(np.log1p(-share)) / T_s, 1.0 - share


def deviation(M: Array, start: int, K: float, decay: float, T_s: float, noise: NoiseModel, initial_std: float) -> Array:
    """Compute the standard deviation (N,) from sample `start` on: lagged noise, and initial uncertainty."""
    ratio = (1.0 - decay) / (1.0 + decay)
    noise_var = ratio * (M * noise.q_dq / T_s) ** 2 + (1.0 + ratio) * (K * M * noise.r_dq) ** 2
    return np.asarray(np.sqrt(noise_var + (initial_std * decay ** np.arange(start, start + len(M))) ** 2))
