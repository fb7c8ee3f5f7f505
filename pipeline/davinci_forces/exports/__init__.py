"""Formats in which an identified model leaves for an arm: one module each, exporting `render`, listed below."""

from collections.abc import Callable
from importlib import import_module
from typing import Any

FORMATS = ("json", "urdf", "c", "ros2")


def renderer(name: str) -> Callable[[Any], Any]:
    """Return the function that renders an `identified.Export` in a format, as an `identified.Rendering`."""
    render: Callable[[Any], Any] = import_module(f"davinci_forces.exports.{name}").render
    return render
