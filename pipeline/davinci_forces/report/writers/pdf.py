"""The report as PDF, typeset by Typst: the template reads the document as data, so no text can become markup."""

import re
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

from davinci_forces.report import content
from davinci_forces.report.content.inline import parse, printable
from davinci_forces.report.content.layout import NO_BREAK, Placed, columns, number_blocks, on_screen, references
from davinci_forces.report.figures.svg import svg
from davinci_forces.report.writers.typesetting import typeset

TEMPLATE = Path(__file__).parent / "templates/report.typ"
MEASURED = re.compile(r"\d(?: ± [\d.]+)? (?:%|(?:N m|N|A|rad|mm|m|s|ms|Hz|kg)\b)")  # numbers with units in text
Json = dict[str, Any]


def render(document: content.Document) -> bytes:
    """The whole file; the same document gives the same bytes.

    Raises ValueError if a reference leads nowhere.  Raises NotTypeset if Typst fails or warns.
    """
    placed = number_blocks(document)
    data = {
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
    return typeset(TEMPLATE, data, "pdf")[0]


def _placed(item: Placed) -> Json:
    common = {"kind": item.kind, "number": item.number, "anchor": item.anchor, "depth": item.depth}
    children = item.blocks if item.kind == "section" else ()
    return common | DATA[type(item.block)](item.block) | {"blocks": [_placed(child) for child in children]}


def _inline(text: str) -> list[Json]:
    """Marked text in the form that the template reads; no line begins with the unit of a number."""
    spans = (
        span._replace(text=MEASURED.sub(lambda m: m[0].replace(" ", NO_BREAK), span.text))
        if span.kind in ("text", "bold") else span for span in parse(text)
    )  # fmt: skip
    return [span._asdict() for span in spans]


def _table(table: content.Table) -> Json:
    rows = table.rows if table.printed is None else tuple(table.rows[i] for i in table.printed)
    more = f" {len(table.rows) - len(rows)} more in the HTML report." * (len(rows) < len(table.rows))
    shown = columns(replace(table, rows=rows))
    # What stands to the right is a number, of which the unit is not parted.
    cells = [
        [_inline(cell.text.replace(" ", NO_BREAK) if column.align == "r" else cell.text) for cell in column.cells]
        for column in shown
    ]
    return {
        "caption": _inline(table.caption + more),
        "aligns": [column.align for column in shown],
        "header": [_inline(column.head) for column in shown],
        "rows": [list(row) for row in zip(*cells, strict=True)],
    }


def _figure(figure: content.Figure | content.Figure3D) -> Json:
    return {"caption": _inline(figure.caption), "alt": printable(figure.alt), "svg": svg(figure)}


# Data that the template needs of a block in addition to kind, number, anchor and depth.
DATA: dict[type, Callable[[Any], Json]] = {
    content.Section: lambda section: {"title": _inline(section.title)},
    content.OnScreen: lambda folded: {"title": _inline(folded.title)},
    content.Prose: lambda prose: {
        "paragraphs": [_inline(part.strip()) for part in prose.text.split("\n\n") if part.strip()]
    },
    content.Bullets: lambda bullets: {"items": [_inline(item) for item in bullets.items]},
    content.Listing: lambda listing: {"text": printable(listing.text)},
    content.Verdict: lambda verdict: {"level": verdict.level, "text": _inline(verdict.text)},
    content.Equation: lambda equation: {"typst": equation.typst, "alt": equation.alt},
    content.Table: _table,
    content.Figure: _figure,
    content.Figure3D: _figure,
}
