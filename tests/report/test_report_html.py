"""The HTML file: alone in the world, well formed, and text in it is only text."""

import base64
import hashlib
import json
import re
from collections import Counter
from dataclasses import replace
from html.parser import HTMLParser
from typing import Any
from urllib.parse import unquote
from xml.etree import ElementTree

import numpy as np
import pytest
from report_documents import HOSTILE, document, zoomable

from davinci_forces.report.content import Document, Equation, Figure, Number, OnScreen, Panel, Prose, Section, Table
from davinci_forces.report.content.marks import Line
from davinci_forces.report.writers import html
from davinci_forces.report.writers.numbers import CODES, numbers_json
from davinci_forces.report.writers.typesetting import NotTypeset


class Page(HTMLParser):
    """What a browser would see: elements with their attributes, and the text outside scripts."""

    def __init__(self, source: bytes) -> None:
        super().__init__()
        self.elements: list[tuple[str, dict[str, str]]] = []
        self.text, self._inside = "", ""
        self.scripts: list[str] = []  # that run
        self.data: list[str] = []
        self.feed(source.decode())

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.elements.append((tag, {name: value or "" for name, value in attrs}))
        self._inside = tag
        if tag == "script":
            self._list = self.data if dict(attrs).get("type") else self.scripts
            self._list.append("")

    def handle_endtag(self, tag: str) -> None:
        self._inside = ""

    def handle_data(self, data: str) -> None:
        if self._inside == "script":
            self._list[-1] += data
        elif self._inside != "style":
            self.text += data

    def attributes(self, *names: str) -> list[str]:
        return [attributes[name] for _, attributes in self.elements for name in names if name in attributes]


@pytest.fixture(scope="module")
def source(full: Document) -> bytes:
    return html.render(full)


@pytest.fixture(scope="module")
def page(source: bytes) -> Page:
    return Page(source)


def pictures(page: Page) -> list[str]:
    """The SVG of every picture of the page."""
    return [unquote(src.removeprefix("data:image/svg+xml,")) for src in page.attributes("src")]


def columns(page: Page) -> list[np.ndarray]:
    """Every column of numbers that figures are drawn from."""
    return [decode(column) for script in page.data for column in json.loads(script)["columns"]]


def decode(column: Any) -> np.ndarray:
    if isinstance(column, list):
        start, step, count = column
        return start + step * np.arange(count)
    if column[0] == "h":
        start, step, codes = column[1:].split(",")
        numbers = np.frombuffer(base64.b64decode(codes), dtype="<u2")
        return np.where(numbers == 65535, np.nan, float(start) + numbers * float(step))
    return np.frombuffer(base64.b64decode(column[1:]), dtype="<f4" if column[0] == "f" else "<f8")


def test_text_that_looks_like_markup_is_shown_as_text(page: Page) -> None:
    assert page.text.count(HOSTILE) >= 7  # title, heading, contents, prose, verdict, list, listing, cell
    assert "alert(2)" not in page.text
    assert sum(tag == "script" for tag, _ in page.elements) == len(html.SCRIPTS + html.TRACE_SCRIPTS) + len(page.data)
    assert not any("alert(" in script for script in page.scripts)
    assert not any("<" in script for script in page.data)


def test_a_control_character_is_written_out(source: bytes) -> None:
    assert b"indented\x07" not in source
    assert "indented\\x07" in source.decode()


def test_nothing_outside_the_file_is_referred_to(source: bytes, page: Page) -> None:
    references = page.attributes("src", "href", "xlink:href", "action", "data", "srcset", "poster")
    beside = {"report.pdf", "results.json"}  # in the same folder, for those who follow a link
    assert beside < set(references)
    assert all(reference.startswith(("#", "data:image/svg+xml,", "data:,")) for reference in set(references) - beside)
    assert b"@import" not in source
    outside_scripts = re.sub(rb"<script.*?</script>", b"", source, flags=re.DOTALL)
    assert all(target.startswith((b"#", b"%23")) for target in re.findall(rb"url\(([^)]*)", outside_scripts))


def test_ids_are_unique_and_every_link_has_its_target(page: Page) -> None:
    ids = Counter(page.attributes("id"))
    assert [name for name, times in ids.items() if times > 1] == []
    links = {link[1:] for link in page.attributes("href", "xlink:href") if link.startswith("#")}
    assert links - set(ids) == set()
    keys = {attributes["data-key"] for _, attributes in page.elements if "data-key" in attributes}
    assert {"fit.a", "one.a"} == keys


def test_pictures_are_well_formed_whole_and_turn_dark(page: Page) -> None:
    assert len(pictures(page)) == 4
    for picture in pictures(page):
        root = ElementTree.fromstring(picture)
        ids = Counter(element.get("id") for element in root.iter() if element.get("id"))
        assert max(ids.values(), default=1) == 1
        assert set(re.findall(r'(?:href="#|url\(#)([^")]+)', picture)) == set(ids)
        classes = {element.get("class") for element in root.iter() if element.get("class")}
        sheet = root[0].text or ""
        assert all(f".{name}{{" in sheet for names in classes for name in str(names).split())
        assert set(re.findall(r"var\(--(\w+)\)", sheet)) <= set(re.findall(r"--(\w+):", sheet.split("@media")[1]))
    assert any(HOSTILE.split("#")[0].strip() in "".join(ElementTree.fromstring(p).itertext()) for p in pictures(page))


def test_only_the_scripts_of_the_file_may_run(page: Page) -> None:
    (policy,) = (a["content"] for _, a in page.elements if a.get("http-equiv") == "Content-Security-Policy")
    assert policy.startswith("default-src 'none'")
    hashes = [base64.b64encode(hashlib.sha256(script.encode()).digest()).decode() for script in page.scripts]
    assert len(hashes) == len(html.SCRIPTS + html.TRACE_SCRIPTS)
    assert all(f"'sha256-{one}'" in policy for one in hashes)


def half_a_code(values: np.ndarray) -> float:
    """The rounding of a long column, and of the numbers themselves."""
    return 1.01 * np.nanmax(values) * np.finfo(float).eps + 1.01 * (np.nanmax(values) - np.nanmin(values)) / CODES / 2


def test_the_traces_are_the_samples_that_were_put_in(page: Page, full: Document) -> None:
    t = np.arange(400) / 100
    long = [one for one in columns(page) if len(one) == 400]
    for expected in (t, np.sin(t), np.sin(t) - 1, np.sin(t) + 1):
        assert any(np.allclose(one, expected, rtol=0, atol=half_a_code(expected)) for one in long)


def test_a_column_keeps_its_precision_and_marks_share_what_is_alike() -> None:
    late = 1e9 + np.cumsum(np.random.default_rng(1).uniform(0.5, 1.5, 100))
    noise = np.where(np.arange(100) == 7, np.nan, np.sin(np.arange(100.0)))
    figure = Figure(
        "", "", (Panel("", "", "", (Line(late, noise), Line(late, 2 * noise), Line([1, 2, 4], [0, 0, 0]))),)
    )
    content = json.loads(numbers_json(figure))
    first, second, third = (mark["columns"] for mark in content["panels"][0]["marks"])
    assert first["x"] == second["x"] != third["x"]
    np.testing.assert_allclose(decode(content["columns"][first["x"]]), late, rtol=0, atol=half_a_code(late))
    np.testing.assert_allclose(decode(content["columns"][first["y"]]), noise, rtol=0, atol=half_a_code(noise))
    np.testing.assert_array_equal(decode(content["columns"][third["x"]]), [1, 2, 4])


def test_the_caption_says_whether_all_samples_are_shown(page: Page) -> None:
    assert "All 1\N{NARROW NO-BREAK SPACE}604 points are shown." in page.text


def test_the_same_document_gives_the_same_bytes(source: bytes, full: Document) -> None:
    assert html.render(full) == source


def test_simulated_data_are_labelled_and_measured_data_are_not(page: Page) -> None:
    assert "SIMULATED" in page.text
    measured = Document("T", "s", False, (Section("A", "a", (Prose("text"),)),))
    assert b"SIMULATED" not in html.render(measured)


def test_a_report_without_traces_carries_no_script_for_them() -> None:
    plain = html.render(Document("T", "s", False, (Section("A", "a", (Prose("text $x$"),)),)))
    assert len(Page(plain).scripts) == len(html.SCRIPTS)
    assert len(plain) < 45_000


def test_what_is_drawn_has_words_for_those_who_do_not_see_it(page: Page) -> None:
    drawn = [a for tag, a in page.elements if a.get("role") == "img" or tag == "img"]
    words = [attributes.get("aria-label", attributes.get("alt", "")) for attributes in drawn]
    assert {"x is K times y", "Two panels of traces.", "Chain.", HOSTILE, "theta_1", "x^2"} <= set(words)
    assert all(words)
    assert ("html", {"lang": "en", "class": "simulated"}) in page.elements
    assert Counter(a["scope"] for tag, a in page.elements if tag == "th") == {"col": 5, "row": 3}


def test_no_header_of_a_table_is_empty() -> None:
    table = Table("T", ("", "n"), (("a", Number(1)), ("", Number(2))))
    rendered = html.render(Document("T", "s", False, (Section("A", "a", (table,)),))).decode()
    assert '<th scope="col" class="l"><span class="unseen">Column 1</span></th>' in rendered
    assert rendered.count('scope="row"') == 1  # a cell without words heads no row


def test_a_dozen_long_traces_stay_under_five_megabytes() -> None:
    traces = tuple(zoomable(30_000, f"trace-{i}") for i in range(12))
    many = document()
    many = replace(many, sections=(*many.sections, Section("Many", "many", traces)))
    rendered = html.render(many)
    assert len(rendered) < 5_000_000
    assert rendered.decode().count(" points for the 120") == 12


def test_many_traces_share_the_room_that_the_file_has_left() -> None:
    zooms = {f"trace-{i}": zoomable(30_000, f"trace-{i}") for i in range(20)}
    shown = sum(trace.samples for trace in html._thin_figures(zooms, 1_100_000).values())
    assert 90_000 < shown <= 1_100_000 / html.POINT_BYTES


def test_the_picture_of_a_folded_trace_is_small() -> None:
    first, folded = zoomable(20_000, "first"), OnScreen("Others", "others", (zoomable(20_000, "other"),))
    rendered = html.render(Document("T", "s", False, (Section("Traces", "traces", (first, folded)),)))
    large, small = (a["src"] for tag, a in Page(rendered).elements if tag == "img")
    assert len(small) < 0.5 * len(large)
    assert len(small) < 13_000


def test_no_two_scripts_of_a_page_give_one_name_to_two_things() -> None:
    """They share their names, and of two functions of one name a page has the last."""
    scripts = (*html.SCRIPTS, *html.TRACE_SCRIPTS, *html.REVIEW_SCRIPTS)
    outermost = re.compile(r"^(?:async )?(?:function|class|const|let|var) (\w+|\[[^]]*\]|\{[^}]*\})", re.MULTILINE)
    found = [
        re.findall(r"\w+", name)
        for script in scripts
        for name in outermost.findall((html.TEMPLATES / script).read_text())
    ]
    names = Counter(name for each in found for name in each)
    assert len(names) > 50
    assert [name for name, times in names.items() if times > 1] == []


def test_a_wrong_equation_is_named() -> None:
    wrong = Document("T", "s", False, (Section("A", "a", (Equation("x + y", "sum"), Equation("nonsense(", "?"))),))
    with pytest.raises(NotTypeset, match=r"nonsense\("):
        html.render(wrong)
