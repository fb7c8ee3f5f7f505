"""How external effort is tracked: one module per filter, exporting `track`, and its name in the list below."""

from collections.abc import Sequence
from importlib import import_module

import numpy as np

from pipeline.filters.problem import Filter, NoiseModel, Tracked
from pipeline.maths.models.driven import Driven

FILTERS = ("ekf", "ekf_euler", "rts", "rate", "momentum", "direct")
DEFAULT = "ekf"  # the others are compared with it


def tracker(name: str) -> Filter:
    """The filter of that name."""
    track: Filter = import_module(f"pipeline.filters.{name}").track
    return track


def through(name: str, recordings: Sequence[Driven], noise: NoiseModel) -> Tracked:
    """The pass of a filter over a recording with gaps: each starts it anew."""
    track = tracker(name)
    passes = [track(recording, noise) for recording in recordings]
    return Tracked(*(np.concatenate(columns) for columns in zip(*passes, strict=True)))
