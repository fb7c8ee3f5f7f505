"""The report as PDF, typeset by Typst: the template reads the document as data, so no text can become markup."""

from functools import singledispatch
from pathlib import Path
from typing import Any

from davinci_forces.report.content import (
    Bullets,
    Document,
    Equation,
    Figure,
    Figure3D,
    Listing,
    OnScreen,
    Prose,
    Section,
    Table,
    Verdict,
)
from davinci_forces.report.content.inline import parse, printable
from davinci_forces.report.content.layout import NO_BREAK, Placed, columns, on_screen, place, references
from davinci_forces.report.figures.svg import svg
from davinci_forces.report.writers.typesetting import typeset
from davinci_forces.report.writers.widths import allow_breaks, fit_columns

TEMPLATE = Path(__file__).parent / "templates/report.typ"
Json = dict[str, Any]


def render(document: Document) -> bytes:
    """The whole file; the same document gives the same bytes.

    Raises
    ------
    ValueError
        If a reference leads nowhere.
    NotTypeset
        If Typst fails or warns.
    """
    placed = place(document)
    content = {
        "title": printable(document.title),
        "study": printable(document.study),
        "simulated": document.simulated,
        "edition": printable(document.edition),
        "author": printable(document.author),
        "keywords": [printable(word) for word in document.keywords],
        "references": references(placed),
        "onscreen": sorted(on_screen(placed)),
        "blocks": [_placed(item) for item in placed],
    }
    return typeset(TEMPLATE, content, "pdf")[0]


def _placed(item: Placed) -> Json:
    common = {"kind": item.kind, "number": item.number, "anchor": item.anchor, "depth": item.depth}
    children = item.blocks if item.kind == "section" else ()
    return common | block_data(item.block) | {"blocks": [_placed(child) for child in children]}


def _inline(text: str) -> list[Json]:
    """Marked text as the template reads it; long words outside maths may break."""
    return [
        span._asdict() | ({} if span.kind == "maths" else {"text": allow_breaks(span.text)}) for span in parse(text)
    ]


@singledispatch
def block_data(block: Any) -> Json:
    """What the template needs of a block besides kind, number, anchor and depth."""
    raise TypeError(f"{type(block).__name__} is not a block of a report")


@block_data.register(Section)
def _(section: Section) -> Json:
    return {"title": _inline(section.title)}


@block_data.register(OnScreen)
def _(folded: OnScreen) -> Json:
    return {"title": _inline(folded.title)}


@block_data.register(Prose)
def _(prose: Prose) -> Json:
    return {"paragraphs": [_inline(text.strip()) for text in prose.text.split("\n\n") if text.strip()]}


@block_data.register(Bullets)
def _(bullets: Bullets) -> Json:
    return {"items": [_inline(item) for item in bullets.items]}


@block_data.register(Listing)
def _(listing: Listing) -> Json:
    return {"text": allow_breaks(printable(listing.text), 80)}


@block_data.register(Verdict)
def _(verdict: Verdict) -> Json:
    return {"level": verdict.level, "text": _inline(verdict.text)}


@block_data.register(Equation)
def _(equation: Equation) -> Json:
    return {"typst": equation.typst, "alt": equation.alt}


@block_data.register(Table)
def _(table: Table) -> Json:
    shown = columns(table)
    cells = [[_unbroken(cell.text, column.align) for cell in column.cells] for column in shown]
    fitted = fit_columns([[column.head, *texts] for column, texts in zip(shown, cells, strict=True)])
    return {
        "caption": _inline(table.caption),
        "size": fitted.size,
        "inset": fitted.inset,
        "widths": fitted.widths,
        "aligns": [column.align for column in shown],
        "header": [fitted.cell(i, column.head) for i, column in enumerate(shown)],
        "rows": [[fitted.cell(i, texts[row]) for i, texts in enumerate(cells)] for row in range(len(table.rows))],
    }


def _unbroken(text: str, align: str) -> str:
    """A cell as its column has it: what stands to the right is a number, of which the unit is not parted."""
    return text.replace(" ", NO_BREAK) if align == "r" else text


@block_data.register(Figure)
@block_data.register(Figure3D)
def _(figure: Figure | Figure3D) -> Json:
    return {"caption": _inline(figure.caption), "alt": printable(figure.alt), "svg": svg(figure)}
