"""Convert documents to files: each module exports `render` and has the name of its file's ending."""

from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from importlib import import_module

from davinci_forces.report.content import Document

WRITERS = ("html", "pdf")


def renderer(ending: str) -> Callable[[Document], bytes]:
    """The function that renders a document as a file of that ending."""
    render: Callable[[Document], bytes] = import_module(f"davinci_forces.report.writers.{ending}").render
    return render


def render_all(documents: tuple[Document, ...]) -> dict[str, bytes]:
    """The files of all documents, by name, written side by side."""
    tasks = {f"{document.file}.{ending}": (renderer(ending), document) for document in documents for ending in WRITERS}
    with ThreadPoolExecutor(2) as pool:  # Typst's work needs no lock of Python's
        futures = {name: pool.submit(render, document) for name, (render, document) in tasks.items()}
        return {name: future.result() for name, future in futures.items()}
