"""The answer as a terminal shows it: joints, the things to look at first, and tissue; also kept as summary.txt."""

import re
from collections.abc import Sequence

from davinci_forces.records import Stiffness
from davinci_forces.report.content.inline import parse
from davinci_forces.report.context import Context
from davinci_forces.report.sections.summary import first_looks_in_order, fitted_joints, trust, trust_row
from davinci_forces.report.sections.tissue import verdict

HEADER = ("joint", "verdict", "model error", "of effort", "R2", "at most", "detection level", "band covers")


def answer(context: Context) -> str:
    """The trust table and the three things to look at first, in plain text."""
    trusts = [trust(context, joint) for joint in fitted_joints(context)]
    tissue = [f"tissue {plain(verdict(context, each).text)}" for each in context.catalogue.all(Stiffness)]
    if not trusts:
        said = "no joint could be identified: there is no usable identification log, so no effort was tracked"
        return "\n".join([said, *tissue]) + "\n"
    rows = [[plain(str(cell)) for cell in trust_row(context, trusted, False)] for trusted in trusts]
    looks = [f"{i}. {plain(text)}" for i, text in enumerate(first_looks_in_order(context, trusts), 1)]
    lines = [*aligned([HEADER, *rows]), *(["look at these first:", *looks] if looks else []), *tissue]
    return "\n".join(lines) + "\n"


def plain(text: str) -> str:
    """Marked text without its marks; where it leads to is in the report."""
    spans = (span.text for span in parse(re.sub(r" See \[@[^]]*\]\.", "", text)) if span.kind != "reference")
    return "".join(spans)


def aligned(rows: Sequence[Sequence[str]]) -> list[str]:
    """Rows as lines, each column as wide as its longest cell."""
    widths = [max(len(cell) for cell in column) for column in zip(*rows, strict=True)]
    return ["  ".join(cell.ljust(width) for cell, width in zip(row, widths, strict=True)).rstrip() for row in rows]
