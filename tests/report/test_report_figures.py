"""Figures: well-formed, complete, and the same in every process."""

import hashlib
import html as html_text
import os
import re
import subprocess
import sys
from dataclasses import replace
from itertools import pairwise
from pathlib import Path
from xml.etree import ElementTree

import matplotlib as mpl
import numpy as np
import pytest
from matplotlib.text import Text
from report_documents import HOSTILE, still, zoomable

from davinci_forces.report import writers
from davinci_forces.report.content import Document, Figure, Figure3D, Histogram, Line, Panel, Tiles, walk
from davinci_forces.report.figures import together
from davinci_forces.report.figures.panels import wrap_label
from davinci_forces.report.figures.svg import STYLE, draw_figure, draw_svg, svg
from davinci_forces.report.figures.ticks import power_of_ten
from davinci_forces.report.writers import html, pdf


def test_every_mark_is_drawn_into_well_formed_svg_of_the_width_of_the_page(full: Document) -> None:
    figures = [block for block in walk(full) if isinstance(block, Figure | Figure3D)]
    assert len(figures) == 4
    for figure in figures:
        root = ElementTree.fromstring(svg(figure))
        assert root.attrib["width"] == "481.889764pt"  # 170 mm
        assert len(list(root.iter("{http://www.w3.org/2000/svg}path"))) > 20


def test_words_are_drawn_as_they_are_even_where_matplotlib_reads_signs() -> None:
    drawn = html_text.unescape(" ".join(re.findall(r"<text[^>]*>(.*?)</text>", svg(still()), re.DOTALL)))
    for words in (*HOSTILE.split()[:4], "$x$ [s]", "_under $y$", "counts", "LSE", "WLSE"):
        assert words in drawn
    with mpl.rc_context(STYLE):
        texts = [text for text in draw_figure(still()).findobj(Text) if "$" in text.get_text()]
    assert len(texts) >= 3
    assert not any(text.get_parse_math() for text in texts)


def crowded(columns: int) -> Figure:
    """Long labels, long legends and awkward numbers in panels of little room."""
    x = np.linspace(0, 1e-4, 50)
    labels = ("a legend entry of very many words", "another that is long", "short")
    lines = tuple(Line(x, x * 1e9 * i, label) for i, label in enumerate(labels, 1))
    panel = Panel("Title", "effort of the joint [N m]", "angular acceleration of the joint [rad/s²]", lines)
    bars = Panel("", "x", "autocorrelation", (Histogram([1e5, 2e5, 3e5], [1e-5, 2e-5], "counts"),))
    return Figure("", "", (panel, bars) * columns, columns=columns, height=45)


@pytest.mark.parametrize("figure", [still(), zoomable(300, "z"), crowded(1), crowded(2), crowded(3)])
def test_nothing_is_clipped_and_no_legend_covers_data(figure: Figure) -> None:
    with mpl.rc_context(STYLE):
        canvas = draw_figure(figure)
        canvas.savefig(Path(os.devnull), format="svg")
        box = canvas.get_tightbbox()
        height = canvas.get_size_inches()[1]
        drawn = [(axes.get_legend(), axes.get_window_extent()) for axes in canvas.axes]
        assert min(box.x0, box.y0) >= 0
        assert box.x1 <= 170 / 25.4
        assert box.y1 <= height
        for legend, inside in drawn:
            assert inside.height > 0.4 * 45 / 25.4 * canvas.dpi
            assert legend is None or legend.get_window_extent().y0 >= inside.y1 - 1


@pytest.mark.parametrize("columns", [1, 2, 3])
@pytest.mark.parametrize(("low", "high"), [(-0.065, 0.105), (-1.05, 1.05), (0, 12_345), (-7e-5, 9e-5), (0, 100)])
def test_no_number_on_an_axis_touches_the_next(low: float, high: float, columns: int) -> None:
    x = np.linspace(low, high, 50)
    figure = Figure("", "", (Panel("", "position [m]", "y", (Line(x, x),)),) * columns, columns=columns, height=45)
    with mpl.rc_context(STYLE):
        canvas = draw_figure(figure)
        canvas.savefig(Path(os.devnull), format="svg")
        for axes in canvas.axes:
            inside = axes.get_window_extent()
            drawn = [text.get_window_extent() for text in axes.get_xticklabels() if text.get_text()]
            seen = [box for box in drawn if inside.x0 <= (box.x0 + box.x1) / 2 <= inside.x1]
            assert len(seen) >= 2
            assert all(one.x1 < next_one.x0 for one, next_one in pairwise(seen))


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


@pytest.mark.parametrize("program", [together.PROGRAM, "raise SystemExit(3)"])
def test_figures_drawn_by_several_processes_are_the_same_bytes_and_none_is_missing_when_one_ends(
    program: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(together, "PROGRAM", program)
    monkeypatch.setattr(os, "cpu_count", lambda: 2)
    figures = [zoomable(40 + i, f"z{i}") for i in range(2 * together.MIN_FIGURES_PER_PROCESS)]
    together.draw_together(figures)
    assert [svg(figure) for figure in figures] == [draw_svg(figure) for figure in figures]


def test_a_figure_of_a_million_samples_stays_small() -> None:
    assert len(svg(zoomable(1_000_000, "z"))) < 200_000


def test_another_process_gives_the_same_bytes(full: Document) -> None:
    program = (
        "import hashlib; from report_documents import document; from davinci_forces.report.writers import html, pdf;"
        "d = document();"
        "[print(hashlib.sha256(w.render(d)).hexdigest()) for w in (pdf, html)]"
    )
    path = os.pathsep.join([str(Path(__file__).parent), str(Path(__file__).parents[2])])
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


def test_a_matrix_is_tiles_with_their_numbers_and_names() -> None:
    tiles = Tiles([1.0, -0.95, -0.95, 1.0], ("θ1 inertia", "θ2 gravity, sine"))
    drawn = svg(Figure("Matrix.", "Two by two.", (Panel("", "", "", (tiles,)),)))
    assert drawn.count("−0.95") == 2
    for words in ("θ1 inertia", "θ2 gravity, sine", ">θ1<", ">θ2<"):
        assert words in drawn
    assert drawn.count("opacity") >= 4
    with pytest.raises(ValueError, match="2 names need their square of numbers, not 3"):
        Tiles([1.0, 2.0, 3.0], ("a", "b"))
