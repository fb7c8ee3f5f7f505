"""The parts that all writers print alike: the numbers of blocks, references to blocks, and the columns of tables."""

from collections import Counter
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Any

from davinci_forces.report import content
from davinci_forces.report.content import Block, Cell, Document, Equation, Figure, Figure3D, OnScreen, Section, Table
from davinci_forces.report.content.inline import Kind, literal, parse
from davinci_forces.report.content.number import Number

KINDS: dict[type, str] = {Figure: "figure", Figure3D: "figure", Table: "table", Equation: "equation"}
NUMBERED_LABELS = {"figure": "Figure {}", "table": "Table {}", "equation": "Eq. ({})", "section": "Section {}"}
TEXTS: dict[type, Callable[[Any], tuple[str, ...]]] = {
    content.Prose: lambda prose: (prose.text,),
    content.Bullets: lambda bullets: bullets.items,
    content.Listing: lambda listing: (),
    content.Verdict: lambda verdict: (verdict.text,),
    Equation: lambda equation: (),
    Table: lambda table: (table.caption, *table.header, *(c for row in table.rows for c in row if isinstance(c, str))),
    Figure: lambda figure: (figure.caption,),
    Figure3D: lambda figure: (figure.caption,),
    Section: lambda section: (section.title,),
    OnScreen: lambda folded: (folded.title,),
}


@dataclass(frozen=True, eq=False)
class Placed:
    """A block in its place: its kind, number and anchor, and for a section its depth and its blocks."""

    block: Block
    kind: str
    number: str = ""
    anchor: str = ""
    depth: int = 0
    blocks: tuple["Placed", ...] = ()


def number_blocks(document: Document) -> tuple[Placed, ...]:
    """The sections of a document, numbered: sections 1, 1.1; figures, tables and equations 1, 2, 3, and S1, S2, S3
    where they are on screen only.

    Raises ValueError if references lead nowhere, with all of their labels.
    """
    named = {content.name_of(block) for block in content.walk(document)}
    if missing := sorted(set(marked_texts(document, "reference")) - named):
        raise ValueError(f"{document.title}: references to labels that no block has: {missing}")
    counters: Counter[str] = Counter()
    return tuple(_section(section, str(i), 1, counters) for i, section in enumerate(document.sections, 1))


def flatten(placed: tuple[Placed, ...]) -> Iterator[Placed]:
    """Every block in reading order, each before the blocks that it contains."""
    for item in placed:
        yield item
        yield from flatten(item.blocks)


def references(placed: tuple[Placed, ...]) -> dict[str, str]:
    """What a reference to each label or anchor prints: {'roll-residual': 'Figure 3'}."""
    printed: dict[str, str] = {}
    for item in flatten(placed):
        if item.number and content.name_of(item.block):
            printed[item.anchor] = NUMBERED_LABELS[item.kind].format(item.number)
        elif isinstance(item.block, OnScreen):
            printed[item.anchor] = f"“{''.join(span.text for span in parse(item.block.title))}”"
    return printed


def on_screen(placed: tuple[Placed, ...]) -> frozenset[str]:
    """The anchors of all that the PDF leaves out."""
    folded = tuple(item for item in flatten(placed) if item.kind == "onscreen")
    return frozenset(item.anchor for item in flatten(folded) if item.anchor)


def marked_texts(document: Document, kind: Kind) -> Iterator[str]:
    """The contents of the inline marks of one kind, in all texts of a document."""
    for block in content.walk(document):
        for text in TEXTS[type(block)](block):
            yield from (span.text for span in parse(text) if span.kind == kind)


def _section(section: Section, number: str, depth: int, counters: Counter[str]) -> Placed:
    children: list[Placed] = []
    for block in section.blocks:
        if isinstance(block, Section):
            counters[number] += 1
            children.append(_section(block, f"{number}.{counters[number]}", depth + 1, counters))
        else:
            children.append(_block(block, counters, ""))
    return Placed(section, "section", number, section.anchor, depth, tuple(children))


def _block(block: Block, counters: Counter[str], series: str) -> Placed:
    """A block other than a section; `series` is the prefix of its number."""
    if isinstance(block, OnScreen):
        inside = tuple(_block(child, counters, "S") for child in block.blocks)
        return Placed(block, "onscreen", anchor=block.anchor, blocks=inside)
    kind = KINDS.get(type(block), "")
    if not kind:
        return Placed(block, type(block).__name__.lower())
    counters[series + kind] += 1
    number = f"{series}{counters[series + kind]}"
    # A capital letter cannot be confused with a label, which has none.
    return Placed(block, kind, number, content.name_of(block) or f"{kind.capitalize()}-{number}")


NO_BREAK = "\N{NO-BREAK SPACE}"


@dataclass(frozen=True)
class TextCell:
    """One cell as it is printed, and the key of its number in results.json."""

    text: str
    key: str = ""


@dataclass(frozen=True)
class TextColumn:
    """The header, alignment (l, c or r) and cells of a column."""

    head: str
    align: str
    cells: tuple[TextCell, ...]


def columns(table: Table) -> tuple[TextColumn, ...]:
    """The columns of a table, ready to print."""
    aligns = table.align or " " * len(table.header)
    cells = zip(*table.rows, strict=True) if table.rows else ((),) * len(table.header)
    return tuple(_column(head, align, tuple(c)) for head, align, c in zip(table.header, aligns, cells, strict=True))


def _column(head: str, align: str, cells: tuple[Cell, ...]) -> TextColumn:
    numbers = [cell for cell in cells if isinstance(cell, Number)]
    unit = numbers[0].unit if len({number.unit for number in numbers}) == 1 else ""
    head = f"{head} {literal(f'[{unit}]').replace(' ', NO_BREAK)}".strip() if unit else head
    align = align.strip() or ("r" if numbers else "l")
    texts = (
        TextCell(cell) if isinstance(cell, str) else TextCell(literal(cell.text if unit else str(cell)), cell.key or "")
        for cell in cells
    )
    return TextColumn(head, align, tuple(texts))
