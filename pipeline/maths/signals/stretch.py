"""How far a motion repeats, to the sample, from a part of it that does."""

from collections.abc import Sequence

import numpy as np

from pipeline.maths.arrays import Array, Booleans
from pipeline.maths.signals.averaging import phases
from pipeline.maths.signals.harmonics import evaluate, project
from pipeline.maths.signals.period import Period, refine

STRAYS = 4.0  # times what the harmonics leave where the motion repeats: a sample further away strays from it
LEAST = 0.01  # of the motion's standard deviation: a sample nearer than that does not stray
IN_A_ROW = 3  # samples that stray before the motion is over: one by itself is a glitch
UNSURE = 0.02  # of a period, by which a phase may be uncertain beyond a gap


def stretch(t: Array, signals: Sequence[Array], length: float, core: slice, harmonics: int) -> tuple[slice, Period]:
    """The longest run of samples around `core` that repeat with one period, and that period.

    The harmonics of what is known to repeat say where the next samples should be, up to as many again on either side;
    from those that are there the period is known better.  `t` (N,) [s], with or without gaps; `signals` (N,) each;
    `length` [s] good enough for the few periods of `core`.
    """
    found = refine(t[core], [x[core] for x in signals], length, harmonics)
    while True:
        reach = core.stop - core.start
        wide = slice(max(core.start - reach, 0), min(core.stop + reach, len(t)))
        wide = _certain(t, core, wide, found)
        strays = _strays(t, signals, found.length, core, wide, harmonics)
        ahead = _ahead(strays[core.stop - wide.start :])
        behind = _ahead(strays[: core.start - wide.start][::-1])
        longer = slice(core.start - behind, core.stop + ahead)
        if longer == core:
            return core, found
        core = longer
        found = refine(t[core], [x[core] for x in signals], found.length, harmonics)


def _certain(t: Array, core: slice, wide: slice, found: Period) -> slice:
    """The part of `wide` up to the first gap on either side beyond which the phase is not known."""
    steps = np.diff(t[wide])
    far = wide.start + 1 + np.flatnonzero(steps * found.std > UNSURE * found.length**2)
    before, after = far[far <= core.start], far[far >= core.stop]
    return slice(int(before[-1]) if len(before) else wide.start, int(after[0]) if len(after) else wide.stop)


def _strays(t: Array, signals: Sequence[Array], length: float, core: slice, wide: slice, harmonics: int) -> Booleans:
    """Whether any signal is where the mean period of `core` does not lead us to expect it, at each sample of `wide`."""
    omega, since = 2 * np.pi / length, t[wide] - t[core.start]
    inside = slice(core.start - wide.start, core.stop - wide.start)
    N, rate = core.stop - core.start, (core.stop - core.start - 1) / (t[core.stop - 1] - t[core.start])
    K = phases(length, rate)
    bins = np.rint(since / length % 1.0 * K).astype(np.int64) % K
    counts = np.maximum(np.bincount(bins[inside], minlength=K), 1)
    strays = np.zeros(len(since), dtype=bool)
    for x in signals:
        residual = x[wide] - evaluate(project(since[inside], x[core], omega, harmonics), since, omega)
        residual -= (np.bincount(bins[inside], residual[inside], K) / counts)[bins]
        # The mean of M periods follows their noise, and misses that of others by more.
        expected = np.sqrt(np.sum(residual[inside] ** 2) / max(N - K, 1) * (1 + K / N))
        strays |= np.abs(residual) > max(STRAYS * expected, LEAST * x[core].std())
    return strays


def _ahead(strays: Booleans) -> int:
    """How many samples there are before the first that begins a run of those that stray."""
    counts = np.convolve(strays, np.ones(IN_A_ROW, dtype=int), mode="valid") if len(strays) >= IN_A_ROW else strays
    runs = np.flatnonzero(counts >= IN_A_ROW)
    return int(runs[0]) if len(runs) else len(strays)
