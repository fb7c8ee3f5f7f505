"""The smoother: every state estimated from the whole recording, before and after it.

The filter runs forwards, then the recursion of Bryson and Frazier backwards (in the form of Bierman 1973).  The result
equals that of Rauch, Tung and Striebel, without an inverse of P:

    l~ = -H' S^-1 i + (I - K H)' l^,    L~ = H' S^-1 H + (I - K H)' L^ (I - K H),

    x|N = x- - P- l~,    P|N = P- - P- L~ P-,    l^ = F' l~ and L^ = F' L~ F one sample earlier
"""

from collections.abc import Iterator
from typing import Any

import numpy as np

from davinci_forces.filters.problem import Block, FilterInput, NoiseModel, Recording, Tracked, input_blocks
from davinci_forces.filters.stepping import STORED, arguments, gains, run
from davinci_forces.maths.arrays import Array
from davinci_forces.maths.compiled import compile_and_store

NAME = "Smoother"
MIN_VARIANCE_SHARE = 1e-12  # a smoothed variance with a smaller share of the predicted one is rounding


def blocks(recording: Recording, noise: NoiseModel) -> Iterator[Block]:
    """Smooth a recording block by block, the last one first; the forward pass of the others is computed again."""
    starts, after = list[tuple[slice, Any]](), np.zeros(9)
    for rows, before, innovations, stored in forwards(recording, noise):
        starts.append((rows, before))
        last = innovations, stored
    for rows, before in reversed(starts):
        if rows.stop < recording.samples:
            last = _forwards_from(before, recording.part(rows), noise)[1:]
        innovations, stored = last
        out = np.empty((4, rows.stop - rows.start))
        is_last = rows.stop == recording.samples
        _backwards(stored, noise.r_q**2, noise.r_dq**2, is_last, after, *out, *innovations[:2])
        yield rows, Tracked(*out, *innovations)


def forwards(recording: Recording, noise: NoiseModel) -> Iterator[tuple[slice, Any, Array, Array]]:
    """Yield blocks of n samples: the belief before, innovations and NIS (3, n), predictions and F (n, `STORED`)."""
    before: Any = None
    for rows, part in input_blocks(recording):
        before = before or arguments(part, noise)[0]
        after, innovations, stored = _forwards_from(before, part, noise)
        yield rows, before, innovations, stored
        before = after


def _forwards_from(before: Any, part: FilterInput, noise: NoiseModel) -> tuple[Any, Array, Array]:
    out, stored = np.empty((7, part.samples)), np.empty((part.samples, STORED))
    after, _ = run(out, stored, part.samples, before, *arguments(part, noise)[1:])
    return after, out[4:], stored


@compile_and_store
def _backwards(
    stored: Array, R_q: float, R_dq: float, is_last: bool, after: Any, out_q: Any, out_dq: Any, out_tau: Any,
    out_std: Any, i_q: Any, i_dq: Any,
) -> None:  # fmt: skip
    """Run backwards from l~ and L~ of the next sample, `after` (9,), or from 0 in the last block; `after` changes."""
    l1, l2, l3 = after[0], after[1], after[2]
    L11, L12, L13, L22, L23, L33 = after[3], after[4], after[5], after[6], after[7], after[8]
    for k in range(len(i_q) - 1, -1, -1):
        row = stored[k]
        if k < len(i_q) - 1 or not is_last:
            f11, f12, f13, f21, f22, f23 = row[9], row[10], row[11], row[12], row[13], row[14]
            l1, l2, l3 = f11 * l1 + f21 * l2, f12 * l1 + f22 * l2, f13 * l1 + f23 * l2 + l3
            # L~ F, then F' L~ F
            h11, h12, h13 = L11 * f11 + L12 * f21, L11 * f12 + L12 * f22, L11 * f13 + L12 * f23 + L13
            h21, h22, h23 = L12 * f11 + L22 * f21, L12 * f12 + L22 * f22, L12 * f13 + L22 * f23 + L23
            h33 = L13 * f13 + L23 * f23 + L33
            L11, L12, L13 = f11 * h11 + f21 * h21, f11 * h12 + f21 * h22, f11 * h13 + f21 * h23
            L22, L23 = f12 * h12 + f22 * h22, f12 * h13 + f22 * h23
            L33 = f13 * h13 + f23 * h23 + h33
        a, b, c, d, e, f = row[3], row[4], row[5], row[6], row[7], row[8]
        s = (row[0], row[1], row[2], a, b, c, d, e, f)
        v_qq, v_qd, v_dd, k11, k12, k21, k22, k31, k32, _ = gains(s, R_q, R_dq)
        # I - K H = [1-k11 -k12 0; -k21 1-k22 0; -k31 -k32 1]
        m11, m12, m21, m22 = 1.0 - k11, -k12, -k21, 1.0 - k22
        t1, t2 = v_qq * i_q[k] + v_qd * i_dq[k], v_qd * i_q[k] + v_dd * i_dq[k]
        l1, l2 = m11 * l1 + m21 * l2 - k31 * l3 - t1, m12 * l1 + m22 * l2 - k32 * l3 - t2
        # L^ (I - K H), then (I - K H)' L^ (I - K H)
        g11, g12 = L11 * m11 + L12 * m21 - L13 * k31, L11 * m12 + L12 * m22 - L13 * k32
        g21, g22 = L12 * m11 + L22 * m21 - L23 * k31, L12 * m12 + L22 * m22 - L23 * k32
        g31, g32 = L13 * m11 + L23 * m21 - L33 * k31, L13 * m12 + L23 * m22 - L33 * k32
        L11, L12 = m11 * g11 + m21 * g21 - k31 * g31 + v_qq, m11 * g12 + m21 * g22 - k31 * g32 + v_qd
        L22 = m12 * g12 + m22 * g22 - k32 * g32 + v_dd
        L13, L23 = g31, g32
        out_q[k] = row[0] - a * l1 - b * l2 - c * l3
        out_dq[k] = row[1] - b * l1 - d * l2 - e * l3
        out_tau[k] = row[2] - c * l1 - e * l2 - f * l3
        reduction = c * (c * L11 + 2 * (e * L12 + f * L13)) + e * (e * L22 + 2 * f * L23) + f * f * L33
        out_std[k] = max(f - reduction, MIN_VARIANCE_SHARE * f) ** 0.5
    after[0], after[1], after[2] = l1, l2, l3
    after[3], after[4], after[5], after[6], after[7], after[8] = L11, L12, L13, L22, L23, L33
