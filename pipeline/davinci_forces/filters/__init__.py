"""How external effort is tracked: one module per filter, exporting `track` and `NAME`, listed below."""

from collections.abc import Sequence
from importlib import import_module

import numpy as np

from davinci_forces.filters.problem import Driven, Filter, NoiseModel, Tracked

FILTERS = ("ekf", "ekf_euler", "ekf_adaptive", "rts", "rate", "momentum", "direct")
DEFAULT = "ekf"  # the others are compared with it
DIVERGED = 50.0  # times what a consistent filter has of normalised innovations squared, on average


def tracker(name: str) -> Filter:
    """The filter of that name."""
    track: Filter = import_module(f"davinci_forces.filters.{name}").track
    return track


def title(name: str) -> str:
    """What the filter of that name is called in a report."""
    return str(import_module(f"davinci_forces.filters.{name}").NAME)


def through(name: str, recordings: Sequence[Driven], noise: NoiseModel) -> Tracked:
    """The pass of a filter over a recording with gaps: each starts it anew."""
    track = tracker(name)
    passes = [track(recording, noise) for recording in recordings]
    return Tracked(*(np.concatenate(columns) for columns in zip(*passes, strict=True)))


def diverges(made: Tracked) -> bool:
    """Whether a pass is nothing like what its filter assumes, so that nothing may be concluded from it."""
    return not np.isfinite(made.tau_ext).all() or float(np.mean(made.nis)) > 2.0 * DIVERGED
