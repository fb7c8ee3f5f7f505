"""Convert documents to files: each module exports `render` and has the name of its file's ending."""

from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from importlib import import_module

from davinci_forces.report.content import Document, Figure, Figure3D, OnScreen, Section

WRITERS = ("html", "pdf")


def renderer(ending: str) -> Callable[[Document], bytes]:
    """The function that renders a document as a file of that ending."""
    render: Callable[[Document], bytes] = import_module(f"davinci_forces.report.writers.{ending}").render
    return render


def render_all(documents: tuple[Document, ...]) -> dict[str, bytes]:
    """The files of all documents, by name: their figures drawn by several processes, then written side by side."""
    from davinci_forces.report.figures.together import draw_together

    draw_together(figure for document in documents for figure in figures_to_draw(document))
    tasks = {f"{document.file}.{ending}": (renderer(ending), document) for document in documents for ending in WRITERS}
    with ThreadPoolExecutor(2) as pool:  # Typst's work needs no lock of Python's
        futures = {name: pool.submit(render, document) for name, (render, document) in tasks.items()}
        return {name: future.result() for name, future in futures.items()}


def figures_to_draw(parent: Document | Section | OnScreen, printed: bool = True) -> Iterator[Figure | Figure3D]:
    """The figures that matplotlib draws: all printed ones, and on screen those that are neither small nor zoomable."""
    for block in parent.sections if isinstance(parent, Document) else parent.blocks:
        if isinstance(block, Section | OnScreen):
            yield from figures_to_draw(block, printed and isinstance(block, Section))
        elif isinstance(block, Figure3D | Figure) and (printed or not _is_light(block)):
            yield block


def _is_light(figure: Figure | Figure3D) -> bool:
    """Whether the HTML shows an on-screen figure without a picture by matplotlib."""
    return isinstance(figure, Figure) and (figure.small or figure.zoomable)
