"""A writer of LabVIEW measurement files as LabVIEW writes them, with every choice it offers."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field


@dataclass(frozen=True)
class Write:
    """One write: its channels, and what stands in its header."""

    columns: Mapping[str, Sequence[float | None]]  # None is an empty cell
    x: Sequence[float | None] = ()
    comment: str = ""  # in its first row
    units: Sequence[str] = ()
    start: str = "02:26:06,3043494224548339844"
    step: float = 1.0
    samples: int | None = None  # what the header says; the truth where it is None
    # Of each channel, where they differ:
    xs: Sequence[Sequence[float | None]] = ()
    starts: Sequence[str] = ()
    steps: Sequence[float] = ()
    x0s: Sequence[float] = ()
    date: str = "2026/10/15"


@dataclass(frozen=True)
class Style:
    """How the file is written."""

    x_columns: str = "One"  # "No", "One", "Multi"
    several: bool = True  # a header for every write; else only for the first
    separator: str = "\t"
    decimal: str = ","
    cell_decimal: str = ""  # the decimal mark of the cells, where it is not the header's
    end: str = "\r\n"
    encoding: str = "utf-8"
    special: bool = False
    again: frozenset[int] = field(default_factory=frozenset)  # writes before which the file header is repeated


def lvm(writes: Sequence[Write], style: Style = Style()) -> bytes:
    """The file."""
    lines = _file_header(style)
    for i, write in enumerate(writes):
        if i in style.again:
            lines += _file_header(style)
        if i == 0 or style.several:
            lines += _segment_header(write, style)
        lines += _rows(write, style)
        lines += [""] if style.several else []
    return (style.end.join(lines) + style.end).encode(style.encoding)


def _file_header(style: Style) -> list[str]:
    s = style.separator
    lines = [
        f"LabVIEW Measurement{s}", f"Writer_Version{s}2", f"Reader_Version{s}2", _separator(s),
        f"Decimal_Separator{s}{style.decimal}", f"Multi_Headings{s}{'Yes' if style.several else 'No'}",
        f"X_Columns{s}{style.x_columns}", f"Time_Pref{s}Relative", f"Operator{s}<script>", f"Date{s}2026/10/15",
        f"Time{s}02:26:06,3043494224548339844", f"***End_of_Header***{s}", s,
    ]  # fmt: skip
    special = [f"***Start_Special***{s}", f"Packet_Notes{s}", f"anything{s}1{style.decimal}5", f"***End_Special***{s}"]
    return lines + special if style.special else lines


def _separator(separator: str) -> str:
    words = {"\t": "Tab", ",": "Comma"}
    return f"Separator{separator}{words.get(separator, '')}"


def _segment_header(write: Write, style: Style) -> list[str]:
    s, many = style.separator, len(write.columns)
    between = s * 2 if style.x_columns == "Multi" else s

    def line(tag: str, values: Sequence[object]) -> str:
        return tag + s + between.join(str(value) for value in values) + s

    rows = len(next(iter(write.columns.values())))
    names = list(write.columns)
    header = [line("Channels", [many]), line("Samples", [rows if write.samples is None else write.samples] * many)]
    header += [line("Date", [write.date] * many), line("Time", write.starts or [write.start] * many)]
    header += [line("Y_Unit_Label", write.units)] if write.units else []
    header += [
        line("X_Dimension", ["Time"] * many),
        line("X0", [number(x0, style) for x0 in write.x0s or [0.0] * many]),
    ]
    header += [
        line("Delta_X", [number(step, style) for step in write.steps or [write.step] * many]),
        f"***End_of_Header***{s}",
    ]
    named = (
        [cell for name in names for cell in ("X_Value", name)] if style.x_columns == "Multi" else ["X_Value", *names]
    )
    return [*header, s.join([*named, "Comment"])]


def _rows(write: Write, style: Style) -> list[str]:
    rows = []
    for i, values in enumerate(zip(*write.columns.values(), strict=True)):
        cells = [number(value, style) for value in values]
        if style.x_columns == "Multi":
            xs = (each[i] for each in write.xs or [write.x] * len(cells))
            cells = [cell for x, y in zip(xs, cells, strict=True) for cell in (number(x, style), y)]
        else:
            cells = [number(write.x[i], style) if style.x_columns != "No" else "", *cells]
        rows.append(style.separator.join(cells + ([write.comment] if i == 0 and write.comment else [])))
    return rows


def number(value: float | None, style: Style) -> str:
    """A cell: every digit that the number needs, and always a fraction, as LabVIEW writes."""
    if value is None:
        return ""
    if not math.isfinite(value):
        return "NaN" if math.isnan(value) else "Inf" if value > 0 else "-Inf"
    whole, exponent, power = repr(float(value)).partition("e")
    whole = whole if "." in whole else f"{whole}.0"
    return (whole + exponent.upper() + power).replace(".", style.cell_decimal or style.decimal)
