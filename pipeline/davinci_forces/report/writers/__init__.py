"""Convert documents to files: each module exports `render` and has the name of its file's ending."""

from concurrent.futures import ThreadPoolExecutor
from importlib import import_module

from davinci_forces.report.content import Document

WRITERS = ("html", "pdf")


def render_all(documents: tuple[Document, ...]) -> dict[str, bytes]:
    """The files of all documents, by name, written side by side."""
    renderers = {ending: import_module(f"davinci_forces.report.writers.{ending}").render for ending in WRITERS}
    with ThreadPoolExecutor(2) as pool:  # Typst's work needs no lock of Python's
        futures = {
            f"{document.file}.{ending}": pool.submit(render, document)
            for document in documents
            for ending, render in renderers.items()
        }
        return {name: future.result() for name, future in futures.items()}
