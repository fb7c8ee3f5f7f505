"""What a report says, as data: documents of sections of blocks, numbers that know their key, figures as marks."""

from davinci_forces.report.content.document import (
    Block,
    Bullets,
    Cell,
    Document,
    Equation,
    Figure,
    Figure3D,
    Level,
    Listing,
    OnScreen,
    Panel,
    Prose,
    Rated,
    Section,
    Table,
    Verdict,
    name_of,
    walk,
)
from davinci_forces.report.content.inline import literal
from davinci_forces.report.content.marks import (
    AnyMark,
    Band,
    Bars,
    HBand,
    Histogram,
    HLine,
    Line,
    Line3D,
    Points,
    Points3D,
    Reference,
    Stems,
    Tiles,
    VLine,
    VSpan,
)
from davinci_forces.report.content.number import Number

__all__ = [
    "AnyMark", "Band", "Bars", "Block", "Bullets", "Cell", "Document", "Equation", "Figure", "Figure3D", "HBand",
    "HLine", "Histogram", "Level", "Line", "Line3D", "Listing", "Number", "OnScreen", "Panel", "Points", "Points3D",
    "Prose", "Rated", "Reference", "Section", "Stems", "Table", "Tiles", "VLine", "VSpan", "Verdict", "literal",
    "name_of", "walk",
]  # fmt: skip
