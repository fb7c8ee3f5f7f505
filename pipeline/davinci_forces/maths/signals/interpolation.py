"""Samples between samples, by cubics that need no more than two neighbours on either side and bridge no gap."""

import numpy as np

from davinci_forces.maths.arrays import Array, Booleans, Integers


def cubic(t: Array, x: Array, gap: float, at: Array) -> tuple[Array, Booleans, Booleans]:
    """Signals `x` (N, C) sampled at times `t` (N,) at the times `at` (K,); where that is exact, and where in between.

    Between two samples no further apart than `gap` [s] goes the cubic that has their values and the slopes of the
    parabolas through their neighbours.  What is returned elsewhere means nothing.  (Catmull and Rom 1974)
    """
    before: Integers = np.searchsorted(t, at, side="right") - 1
    if not len(t):
        return np.full((len(at), x.shape[1]), np.nan), before >= 0, before >= 0
    exact = (before >= 0) & (t[np.maximum(before, 0)] == at)
    h = np.diff(t)
    inside = (before >= 0) & (before < len(h)) & ~exact
    inside[inside] = h[before[inside]] <= gap
    values = x[np.maximum(before, 0)]
    if inside.any():
        i = before[inside]
        m, step = _slopes(x, h, gap), h[i][:, None]
        s = (at[inside] - t[i])[:, None] / step
        # The cubic of Hermite: values and slopes at both ends.
        values[inside] = (
            (1 + 2 * s) * (1 - s) ** 2 * x[i] + s * (1 - s) ** 2 * step * m[i]
            + s**2 * (3 - 2 * s) * x[i + 1] + s**2 * (s - 1) * step * m[i + 1]
        )  # fmt: skip
    return values, exact, inside


def _slopes(x: Array, h: Array, gap: float) -> Array:
    """Slopes (N, C) of the parabolas through each sample and its neighbours; of the chord, where a gap hides one.

    A parabola's slope is that of its two chords, each weighted by the other's step.
    """
    chords = np.diff(x, axis=0) / h[:, None]
    near = h <= gap
    step = np.zeros((2, len(x)))  # to the neighbours on the left and on the right; 0 where there is none
    step[0, 1:], step[1, :-1] = np.where(near, h, 0.0), np.where(near, h, 0.0)
    weight = np.where(step[::-1] > 0, step[::-1], 1.0) * (step > 0)
    both = np.zeros((2, *x.shape))
    both[0, 1:], both[1, :-1] = chords, chords
    return np.asarray((weight[:, :, None] * both).sum(axis=0) / np.maximum(weight.sum(axis=0), 1e-300)[:, None])


def means(t: Array, x: Array, many: int, gap: float) -> tuple[Array, Array, int]:
    """Every `many` consecutive times (N,) and samples (N, C) averaged into one, none across a gap.

    Also says how many at the end were too few, and wait for what follows.
    """
    cuts = np.flatnonzero(np.diff(t) > gap) + 1
    begins, ends = np.array([0, *cuts]), np.array([*cuts, len(t)])
    whole = np.concatenate([np.arange(b, e - many + 1, many) for b, e in zip(begins, ends, strict=True)])
    of = whole[:, None] + np.arange(many)
    return t[of].mean(axis=1), x[of].mean(axis=1), int((ends[-1] - begins[-1]) % many)
