"""How far a motion repeats, to the sample, from a part of it that does."""

from collections.abc import Sequence

import numpy as np

from davinci_forces.maths.arrays import Array, Booleans
from davinci_forces.maths.periods.averaging import nearest, phases
from davinci_forces.maths.periods.harmonics import Harmonics
from davinci_forces.maths.periods.period import refine, standard_error

STRAYS = 4.0  # times what the harmonics leave where the motion repeats: a sample further away strays from it
LEAST = 0.01  # of the motion's standard deviation: a sample nearer than that does not stray
IN_A_ROW = 3  # samples that stray before the motion is over: one by itself is a glitch
UNSURE = 0.02  # of a period, by which a phase may be uncertain beyond a gap


def stretch(t: Array, signals: Sequence[Array], length: float, core: slice, harmonics: int) -> tuple[slice, float]:
    """The longest run of samples around `core` that repeat with one period, and that period [s].

    The harmonics of what is known to repeat say where the next samples should be, up to as many again on either side;
    from those that are there the period is known better.  `t` (N,) [s], with or without gaps; `signals` (N,) each;
    `length` [s] good enough for the few periods of `core`.
    """
    length = refine(t[core], [x[core] for x in signals], length, harmonics)
    while (wide := _certain(t, signals, length, core, harmonics)) != core:
        strays = _strays(t, signals, length, core, wide, harmonics)
        ahead = _ahead(strays[core.stop - wide.start :])
        behind = _ahead(strays[: core.start - wide.start][::-1])
        longer = slice(core.start - behind, core.stop + ahead)
        if longer == core:
            break
        core = longer
        length = refine(t[core], [x[core] for x in signals], length, harmonics)
    return core, length


def _certain(t: Array, signals: Sequence[Array], length: float, core: slice, harmonics: int) -> slice:
    """`core` and as many samples on either side, up to the first gap there beyond which the phase is not known."""
    reach = core.stop - core.start
    wide = slice(max(core.start - reach, 0), min(core.stop + reach, len(t)))
    steps = np.diff(t[wide])
    # A period is known to within itself, so that no shorter gap can matter.
    if not np.any(steps > UNSURE * length):
        return wide
    std = standard_error(t[core], [x[core] for x in signals], length, harmonics)
    far = wide.start + 1 + np.flatnonzero(steps * std > UNSURE * length**2)
    before, after = far[far <= core.start], far[far >= core.stop]
    return slice(int(before[-1]) if len(before) else wide.start, int(after[0]) if len(after) else wide.stop)


def _strays(t: Array, signals: Sequence[Array], length: float, core: slice, wide: slice, harmonics: int) -> Booleans:
    """Whether any signal is where the mean period of `core` does not lead us to expect it, at each sample of `wide`."""
    omega, since = 2 * np.pi / length, t[wide] - t[core.start]
    inside = slice(core.start - wide.start, core.stop - wide.start)
    N, rate = core.stop - core.start, (core.stop - core.start - 1) / (t[core.stop - 1] - t[core.start])
    K = phases(length, rate)
    bins = nearest(since, length, K)
    known, whole = (Harmonics(times, omega, harmonics) for times in (since[inside], since))
    counts = np.maximum(np.bincount(bins[inside], minlength=K), 1)
    strays = np.zeros(len(since), dtype=bool)
    for x in signals:
        residual = whole.evaluate(known.project(x[core]))
        np.subtract(x[wide], residual, out=residual)
        residual -= (np.bincount(bins[inside], residual[inside], K) / counts)[bins]
        # The mean of M periods follows their noise, and misses that of others by more.
        expected = np.sqrt(residual[inside] @ residual[inside] / max(N - K, 1) * (1 + K / N))
        strays |= np.abs(residual) > max(STRAYS * expected, LEAST * x[core].std())
    return strays


def _ahead(strays: Booleans) -> int:
    """How many samples there are before the first that begins a run of those that stray."""
    counts = np.convolve(strays, np.ones(IN_A_ROW, dtype=int), mode="valid") if len(strays) >= IN_A_ROW else strays
    runs = np.flatnonzero(counts >= IN_A_ROW)
    return int(runs[0]) if len(runs) else len(strays)
