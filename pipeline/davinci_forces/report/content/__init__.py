"""What a report says, as data: documents of sections of blocks, with no HTML and no page in them.

Titles of sections, prose, captions, list items and table cells take inline marks (see `inline`).  `$x$` is Typst maths,
backticks enclose code, `**bold**` is bold, and `[words](file)` links to a file beside the document.  `[@label]` refers
to a labelled figure, table, equation or section.  Text that came from a log goes through `literal` there.
Words in figures, listings, and the title and study of a document are shown as they are.
"""

import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, fields, replace
from typing import Any, ClassVar, Literal, TypeVar

from davinci_forces.report.content.inline import literal, message, printable
from davinci_forces.report.content.marks import AnyMark, Line3D, Points3D
from davinci_forces.report.content.number import Number, in_format
from davinci_forces.report.content.thinning import points_of, thin_mark
from davinci_forces.study.review import Rating

__all__ = [
    "Block", "Bullets", "Cell", "Document", "Equation", "Figure", "Figure3D", "Level", "Listing", "Number", "OnScreen",
    "Panel", "Prose", "Rated", "Section", "Table", "Verdict", "in_format", "literal", "message", "name_of", "walk",
]  # fmt: skip

Cell = str | Number
Level = Literal["good", "warn", "bad", "info"]
Part = TypeVar("Part", bound=Any)
PAGE_WIDTH = 170.0  # [mm] of the text on an A4 page
MAX_POINTS_OF_MARK = 1 << 16  # several times what a page shows, so that thinning again hides nothing


@dataclass(frozen=True)
class Prose:
    """Paragraphs, separated by empty lines."""

    text: str


@dataclass(frozen=True)
class Bullets:
    """An unordered list."""

    items: tuple[str, ...]


@dataclass(frozen=True)
class Listing:
    """Text of a machine, shown as it is in a fixed-width font: settings, a file, a command."""

    text: str


@dataclass(frozen=True)
class Verdict:
    """One judgement, coloured and named by its level."""

    level: Level
    text: str


@dataclass(frozen=True)
class Equation:
    """A numbered equation in Typst's syntax, with a description for readers who cannot see it."""

    typst: str
    alt: str
    label: str | None = None


@dataclass(frozen=True)
class Table:
    """Rows under a header; a unit that all numbers of a column share moves to its header, so never write one there.

    `align` is one letter per column (l, c or r); without it, columns of numbers are right and others left.  The PDF has
    the rows of the numbers `printed` only, if given, and counts the others; the HTML has all of them, unfolded.
    """

    caption: str
    header: tuple[str, ...]
    rows: Sequence[tuple[Cell, ...]]
    label: str | None = None
    align: str = ""
    printed: tuple[int, ...] | None = None

    def __post_init__(self) -> None:
        object.__setattr__(self, "rows", tuple(self.rows))
        wrong = [len(row) for row in self.rows if len(row) != len(self.header)]
        if wrong or (self.align and len(self.align) != len(self.header)):
            but = f"{len(self.header)} columns, but rows of {wrong}, align {self.align!r}"
            raise ValueError(f"table {self.caption!r}: {but}")


@dataclass(frozen=True, eq=False)
class Panel:
    """One pair of axes; labels carry their unit: `velocity [rad/s]`.

    A mark of very many samples is thinned at once, or the panels of long logs would hold all of them.
    """

    title: str
    x_label: str
    y_label: str
    marks: tuple[AnyMark, ...]
    x_range: tuple[float, float] | None = None
    y_range: tuple[float, float] | None = None
    x_log: bool = False
    y_log: bool = False
    x_dates: bool = False  # x is in days since 1970, and the axis shows dates
    samples: ClassVar[int] = 0  # set on each panel: points of all marks before thinning

    def __post_init__(self) -> None:
        object.__setattr__(self, "samples", sum(map(points_of, self.marks)))
        marks = tuple(_shown(thin_mark(mark, MAX_POINTS_OF_MARK)) for mark in self.marks)
        object.__setattr__(self, "marks", marks)


@dataclass(frozen=True, eq=False)
class Figure:
    """Panels under one caption; `zoomable` ones zoom and pan in HTML with the x axes of all panels linked.

    `height` is that of one row of panels [mm], on a page whose text is `PAGE_WIDTH` wide.
    """

    caption: str
    alt: str
    panels: tuple[Panel, ...]
    label: str | None = None
    zoomable: bool = False
    columns: int = 1
    height: float = 48.0
    samples: int = field(init=False)  # points of all marks before thinning

    def __post_init__(self) -> None:
        object.__setattr__(self, "samples", sum(panel.samples for panel in self.panels))
        object.__setattr__(self, "panels", tuple(map(_shown, self.panels)))


def _shown(part: Part) -> Part:
    """A panel or a mark with its words as a page can show them; the same one where they can be shown."""
    values = {f.name: getattr(part, f.name) for f in fields(part)}
    words: dict[str, Any] = {name: printable(value) for name, value in values.items() if isinstance(value, str)}
    words |= {"names": tuple(map(printable, values["names"]))} if "names" in values else {}
    return replace(part, **words) if any(words[name] != values[name] for name in words) else part


@dataclass(frozen=True, eq=False)
class Figure3D:
    """Lines and points in space [m] on equal axes; `height` in [mm]."""

    caption: str
    alt: str
    marks: tuple[Line3D | Points3D, ...]
    label: str | None = None
    height: float = 100.0

    def __post_init__(self) -> None:
        object.__setattr__(self, "marks", tuple(map(_shown, self.marks)))


@dataclass(frozen=True)
class Section:
    """A titled part; sections among its blocks are its subsections."""

    title: str
    anchor: str
    blocks: tuple["Block", ...]


@dataclass(frozen=True)
class OnScreen:
    """Content for the screen only: folded in HTML until the reader opens it; the PDF prints only its title.

    Figures, tables and equations in it are numbered S1, S2, ..., so that those of the PDF follow each other.
    """

    title: str
    anchor: str
    blocks: tuple["Block", ...]


Block = Prose | Bullets | Listing | Verdict | Equation | Table | Figure | Figure3D | Section | OnScreen


@dataclass(frozen=True)
class Rated:
    """What a page needs to take ratings: the sha256 of results.json, the report's ID, the runs, and earlier ratings."""

    results: str
    report: str
    runs: tuple[str, ...]
    ratings: tuple[Rating, ...] = ()


@dataclass(frozen=True)
class Document:
    """A whole report, its first section before the contents; a `simulated` one says so at the top of every page.

    Its files are `file`.html and `file`.pdf, which lead to each other and to the files of `links`, by what they hold.
    """

    title: str
    study: str
    simulated: bool
    sections: tuple[Section, ...]
    edition: str = ""  # which report this is: its ID and the version that made it
    file: str = "report"
    links: tuple[tuple[str, str], ...] = (("Numbers", "results.json"),)
    rated: Rated | None = None  # where its HTML takes ratings of figures and runs
    author: str = "davinci-forces"
    keywords: tuple[str, ...] = ("da Vinci", "contact force", "system identification", "Kalman filter")

    def __post_init__(self) -> None:
        names = [name for block in walk(self) if (name := name_of(block))]
        if bad := [name for name in names if not re.fullmatch(r"[a-z0-9][a-z0-9._-]*", name)]:
            raise ValueError(f"labels and anchors are lower-case letters, digits and ._- only, not {bad}")
        if twice := sorted({name for name in names if names.count(name) > 1}):
            raise ValueError(f"labels and anchors must differ; used more than once: {twice}")


def walk(parent: Document | Section | OnScreen) -> Iterator[Block]:
    """Every block in reading order, each section before its blocks."""
    for block in parent.sections if isinstance(parent, Document) else parent.blocks:
        yield block
        if isinstance(block, Section | OnScreen):
            yield from walk(block)


def name_of(block: Block) -> str | None:
    """The name of a block in references: its label, or the anchor of a section or of on-screen content."""
    return block.anchor if isinstance(block, Section | OnScreen) else getattr(block, "label", None)
