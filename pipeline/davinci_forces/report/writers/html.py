"""The report as one HTML file that needs no network, no second file and no installed font."""

import base64
import hashlib
from collections.abc import Callable
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING

from davinci_forces.report.content import Document, Equation, Figure, Figure3D, walk
from davinci_forces.report.content.inline import Span, parse, printable
from davinci_forces.report.content.layout import columns, flatten, marked_texts, number_blocks, on_screen, references
from davinci_forces.report.figures.svg import svg
from davinci_forces.report.writers.numbers import Json, json_of, numbers_json, thin_figure, thinning_note
from davinci_forces.report.writers.pictures import NAMES, address, looks, shrink
from davinci_forces.report.writers.typesetting import Drawing, Formula, draw_formulas

if TYPE_CHECKING:
    from markupsafe import Markup

TEMPLATES = Path(__file__).parent / "templates"
LARGEST = 3_400_000  # [bytes] of the whole file; the traces get the space that other content leaves
POINT_BYTES = 11  # per point of a trace: two numbers in single precision, in base 64
MOST_POINTS, FEWEST_POINTS = 20_000, 2_000  # points of one zoomable figure
STILL_POINTS = 2_000  # points of a figure that does not zoom, for saving its numbers
FOLDED_POINTS = 600  # points of the picture of a trace on screen only, which the trace replaces
SIGN = "\0"  # placeholder; no text contains this unprintable character
SCRIPTS = ("contents.js", "figures.js", "tables.js")
REVIEW_SCRIPTS = ("review.js",)
HTML_FORMATS = {"text": "{}", "code": "<code>{}</code>", "bold": "<strong>{}</strong>"}
TRACE_SCRIPTS = ("axes.js", "marks.js", "traces.js")


def render(document: Document) -> bytes:
    """The whole file; the same document gives the same bytes.

    Raises ValueError if a reference leads nowhere.  Raises NotTypeset if an equation is wrong.
    """
    placed = number_blocks(document)
    figures = {item.anchor: item.block for item in flatten(placed) if isinstance(item.block, Figure | Figure3D)}
    zooms = {name: f for name, f in figures.items() if isinstance(f, Figure) and f.zoomable}
    few = zooms.keys() & on_screen(placed)
    drawn = {name: thin_figure(f, FOLDED_POINTS) if name in few else f for name, f in figures.items()}
    display = [Formula(block.typst, True) for block in walk(document) if isinstance(block, Equation)]
    formulas, symbols = draw_formulas([*(Formula(maths, False) for maths in marked_texts(document, "maths")), *display])
    page: Json = {
        "document": document, "placed": placed, "references": references(placed), "formulas": formulas,
        "pictures": {name: address(shrink(svg(figure))) for name, figure in drawn.items()}, "symbols": symbols,
        "looks": looks(NAMES.values()), "scripts": [
            (TEMPLATES / name).read_text(encoding="utf-8")
            for name in SCRIPTS + (TRACE_SCRIPTS if zooms else ()) + (REVIEW_SCRIPTS if document.rated else ())
        ],
        "rated": json_of(asdict(document.rated)) if document.rated else "",
    }  # fmt: skip
    still = {name: thin_figure(figure, STILL_POINTS) for name, figure in figures.items() if name not in zooms}
    kept = {f"numbers {name}": numbers_json(figure) for name, figure in still.items()}
    text = _fill(page, [*figures])
    room = LARGEST - len(text.encode()) - sum(map(len, kept.values()))
    for name, trace in _thin_figures(zooms, room).items():
        kept[f"numbers {name}"] = numbers_json(trace)
        kept[f"note {name}"] = thinning_note(zooms[name].samples, trace.samples)
    parts = text.split(SIGN)
    parts[1::2] = [kept.get(part, "") for part in parts[1::2]]  # those of `_fill`; still figures have no note
    return "".join(parts).encode()


def _thin_figures(zooms: dict[str, Figure], room: int) -> dict[str, Figure]:
    """Each zoomable figure in as many points as the file has room for."""
    share = room // POINT_BYTES // max(len(zooms), 1)
    limit = max(FEWEST_POINTS, min(MOST_POINTS, share))
    return {name: thin_figure(figure, limit) for name, figure in zooms.items()}


def _fill(page: Json, names: list[str]) -> str:
    """The page, with signs in place of the numbers of the named figures and of the notes on them."""
    from jinja2 import Environment, FileSystemLoader, StrictUndefined
    from markupsafe import Markup

    environment = Environment(
        loader=FileSystemLoader(TEMPLATES), autoescape=True, undefined=StrictUndefined, trim_blocks=True,
        lstrip_blocks=True,
        # Text that is not HTML yet is shown without characters that no page can hold.
        finalize=lambda value: value if not isinstance(value, str) or hasattr(value, "__html__") else printable(value),
    )  # fmt: skip
    environment.filters |= {"inline": _inline(page), "columns": columns, "raw": Markup}
    # A data URL as the value of an attribute: it has no quotation mark, and `<` needs no escape.
    environment.filters["attribute"] = lambda text: Markup(text.replace("&", "&amp;"))
    numbers = {name: [Markup(f"{SIGN}{part} {name}{SIGN}") for part in ("numbers", "note")] for name in names}
    # The hashes by which the content security policy allows the scripts to run.
    hashes = [f"sha256-{base64.b64encode(hashlib.sha256(text.encode()).digest()).decode()}" for text in page["scripts"]]
    return environment.get_template("report.html").render(page, numbers=numbers, hashes=hashes)


def _inline(page: Json) -> Callable[[str], "Markup"]:
    """A filter from marked text to HTML."""
    from markupsafe import Markup

    def convert(span: Span) -> Markup:
        if span.kind == "maths":
            drawing: Drawing = page["formulas"][Formula(span.text, False)]
            size = f"width:{drawing.width:.3f}em;height:{drawing.height:.3f}em;vertical-align:{-drawing.depth:.3f}em"
            formula = '<svg class="maths" role="img" aria-label="{}" viewBox="{}" style="{}">{}</svg>'
            return Markup(formula).format(span.text, drawing.view, size, Markup(drawing.body))
        if span.kind == "reference":
            return Markup('<a href="#{}">{}</a>').format(span.text, page["references"][span.text])
        if span.kind == "link":
            return Markup('<a href="{}">{}</a>').format(span.to, span.text)
        return Markup(HTML_FORMATS[span.kind]).format(span.text)

    return lambda text: Markup("").join(map(convert, parse(text)))
