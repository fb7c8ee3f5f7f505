"""Filters that track the external effort: one module each, exporting `track` and `NAME`, listed below."""

from collections.abc import Sequence
from importlib import import_module

import numpy as np

from davinci_forces.filters.problem import Filter, FilterInput, NoiseModel, Tracked

FILTERS = ("ekf", "ekf_euler", "ekf_adaptive", "rts", "rate", "momentum", "direct")
DEFAULT = "ekf"  # the other filters are compared with this one
MAX_NIS_RATIO = 50.0  # of the mean normalised innovation squared to 2, the mean of a consistent filter


def tracker(name: str) -> Filter:
    """Return the filter of that name."""
    track: Filter = import_module(f"davinci_forces.filters.{name}").track
    return track


def title(name: str) -> str:
    """Return the title of a filter in reports."""
    return str(import_module(f"davinci_forces.filters.{name}").NAME)


def filter_parts(name: str, parts: Sequence[FilterInput], noise: NoiseModel) -> Tracked:
    """Run a filter over the parts of a recording between gaps; the filter restarts at each part."""
    track = tracker(name)
    passes = [track(part, noise) for part in parts]
    return Tracked(*(np.concatenate(columns) for columns in zip(*passes, strict=True)))


def diverges(tracked: Tracked) -> bool:
    """Whether the innovations are so much larger than the filter assumes that its result is not usable."""
    return not np.isfinite(tracked.tau_ext).all() or float(np.mean(tracked.nis)) > 2.0 * MAX_NIS_RATIO
