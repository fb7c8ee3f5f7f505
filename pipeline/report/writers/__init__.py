"""How content becomes a file: one module per writer, exporting `render`, listed by the name of the file it makes."""

from collections.abc import Callable
from importlib import import_module

from pipeline.report.content import Document

WRITERS = {"report.html": "html", "report.pdf": "pdf"}


def renderer(file: str) -> Callable[[Document], bytes]:
    """The function that renders a document as that file."""
    render: Callable[[Document], bytes] = import_module(f"pipeline.report.writers.{WRITERS[file]}").render
    return render
