"""Formats in which an identified model leaves for an arm: one module each, exporting `render`, listed below."""

from importlib import import_module
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from davinci_forces.exports.identified import Renderer

FORMATS = ("json", "urdf")


def renderer(name: str) -> "Renderer":
    """Return the function that renders a format."""
    render: Renderer = import_module(f"davinci_forces.exports.{name}").render
    return render
