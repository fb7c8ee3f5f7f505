"""Tables as columns of marked text: units in the header where a column agrees, numbers to the right."""

from dataclasses import dataclass

from davinci_forces.report.content.document import Cell, Table
from davinci_forces.report.content.inline import literal
from davinci_forces.report.content.number import Number

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
    return TextColumn(head, align, tuple(_text_cell(cell, bool(unit)) for cell in cells))


def _text_cell(cell: Cell, unit_in_head: bool) -> TextCell:
    if isinstance(cell, str):
        return TextCell(cell)
    return TextCell(literal(cell.text if unit_in_head else str(cell)), cell.key or "")
