"""How external effort is tracked: one module per filter, exporting `track`, and its name in the list below."""

from importlib import import_module

from pipeline.filters.problem import Filter

FILTERS = ("ekf",)


def tracker(name: str) -> Filter:
    """The filter of that name."""
    track: Filter = import_module(f"pipeline.filters.{name}").track
    return track
