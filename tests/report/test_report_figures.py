"""Figures: well-formed, complete, and the same in every process."""

import hashlib
import os
import re
import subprocess
import sys
from dataclasses import replace
from itertools import combinations, pairwise
from pathlib import Path
from typing import NamedTuple
from xml.etree import ElementTree

import numpy as np
import pytest
from matplotlib.font_manager import FontProperties
from matplotlib.textpath import TextPath
from report_documents import HOSTILE, still, zoomable

from davinci_forces.report import writers
from davinci_forces.report.content import Document, Figure, Figure3D, Panel, walk
from davinci_forces.report.content.marks import Histogram, Line, Line3D, Points, Tiles
from davinci_forces.report.figures.palette import COLOURS
from davinci_forces.report.figures.panels import wrap_label
from davinci_forces.report.figures.svg import svg
from davinci_forces.report.figures.ticks import axis_over, power_of_ten
from davinci_forces.report.writers import html, pdf
from davinci_forces.report.writers.pictures import shrink


def test_every_mark_is_drawn_into_well_formed_svg_of_the_width_of_the_page(full: Document) -> None:
    figures = [block for block in walk(full) if isinstance(block, Figure | Figure3D)]
    assert len(figures) == 4
    for figure in figures:
        root = ElementTree.fromstring(svg(figure))
        assert root.attrib["width"] == "481.889764pt"  # 170 mm
        panels = figure.panels if isinstance(figure, Figure) else (figure,)
        drawn = len(list(root.iter("{http://www.w3.org/2000/svg}path")))
        assert drawn >= sum(len(panel.marks) + 2 for panel in panels)  # and each panel's grid and axes


SVG = "{http://www.w3.org/2000/svg}"


class Words(NamedTuple):
    """Words of a picture and their box [pt], from the top left."""

    text: str
    left: float
    top: float
    right: float
    bottom: float


def words_of(picture: str) -> list[Words]:
    """All words of a picture, measured in the font that they name."""
    found = []
    for element in ElementTree.fromstring(picture).iter(f"{SVG}text"):
        style = dict(part.split(": ") for part in element.attrib["style"].split("; "))
        font = FontProperties(family=style["font-family"], weight=style.get("font-weight", "normal"))
        extent = TextPath(
            (0, 0), element.text.replace("$", r"\$"), size=float(style["font-size"][:-2]), prop=font
        ).get_extents()
        x, y = float(element.attrib["x"]), float(element.attrib["y"])
        start = {"start": 0.0, "middle": -extent.width / 2, "end": -extent.width}[style["text-anchor"]]
        if "transform" in element.attrib:
            found.append(Words(element.text, x - extent.y1, y - extent.width / 2, x, y + extent.width / 2))
        else:
            found.append(Words(element.text, x + start, y - extent.y1, x + start + extent.width, y - extent.y0))
    return found


def axes_of(picture: str) -> list[tuple[float, float, float, float]]:
    """Left, top, right and bottom of the axes of a picture [pt]."""
    boxes = [element.attrib for element in ElementTree.fromstring(picture).iter(f"{SVG}rect")]
    corners = [[float(box[name]) for name in ("x", "y", "width", "height")] for box in boxes]
    return [(x, y, x + width, y + height) for x, y, width, height in corners]


def test_words_are_drawn_as_they_are() -> None:
    drawn = " ".join(words.text for words in words_of(svg(still())))
    for words in (*HOSTILE.split()[:4], "$x$ [s]", "_under $y$", "counts", "LSE", "WLSE"):
        assert words in drawn


def crowded(columns: int) -> Figure:
    """Long labels, long legends and awkward numbers in panels of little room."""
    x = np.linspace(0, 1e-4, 50)
    labels = ("a legend entry of very many words", "another that is long", "short")
    lines = tuple(Line(x, x * 1e9 * i, label) for i, label in enumerate(labels, 1))
    panel = Panel("Title", "effort of the joint [N m]", "angular acceleration of the joint [rad/s²]", lines)
    bars = Panel("", "x", "autocorrelation", (Histogram([1e5, 2e5, 3e5], [1e-5, 2e-5], "counts"),))
    return Figure("", "", (panel, bars) * columns, columns=columns, height=45)


@pytest.mark.parametrize("figure", [still(), zoomable(300, "z"), crowded(1), crowded(2), crowded(3)])
def test_nothing_is_clipped_no_words_touch_and_no_legend_covers_data(figure: Figure) -> None:
    picture = svg(figure)
    height, words, axes = (
        float(ElementTree.fromstring(picture).attrib["height"][:-2]),
        words_of(picture),
        axes_of(picture),
    )
    assert len(axes) == len(figure.panels)
    for left, top, right, bottom in axes:
        assert bottom - top > 0.3 * 45 * 72 / 25.4
        named = {name for panel in figure.panels for mark in panel.marks for name in getattr(mark, "names", ())}
        named |= {"1.00", "−0.50"}  # of tiles
        over = [one for one in words if one.left < right and one.right > left and one.top < bottom and one.bottom > top]
        assert {one.text for one in over} <= named
    for one in words:
        assert one.left >= 0
        assert one.top >= 0
        assert one.right <= 170 / 25.4 * 72
        assert one.bottom <= height
    for one, other in combinations(words, 2):
        apart = one.right <= other.left or other.right <= one.left or one.bottom <= other.top or other.bottom <= one.top
        assert apart, (one, other)


@pytest.mark.parametrize("columns", [1, 2, 3])
@pytest.mark.parametrize(("low", "high"), [(-0.065, 0.105), (-1.05, 1.05), (0, 12_345), (-7e-5, 9e-5), (0, 100)])
def test_no_number_on_an_axis_touches_the_next(low: float, high: float, columns: int) -> None:
    x = np.linspace(low, high, 50)
    figure = Figure("", "", (Panel("", "position [m]", "y", (Line(x, x),)),) * columns, columns=columns, height=45)
    picture = svg(figure)
    for left, _, right, bottom in axes_of(picture):
        below = [one for one in words_of(picture) if bottom < one.top < bottom + 16 and left - 9 < one.left < right]
        numbers = sorted((one for one in below if one.text != "position [m]"), key=lambda one: one.left)
        assert len(numbers) >= 2
        assert all(one.right < next_one.left for one, next_one in pairwise(numbers))


def test_an_axis_that_counts_has_whole_numbers_and_one_with_a_unit_does_not() -> None:
    for values, label, texts in (
        ([1.0, 2.0], "window", ("1", "2")), ([0.0, 2.0], "window", ("0", "1", "2")),
        ([1.0, 2.0], "time [s]", ("1.0", "1.2", "1.4", "1.6", "1.8", "2.0")),
        ([0.0, 0.5], "share", ("0.0", "0.1", "0.2", "0.3", "0.4", "0.5")),
        ([0.0, 12.0], "parameters", ("0", "5", "10")), ([0.0, 12.0], "time [s]", ("0.0", "2.5", "5.0", "7.5", "10.0")),
    ):  # fmt: skip
        assert axis_over([np.array(values)], (0.0, 0.0), False, label).with_numbers(5).texts == texts
    assert axis_over([np.array([1.0, 3.0])], (0.05, 0.05), False, "window").with_numbers(5).texts == ("1", "2", "3")


def test_the_label_of_an_upright_axis_in_space_stands_off_its_numbers() -> None:
    x, y, z = np.array([[0.0, 0.1], [0.0, 0.2], [-0.2, 0.0]])
    picture = svg(Figure3D("", "", (Line3D(x, y, z, "", "grey", "solid"),), "space", height=88))
    [label] = [one for one in words_of(picture) if one.text == "z [m]"]
    numbers = [one for one in words_of(picture) if one.text[-1].isdigit()]
    assert numbers
    assert not any(
        abs(one.top - label.top) < 8 and one.left < label.right and label.left < one.right for one in numbers
    )


@pytest.mark.parametrize(
    ("greatest", "taken"), [(0, 0), (1, 0), (19_999, 0), (1e5, 3), (2.5e-4, -6), (1e-3, -3), (3e9, 9)]
)
def test_axes_take_a_power_of_ten_out_of_large_and_small_numbers_only(greatest: float, taken: int) -> None:
    assert power_of_ten(greatest) == taken


def test_a_long_axis_label_gives_its_unit_a_line_of_its_own() -> None:
    assert wrap_label("velocity [rad/s]", 60) == "velocity [rad/s]"
    assert wrap_label("velocity [rad/s]", 20) == "velocity\n[rad/s]"


def test_a_figure_is_drawn_once() -> None:
    figure = zoomable(50, "z")
    assert svg(figure) is svg(figure)


def test_a_figure_of_a_million_samples_stays_small() -> None:
    assert len(svg(zoomable(1_000_000, "z"))) < 200_000


def test_another_process_gives_the_same_bytes(full: Document) -> None:
    program = (
        "import hashlib; from report_documents import document; from davinci_forces.report.writers import html, pdf;"
        "d = document();"
        "[print(hashlib.sha256(w.render(d)).hexdigest()) for w in (pdf, html)]"
    )
    here = Path(__file__).resolve()
    path = os.pathsep.join(map(str, [here.parent, here.parents[2], here.parents[2] / "pipeline"]))
    environment = os.environ | {"PYTHONHASHSEED": "77", "PYTHONPATH": path}
    result = subprocess.run(
        [sys.executable, "-c", program], capture_output=True, text=True, check=True, env=environment, timeout=120
    )
    assert result.stdout.split() == [hashlib.sha256(writer.render(full)).hexdigest() for writer in (pdf, html)]


def test_all_files_written_side_by_side_are_those_written_alone(full: Document) -> None:
    robot = replace(full, file="robot", links=(("Report", "report.html"),))
    files = writers.render_all((full, robot))
    assert list(files) == ["report.html", "report.pdf", "robot.html", "robot.pdf"]
    assert files["report.html"] == html.render(full)
    assert files["report.pdf"] == pdf.render(full) == files["robot.pdf"]
    assert b'<a href="robot.pdf">PDF</a>' in files["robot.html"]
    assert b'<a href="report.html">Report</a>' in files["robot.html"]


def test_importing_the_content_imports_no_drawing_catalogue() -> None:
    program = (
        "import sys; from davinci_forces.report import content; from davinci_forces.report.writers import html, pdf; "
        "print([n for n in ('matplotlib', 'typst', 'jinja2', 'pandas') if n in sys.modules])"
    )
    root = str(Path(__file__).parents[2])
    result = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True, cwd=root)
    assert result.stdout.strip() == "[]"


def test_the_name_of_a_point_is_readable_on_a_line() -> None:
    """A halo in the colour of the page lies between the line and the letters, on a light page and on a dark one."""
    x = np.linspace(0.0, 1.0, 50)
    marks = (Line(x, np.ones(50), "effort"), Points(x[:1], np.ones(1), names=("+2.08",)))
    picture = svg(Figure("F", "f", (Panel("", "time [s]", "y", marks),)))
    [style] = re.findall(r'<text [^>]*style="([^"]*)">\+2\.08<', picture)
    assert f"paint-order: stroke; stroke: {COLOURS['paper']}; stroke-width: 2.5" in style
    assert picture.index("+2.08") > picture.index("<path")
    assert "stroke:var(--paper)" in shrink(picture)


def test_a_matrix_is_tiles_with_their_numbers_and_names() -> None:
    tiles = Tiles([1.0, -0.95, -0.95, 1.0], ("θ1 inertia", "θ2 gravity, sine"))
    drawn = svg(Figure("Matrix.", "Two by two.", (Panel("", "", "", (tiles,)),)))
    assert drawn.count("−0.95") == 2
    for words in ("θ1 inertia", "θ2 gravity, sine", ">θ1<", ">θ2<"):
        assert words in drawn
    assert drawn.count("opacity") >= 4
    with pytest.raises(ValueError, match="2 names need their square of numbers, not 3"):
        Tiles([1.0, 2.0, 3.0], ("a", "b"))
