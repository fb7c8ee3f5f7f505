"""The report as its readers have it: in a browser, at any width, in the dark, without a script, on paper."""

import csv
import io
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pytest
from browser import CHROMIUM, Browser
from report_documents import document

from davinci_forces.report.content import Document, Number, Prose, Rated, Section, Table
from davinci_forces.report.writers import html
from davinci_forces.report.writers.numbers import CODES

pytestmark = [
    pytest.mark.medium,
    pytest.mark.skipif(CHROMIUM is None, reason="no Chromium on the path to open the report in"),
]
SIZES = [(1440, False), (1024, True), (390, False), (390, True)]


def many_rows() -> Document:
    """The document with a long table in a folded part after it, to be rated as every report is."""
    efforts = [Number((-1) ** i * 10.0 ** (i - 12), "N", key=f"run.{i}") for i in range(24)]
    rows = tuple(
        (f"run-{i}", effort, "a/b" * 20, *[Number(-1.25, "N m", 0.01)] * 6) for i, effort in enumerate(efforts)
    )
    long = Table("Runs.", ("run", "effort", "file", *(f"mean {i}" for i in range(6))), rows, label="runs")
    full = document()
    rated = Rated("0" * 64, "1" * 32, ("run-0", "run-1"), ())
    return replace(full, sections=(*full.sections, Section("Third", "third", (Prose("All:"), long))), rated=rated)


@pytest.fixture(scope="module")
def browser(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Browser]:
    one = Browser(tmp_path_factory.mktemp("browser"))
    yield one
    one.close()


@pytest.fixture(scope="module")
def file(tmp_path_factory: pytest.TempPathFactory) -> Path:
    file = tmp_path_factory.mktemp("report") / "report.html"
    file.write_bytes(html.render(many_rows()))
    return file


def show(browser: Browser, selector: str) -> None:
    browser.run(f"document.querySelector({selector!r}).scrollIntoView({{block: 'center'}})")
    browser.settle()


def place(browser: Browser, selector: str, across: float = 0.5) -> dict[str, float]:
    """A place in an element, in the window [px]."""
    return browser.run(  # type: ignore[no-any-return]
        f"(() => {{ const edge = document.querySelector({selector!r}).getBoundingClientRect();"
        f"return {{x: edge.left + {across} * edge.width, y: edge.top + edge.height / 2}} }})()"
    )


def mouse(browser: Browser, kind: str, **at: float) -> None:
    browser.call("Input.dispatchMouseEvent", type=kind, button="left", clickCount=1, **at)


def click(browser: Browser, selector: str) -> None:
    at = place(browser, selector)
    mouse(browser, "mousePressed", **at)
    mouse(browser, "mouseReleased", **at)
    browser.settle()


CURSOR = "#zoom .area canvas:last-child"
INKED = "canvas.getContext('2d').getImageData(0, 0, canvas.width, canvas.height).data.some(Boolean)"


@pytest.mark.parametrize(("width", "dark"), SIZES)
def test_a_browser_opens_it_without_a_word_and_nothing_is_wider_than_the_window(
    browser: Browser, file: Path, width: int, dark: bool
) -> None:
    browser.open(file, width, dark=dark)
    assert not browser.run("!!document.querySelector('#folded-zoom canvas')")  # in a folded part
    browser.run("document.querySelectorAll('details').forEach((part) => { part.open = true })")
    for figure in ("#zoom", "#folded-zoom"):
        show(browser, figure)
        assert browser.run(f"document.querySelectorAll('{figure} canvas').length") == 4
    assert browser.run("document.documentElement.scrollWidth") == width
    assert browser.run("document.querySelectorAll('*').length") < 1000
    assert browser.said == []


def test_colours_follow_the_page_into_the_dark(browser: Browser, file: Path) -> None:
    shades = []
    for dark in (False, True):
        browser.open(file, dark=dark)
        show(browser, "#zoom")
        shades.append(browser.run("[colour('--words'), getComputedStyle(document.body).backgroundColor]"))
    assert shades == [["#222222", "rgb(255, 255, 255)"], ["#e4e8ed", "rgb(20, 24, 29)"]]


def test_without_a_script_pictures_stand_for_traces_and_tables_are_whole(browser: Browser, file: Path) -> None:
    browser.open(file, script=False)
    browser.settle()
    assert browser.run("document.querySelectorAll('canvas, button, tr[hidden]').length") == 0
    assert browser.run("[...document.images].filter((i) => i.naturalWidth > 600).length") == 4
    assert browser.run("document.querySelector('#zoom img').getClientRects().length") == 1


def test_on_paper_pictures_stand_for_traces_and_tables_are_whole(browser: Browser, file: Path) -> None:
    browser.open(file)
    show(browser, "#zoom")
    parts = ["#zoom img", "#zoom .plot", "nav", "#runs tr[hidden]", "#folded-zoom img"]
    showing = f"{parts}.map((one) => document.querySelector(one).checkVisibility())"
    assert browser.run(showing) == [False, True, True, False, False]
    browser.call("Emulation.setEmulatedMedia", media="print")
    assert browser.run(showing) == [True, False, False, True, False]
    browser.run("document.getElementById('folded').open = true")
    assert browser.run(showing) == [True, False, False, True, True]


def test_the_mouse_reads_values_and_zooms_all_panels(browser: Browser, file: Path) -> None:
    browser.open(file)
    show(browser, "#zoom")
    cursors = "[...document.querySelectorAll('#zoom .area canvas:last-child')]"
    inked = f"{cursors}.map((canvas) => {INKED})"
    assert browser.run(inked) == [False, False]
    mouse(browser, "mouseMoved", **place(browser, CURSOR, 0.4))
    browser.settle()
    assert browser.run(inked) == [True, True]
    view = "plots.get(document.getElementById('zoom')).view"
    before = browser.run(view)
    mouse(browser, "mousePressed", **place(browser, CURSOR, 0.3))
    mouse(browser, "mouseMoved", **place(browser, CURSOR, 0.5))
    mouse(browser, "mouseReleased", **place(browser, CURSOR, 0.5))
    low, high = browser.run(view)
    assert before[0] < low < high < before[1]
    starts = "plots.get(document.getElementById('zoom')).panels.map(({frame}) => frame.x.from(frame.left))"
    assert browser.run(starts) == [low, low]
    browser.run("document.querySelector('#zoom .tools button[aria-label=\"Show all\"]').click()")
    assert browser.run(view) == before


def test_a_finger_that_swipes_over_traces_scrolls_the_page(browser: Browser, file: Path) -> None:
    browser.open(file, 390, 844)
    show(browser, "#zoom")
    before = browser.run("scrollY")
    at = place(browser, CURSOR)
    browser.call("Input.dispatchTouchEvent", type="touchStart", touchPoints=[at])
    for moved in range(10, 160, 10):
        browser.call("Input.dispatchTouchEvent", type="touchMove", touchPoints=[at | {"y": at["y"] - moved}])
    browser.call("Input.dispatchTouchEvent", type="touchEnd", touchPoints=[])
    browser.settle()
    assert browser.run("scrollY") > before + 50


def test_a_legend_entry_hides_its_mark(browser: Browser, file: Path) -> None:
    browser.open(file)
    show(browser, "#zoom")
    legends = browser.run("[...document.querySelectorAll('#zoom .plot .legend')].map((each) => each.innerText.trim())")
    assert [words for words in legends if "legend" in words or "sample" in words] == []  # nor any other class's name
    entry = "document.querySelector('#zoom .legend button')"
    picture = "document.querySelector('#zoom .area canvas').toDataURL()"
    before = browser.run(picture)
    browser.run(f"{entry}.click()")
    assert browser.run(f"{entry}.getAttribute('aria-pressed')") == "false"
    assert browser.run(picture) != before
    browser.run(f"{entry}.click()")
    assert browser.run(picture) == before


def test_the_numbers_of_a_figure_are_saved_as_csv(browser: Browser, file: Path) -> None:
    browser.open(file)
    head, *rows = csv.reader(io.StringIO(browser.run("csv(numbersOf(document.getElementById('zoom')))")))
    model = [i for i, words in enumerate(head) if words.startswith("Effort | model")]
    assert [head[i] for i in model] == ["Effort | model | x | t [s]", "Effort | model | y | τ [N m]"]
    found = np.array([[float(row[i]) for i in model] for row in rows])
    t = np.arange(400) / 100
    np.testing.assert_allclose(found[:, 0], t, rtol=0, atol=2e-7)
    half_a_code = np.ptp(np.sin(t)) / CODES / 2
    np.testing.assert_allclose(found[:, 1], np.sin(t), rtol=0, atol=1.01 * half_a_code)
    assert browser.run("document.querySelectorAll('figure .tools button[aria-label$=CSV]').length") == 4


def test_a_figure_is_saved_as_a_drawing_that_any_program_reads(browser: Browser, file: Path) -> None:
    browser.open(file)
    root = ElementTree.fromstring(browser.run("drawing(document.getElementById('zoom'))"))
    assert root.tag == "{http://www.w3.org/2000/svg}svg"
    styles = [part.text or "" for part in root.iter("{http://www.w3.org/2000/svg}style")]
    assert "stroke:#d55e00" in styles[0]
    assert not any("var(" in text for text in styles)
    assert browser.run("document.querySelectorAll('figure .tools button[aria-label$=paper]').length") == 4
    browser.run("HTMLAnchorElement.prototype.click = function () { window.saved = this.download }")
    browser.run("document.querySelector('#zoom .tools button[aria-label$=paper]').click()")
    assert browser.run("saved").endswith(".svg")


def test_a_table_that_goes_on_beyond_its_right_edge_fades_there_until_it_is_scrolled(
    browser: Browser, file: Path
) -> None:
    browser.open(file, width=1280)
    browser.settle()
    table, faded = "document.querySelector('#runs .scroll')", "matches('.cut')"
    assert browser.run(f"{table}.scrollWidth > {table}.clientWidth && {table}.{faded}")
    browser.run(f"{table}.scrollLeft = {table}.scrollWidth")
    browser.settle()
    assert not browser.run(f"{table}.{faded}")
    assert not browser.run(f"document.querySelector('.table:not(#runs) .scroll').{faded}")


def test_a_long_table_is_folded_searched_and_sorted(browser: Browser, file: Path) -> None:
    browser.open(file)
    shown = "[...document.querySelectorAll('#runs tbody tr:not([hidden])')].map((row) => row.cells[0].textContent)"
    assert len(browser.run(shown)) == 10
    browser.run("document.querySelector('#runs .fold').click()")
    assert len(browser.run(shown)) == 24
    browser.run("document.querySelectorAll('#runs thead button')[1].click()")
    order = [int(name.removeprefix("run-")) for name in browser.run(shown)]
    assert order == sorted(range(24), key=lambda i: (-1) ** i * 10.0 ** (i - 12))
    field = "document.querySelector('input[aria-label=\"Filter the rows of Table 2\"]')"
    browser.run(f"{field}.value = 'RUN-2', {field}.dispatchEvent(new Event('input'))")
    assert sorted(browser.run(shown)) == ["run-2", "run-20", "run-21", "run-22", "run-23"]


def test_a_number_shows_its_key_and_an_address_finds_it(browser: Browser, file: Path) -> None:
    browser.open(file)
    show(browser, "td[data-key='fit.a']")
    click(browser, "td[data-key='fit.a']")
    assert browser.run("document.querySelector('.key code').textContent") == "fit.a"
    assert browser.run("document.querySelector('.key a').hash") == "#key=fit.a"
    for key in ("run.17", "one.a"):  # below the fold of a table, and in a folded part
        browser.run(f"location.hash = 'key={key}'")
        browser.settle()
        assert browser.run("document.querySelector('.found').dataset.key") == key
        assert 0 < place(browser, ".found")["y"] < 900


def test_the_contents_show_where_the_reader_is(browser: Browser, file: Path) -> None:
    browser.open(file)
    for anchor in ("method", "third"):
        browser.run(f"document.getElementById({anchor!r}).scrollIntoView()")
        browser.settle()
        assert browser.run("document.querySelector('nav a[aria-current]').hash") == f"#{anchor}"
    browser.open(file, 390)
    assert browser.run("document.querySelector('nav details').open") is False


AXE = Path(__file__).parent / "node_modules/axe-core/axe.min.js"


@pytest.mark.skipif(not AXE.exists(), reason="no axe-core to judge accessibility with (make axe)")
@pytest.mark.parametrize(("width", "dark"), SIZES)
def test_axe_finds_nothing_that_keeps_anybody_out(browser: Browser, file: Path, width: int, dark: bool) -> None:
    browser.open(file, width, dark=dark)
    browser.run("document.querySelectorAll('details').forEach((part) => { part.open = true })")
    for figure in ("#folded-zoom", "#zoom"):
        show(browser, figure)
    browser.run(AXE.read_text(encoding="utf-8"))
    found = browser.run(
        "axe.run(document, {resultTypes: ['violations']}).then((result) => result.violations.map((one) =>"
        "`${one.id}: ${one.nodes.slice(0, 5).map((node) => node.html.slice(0, 150)).join(' ')}`))"
    )
    assert found == []
