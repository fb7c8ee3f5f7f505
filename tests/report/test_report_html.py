"""The HTML file: alone in the world, well formed, and text in it is only text."""

import base64
import gzip
import hashlib
import json
import re
import shutil
import subprocess
from collections import Counter
from dataclasses import replace
from html.parser import HTMLParser
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from report_documents import HOSTILE, document, zoomable

from pipeline.report.content import Document, Equation, Prose, Section
from pipeline.report.writers import html
from pipeline.report.writers.typesetting import NotTypeset

CHROMIUM = shutil.which("chromium") or shutil.which("chromium-browser") or shutil.which("google-chrome")


class Page(HTMLParser):
    """What a browser would see: elements with their attributes, and the text outside scripts."""

    def __init__(self, source: bytes) -> None:
        super().__init__()
        self.elements: list[tuple[str, dict[str, str]]] = []
        self.text, self.scripts, self._inside = "", [""], ""
        self.feed(source.decode())

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.elements.append((tag, {name: value or "" for name, value in attrs}))
        self._inside = tag
        if tag == "script":
            self.scripts.append("")

    def handle_endtag(self, tag: str) -> None:
        self._inside = ""

    def handle_data(self, data: str) -> None:
        if self._inside == "script":
            self.scripts[-1] += data
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


def arrays(part: Any) -> list[np.ndarray]:
    """Every array among what the traces are drawn from."""
    if isinstance(part, list):
        return [array for item in part for array in arrays(item)]
    if not isinstance(part, dict):
        return []
    if part.get("type") == "ndarray":
        raw = gzip.decompress(base64.b64decode(part["array"]["data"]))
        return [np.frombuffer(raw, dtype=part["dtype"])]
    return arrays(list(part.values()))


def test_text_that_looks_like_markup_is_shown_as_text(page: Page) -> None:
    assert page.text.count(HOSTILE) >= 7  # title, heading, contents, prose, verdict, list, listing, cell
    assert "alert(2)" not in page.text
    assert sum(tag == "script" for tag, _ in page.elements) == 3
    assert not any("alert(1)" in script for script in page.scripts)


def test_a_control_character_is_replaced(source: bytes) -> None:
    assert b"indented\x07" not in source
    assert "indented\N{REPLACEMENT CHARACTER}" in source.decode()


def test_nothing_outside_the_file_is_referred_to(source: bytes, page: Page) -> None:
    references = page.attributes("src", "href", "xlink:href", "action", "data", "srcset", "poster")
    assert {reference[:1] for reference in references} == {"#", "d"}
    assert all(reference.startswith(("#", "data:,")) for reference in references)
    assert b"@import" not in source
    outside_scripts = re.sub(rb"<script.*?</script>", b"", source, flags=re.DOTALL)
    assert all(target.startswith(b"#") for target in re.findall(rb"url\(([^)]*)", outside_scripts))


def test_ids_are_unique_and_every_link_has_its_target(page: Page) -> None:
    ids = Counter(page.attributes("id"))
    assert [name for name, times in ids.items() if times > 1] == []
    links = {link[1:] for link in page.attributes("href", "xlink:href") if link.startswith("#")}
    assert links - set(ids) == set()
    clips = {clip for value in page.attributes("clip-path") for clip in re.findall(r"url\(#(.*?)\)", value)}
    assert clips
    assert clips - set(ids) == set()


def test_only_the_scripts_of_the_file_may_run(page: Page) -> None:
    (policy,) = (a["content"] for _, a in page.elements if a.get("http-equiv") == "Content-Security-Policy")
    assert policy.startswith("default-src 'none'")
    running = page.scripts[2:]  # the first is empty, the second is data
    hashes = [base64.b64encode(hashlib.sha256(script.encode()).digest()).decode() for script in running]
    assert len(hashes) == 2
    assert all(f"'sha256-{one}'" in policy for one in hashes)


def test_the_traces_are_the_samples_that_were_put_in(page: Page, full: Document) -> None:
    (data,) = (script for script in page.scripts if script.startswith('{"documents"'))
    assert "$$" not in data  # which Bokeh would take for maths, and look for a script that is not here
    found = arrays(json.loads(data))
    t = np.arange(400) / 100
    for expected in (t, np.sin(t), np.sin(t) - 1, np.sin(t) + 1):
        assert any(np.array_equal(array, expected.astype(np.float32)) for array in found)


def test_the_caption_says_whether_all_samples_are_shown(page: Page) -> None:
    assert "All 1\N{NARROW NO-BREAK SPACE}604 samples are shown." in page.text


def test_the_same_document_gives_the_same_bytes(source: bytes, full: Document) -> None:
    assert html.render(full) == source


def test_simulated_data_are_labelled_and_measured_data_are_not(page: Page) -> None:
    assert "SIMULATED" in page.text
    measured = Document("T", "s", False, (Section("A", "a", (Prose("text"),)),))
    assert b"SIMULATED" not in html.render(measured)


def test_a_report_without_traces_carries_no_script() -> None:
    plain = html.render(Document("T", "s", False, (Section("A", "a", (Prose("text $x$"),)),)))
    assert b"<script" not in plain
    assert len(plain) < 30_000


def test_what_is_drawn_has_words_for_those_who_do_not_see_it(page: Page) -> None:
    words = [a["aria-label"] for _, a in page.elements if a.get("role") in ("img", "group")]
    assert {"x is K times y", "Two panels of traces.", "Chain.", HOSTILE, "theta_1", "x^2"} <= set(words)
    assert all(words)
    assert ("html", {"lang": "en", "class": "simulated"}) in page.elements
    assert sum(tag == "th" and a["scope"] == "col" for tag, a in page.elements) == 5


def test_a_dozen_long_traces_stay_under_five_megabytes() -> None:
    traces = tuple(zoomable(30_000, f"trace-{i}") for i in range(12))
    many = document()
    many = replace(many, sections=(*many.sections, Section("Many", "many", traces)))
    rendered = html.render(many)
    assert len(rendered) < 5_000_000
    assert rendered.decode().count("Min–max envelope of 120") == 12


def test_many_traces_share_the_room_that_the_file_has_left() -> None:
    zooms = {f"trace-{i}": zoomable(30_000, f"trace-{i}") for i in range(20)}
    shown = sum(trace.shown for trace in html._thin_figures(zooms, 1_100_000).values())
    assert 90_000 < shown <= 1_100_000 / html.POINT_BYTES


def test_the_outline_of_a_letter_is_in_the_file_once(source: bytes) -> None:
    letters = re.findall(r'id="[^"]*?(DejaVu[\w-]+)"', source.decode())
    assert len(letters) > 40
    assert len(letters) == len(set(letters))


def test_a_wrong_equation_is_named() -> None:
    wrong = Document("T", "s", False, (Section("A", "a", (Equation("x + y", "sum"), Equation("nonsense(", "?"))),))
    with pytest.raises(NotTypeset, match=r"nonsense\("):
        html.render(wrong)


@pytest.mark.skipif(CHROMIUM is None, reason="no Chromium on the path to open the report in")
def test_a_browser_opens_it_without_a_word_and_draws_the_traces(source: bytes, tmp_path: Path) -> None:
    file = tmp_path / "report.html"
    file.write_bytes(source)
    options = "--headless --no-sandbox --disable-gpu --disable-background-networking --enable-logging=stderr --dump-dom"
    profile = f"--user-data-dir={tmp_path / 'profile'}"
    result = subprocess.run(
        [str(CHROMIUM), *options.split(), profile, "--virtual-time-budget=5000", file.as_uri()],
        capture_output=True,
        timeout=90,
        check=True,
        text=True,
    )
    # The browser's own pages speak up, too, where there is no network.
    said = [line for line in result.stderr.splitlines() if "CONSOLE" in line and "source: chrome://" not in line]
    assert said == []
    assert 'class="bk-' in result.stdout
