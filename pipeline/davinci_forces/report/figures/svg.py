"""Draw figures as SVG: the same bytes for the same figure, no date, and words as text."""

from weakref import WeakKeyDictionary

from davinci_forces.report.content import PAGE_WIDTH, Figure, Figure3D
from davinci_forces.report.content.marks import AnyMark, Bars, Line3D, Points3D, Tiles
from davinci_forces.report.figures.draw import Frame, draw_bars, draw_mark, draw_sample, stroke
from davinci_forces.report.figures.palette import AXES, GRID, WORDS, assign_looks
from davinci_forces.report.figures.panels import NUMBERS, TICK, Heading, PlacedPanel, place_panels, plan_heading
from davinci_forces.report.figures.shapes import LINE_HEIGHT, NORMAL_SIZE, POINT, SMALL_SIZE, TITLE_SIZE, path, words
from davinci_forces.report.figures.space import draw_space
from davinci_forces.report.figures.ticks import Axis

TICK_LENGTH = 3.0  # [pt]
DRAWN_SAMPLE = 7.5  # [mm] length of the sample before a legend entry
BASELINE = 0.35  # of the size of words: from their middle down to the line that they stand on
drawn: "WeakKeyDictionary[Figure | Figure3D, str]" = WeakKeyDictionary()


def svg(figure: Figure | Figure3D) -> str:
    """The figure as an SVG element; a figure that several reports show is drawn once."""
    if figure in drawn:
        return drawn[figure]
    if isinstance(figure, Figure3D):
        marks = tuple(assign_looks(figure.marks))
        heading, height = plan_heading("", marks, PAGE_WIDTH), figure.height
        content = draw_space(figure, marks, heading.height)
        content += draw_heading(heading, marks, 0.0, heading.height)
    else:
        panels, height = place_panels(figure)
        content = "".join(draw_panel(panel, f"p{i}") for i, panel in enumerate(panels))
    size = f"{PAGE_WIDTH * POINT:.6f}", f"{height * POINT:.6f}"
    drawn[figure] = (
        f'<svg xmlns="http://www.w3.org/2000/svg" width="{size[0]}pt" height="{size[1]}pt" '
        f'viewBox="0 0 {size[0]} {size[1]}">{content}</svg>'
    )
    return drawn[figure]


def draw_panel(panel: PlacedPanel, name: str) -> str:
    """A panel: grid, marks, axes with numbers and labels, heading."""
    place = (POINT * side for side in (panel.left, panel.top, panel.width, panel.height))
    frame = Frame(panel.x, panel.y, *place)
    bars = [mark for mark in panel.marks if isinstance(mark, Bars)]
    drawn_marks = [draw_mark(mark, frame) for mark in panel.marks if not isinstance(mark, Bars)]
    marks = draw_bars(bars, frame) + "".join(behind for behind, _ in drawn_marks)
    marks += "".join(before for _, before in drawn_marks)
    box = f'<rect x="{frame.left:.2f}" y="{frame.top:.2f}" width="{frame.width:.2f}" height="{frame.height:.2f}"/>'
    clip = f'<defs><clipPath id="{name}">{box}</clipPath></defs>'
    return (
        f'{clip}{draw_grid(panel, frame)}<g clip-path="url(#{name})">{marks}</g>{draw_axes(panel, frame)}'
        f"{draw_heading(panel.heading, panel.marks, panel.left, panel.top)}"
    )


def numbers_within(axis: Axis) -> list[tuple[float, str]]:
    """The numbers of an axis, with their places as shares of its length."""
    shares = axis.share(axis.values).tolist()
    return [(share, number) for share, number in zip(shares, axis.texts, strict=True) if -1e-9 <= share <= 1 + 1e-9]


def draw_grid(panel: PlacedPanel, frame: Frame) -> str:
    """Lines at the numbers; none at names."""
    right, bottom = frame.left + frame.width, frame.top + frame.height
    if any(isinstance(mark, Tiles) for mark in panel.marks):
        return ""
    named = any(isinstance(mark, Bars) for mark in panel.marks)
    across = () if named else (frame.left + share * frame.width for share, _ in numbers_within(panel.x))
    up = (bottom - share * frame.height for share, _ in numbers_within(panel.y))
    d = "".join(f"M{x:.2f} {frame.top:.2f}V{bottom:.2f}" for x in across)
    return path(d + "".join(f"M{frame.left:.2f} {y:.2f}H{right:.2f}" for y in up), stroke(GRID, 0.5))


def draw_axes(panel: PlacedPanel, frame: Frame) -> str:
    """The left and the lower edge, with ticks, numbers and labels."""
    bottom, middle = frame.top + frame.height, frame.left + frame.width / 2
    d = f"M{frame.left:.2f} {frame.top:.2f}V{bottom:.2f}H{frame.left + frame.width:.2f}"
    text = ""
    for share, number in numbers_within(panel.x):
        x = frame.left + share * frame.width
        d += f"M{x:.2f} {bottom:.2f}v{TICK_LENGTH:g}"
        text += lines(x, bottom + (TICK + NUMBERS / 2) * POINT, number, SMALL_SIZE, NUMBERS)
    for share, number in numbers_within(panel.y):
        y = bottom - share * frame.height
        d += f"M{frame.left:.2f} {y:.2f}h-{TICK_LENGTH:g}"
        text += words(frame.left - TICK_LENGTH - 3, y + BASELINE * SMALL_SIZE, number, WORDS, SMALL_SIZE, "end")
    below = bottom + (TICK + panel.x.lines * NUMBERS + LINE_HEIGHT / 2) * POINT
    text += lines(middle, below, panel.x.label, NORMAL_SIZE)
    for i, label in enumerate(reversed(panel.y.label.split("\n"))):
        x = panel.left - TICK - panel.y_numbers - (i + 0.4) * LINE_HEIGHT
        text += words(x * POINT, frame.top + frame.height / 2, label, WORDS, NORMAL_SIZE, "middle", turned=True)
    return path(d, stroke(AXES, 0.6)) + text


def lines(
    x: float, y: float, text: str, size: float, height: float = LINE_HEIGHT, anchor: str = "middle", bold: bool = False
) -> str:
    """Lines of words, `height` [mm] apart, the first one with its anchor at x and its middle at y [pt]."""
    start = y + BASELINE * size
    rows = enumerate(text.split("\n"))
    return "".join(words(x, start + i * height * POINT, row, WORDS, size, anchor, bold) for i, row in rows)


def draw_heading(heading: Heading, marks: tuple[AnyMark | Line3D | Points3D, ...], left: float, bottom: float) -> str:
    """Title and legend above axes whose upper left corner is at (left, bottom) [mm]."""
    first, title_height = bottom - heading.height + LINE_HEIGHT / 2 + 0.5, LINE_HEIGHT * heading.title_lines
    legend = first if heading.across else first + title_height
    svg = ""
    for mark, (text, x, row) in zip((mark for mark in marks if mark.label), heading.entries, strict=True):
        start, y = (left + x) * POINT, (legend + LINE_HEIGHT * row) * POINT
        svg += draw_sample(mark, start, y, DRAWN_SAMPLE * POINT)
        svg += lines(start + (DRAWN_SAMPLE + 1.5) * POINT, y, text, NORMAL_SIZE, anchor="start")
    title = bottom - 1.0 - title_height + LINE_HEIGHT / 2 if heading.across else first
    return svg + lines(left * POINT, title * POINT, heading.title, TITLE_SIZE, anchor="start", bold=True)
