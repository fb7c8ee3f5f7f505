"""How content becomes a file: one module per writer, exporting `render`, named as the ending of the file it makes."""

from collections.abc import Callable
from importlib import import_module

from pipeline.report.content import Document

WRITERS = ("html", "pdf")


def renderer(ending: str) -> Callable[[Document], bytes]:
    """The function that renders a document as a file of that ending."""
    render: Callable[[Document], bytes] = import_module(f"pipeline.report.writers.{ending}").render
    return render
