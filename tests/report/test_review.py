"""Ratings of a report: what the page exports, what the next report shows, and that no words of theirs are markup."""

import hashlib
import json
import re
import shutil
import tomllib
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import pytest
from browser import CHROMIUM, Browser
from report_documents import document
from typer.testing import CliRunner

from davinci_forces.cli import app
from davinci_forces.errors import BadStudy
from davinci_forces.report.content import Rated
from davinci_forces.report.writers import html
from davinci_forces.study import review
from davinci_forces.study.review import Rating

HASH, OLD = "a" * 64, "b" * 64
HOSTILE = (
    "</script><script>document.title = 'hacked'</script><b>'\"\\ \n\t# [[rating]] = \"\"\" ''' "
    "$x$ `c` **b** [@trust] \\u0041 \x7f \u2028 é 𝄞"
)
GOOD = f'[[rating]]\nfigure = "zoom"\nverdict = "doubt"\nresults = "{HASH}"\n'
BROWSER = pytest.mark.skipif(CHROMIUM is None, reason="no Chromium on the path to open the report in")


def read(tmp_path, text: str) -> tuple[Rating, ...]:
    (tmp_path / "review.toml").write_text(text, encoding="utf-8", newline="")
    return review.read(tmp_path / "review.toml")


def test_a_rating_says_what_of_whom_and_of_which_numbers(tmp_path):
    [first, second] = read(
        tmp_path,
        f'{GOOD}[[rating]]\nrun = "push"\nverdict = "accept"\ncomment = "a\\nb"\nreviewer = "R"\ndate = "2026-01-02"\n'
        f'results = "{OLD}"\n',
    )
    assert first == Rating("figure", "zoom", "doubt", "", "", "", HASH)
    assert second == Rating("run", "push", "accept", "a\nb", "R", "2026-01-02", OLD)
    assert read(tmp_path, "") == ()


def test_a_verdict_on_the_study_stands_beside_the_ratings(tmp_path):
    """Last, wherever it stands in the file; a file without it, as of earlier versions, is valid."""
    verdict = f'[verdict]\nverdict = "reject"\nreviewer = "R"\nresults = "{HASH}"\n'
    assert [rating.subject for rating in read(tmp_path, verdict + GOOD)] == ["figure", "study"]
    assert read(tmp_path, verdict) == (Rating("study", "", "reject", "", "R", "", HASH),)
    with pytest.raises(BadStudy, match=r"review.toml:2: verdict: verdict must be one of accept, doubt, reject"):
        read(tmp_path, verdict.replace("reject", "maybe"))


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ('verdict = "doubt"', 'verdict = "fine"', "review.toml:3: .*verdict must be one of accept, doubt, reject"),
        (f'results = "{HASH}"', 'results = "x"', "review.toml:4: .*results must be the SHA-256"),
        (f'results = "{HASH}"', "", "review.toml:1: rating 1: results must be the SHA-256 of the rated results.json"),
        ('figure = "zoom"', "", "give what is rated"),
        ('figure = "zoom"', 'figure = "zoom"\nrun = "push"', "give what is rated"),
        ('figure = "zoom"', 'figure = "zoom"\ncoment = "x"', "review.toml:3: .*unknown key 'coment'"),
        ("[[rating]]", "[[ratings]]", "unknown key 'ratings'"),
        ("[[rating]]", "[[rating]", "review.toml: "),
    ],
)
def test_what_is_wrong_with_a_review_is_said_with_its_line(tmp_path, old, new, words):
    assert old in GOOD
    with pytest.raises(BadStudy, match=words):
        read(tmp_path, GOOD.replace(old, new))


@pytest.fixture
def finished(analysed, tmp_path) -> Path:
    shutil.copytree(analysed.parent.parent, tmp_path / "lab")
    return tmp_path / "lab" / "raw" / "arm"


def call(*arguments, code=0) -> str:
    result = CliRunner().invoke(app, [str(a) for a in arguments], env={"COLUMNS": "400", "TERM": "dumb"})
    assert result.exit_code == code, result.output
    return result.output


def toml(*ratings: dict[str, str]) -> str:
    """A review as the page writes it; TOML's basic strings are JSON's, but for DEL."""
    lines = [
        "[[rating]]\n"
        + "".join(f"{key} = {json.dumps(value).replace(chr(127), chr(92) + 'u007f')}\n" for key, value in one.items())
        for one in ratings
    ]
    return re.sub(r"\\u(d[89ab]\w\w)\\u(d[c-f]\w\w)", lambda pair: json.loads(f'"{pair[0]}"'), "\n".join(lines))


@pytest.mark.slow
def test_the_next_report_shows_ratings_as_text_and_says_when_numbers_changed_since(finished):
    reports = finished.parents[1] / "reports" / "arm"
    page = (reports / "report.html").read_text()
    report_id = re.search(r"report ID (\w{32})", page)[1]
    now = hashlib.sha256((reports / "results.json").read_bytes()).hexdigest()
    embedded = json.loads(re.search(r'id="Rated">(.*?)</script>', page)[1])
    assert (embedded["results"], embedded["report"]) == (now, report_id)
    assert embedded["runs"] == ["roll", "slide", "check", "push"]
    said = {"comment": HOSTILE, "reviewer": "<i>R</i>", "date": "2026-01-02"}
    first = {"figure": "answer-figure", "verdict": "doubt", **said, "results": now}
    (finished / "review.toml").write_text(toml(first, {"run": "push", "verdict": "accept", "results": now}))
    assert "the review changed" in call("report", finished)
    page = (reports / "report.html").read_text()
    assert re.search(r"report ID (\w{32})", page)[1] == report_id  # ratings are no part of it
    assert "All ratings are of the numbers that this report shows" in page
    assert "<script>document.title" not in page
    assert "&lt;/script&gt;&lt;script&gt;document.title" in page
    assert "[@trust] \\u0041" in page
    assert "<i>R</i>" not in re.sub(r'id="Rated">.*?</script>', "", page)
    assert "nothing to do" in call("report", finished)
    call("verify", finished)
    (finished / "review.toml").write_text(toml(first, {"figure": "gone", "verdict": "reject", "results": OLD}))
    assert "the review changed" in call("verify", finished, code=1)  # the page is of the one before
    call("report", finished)
    page = (reports / "report.html").read_text()
    assert "The numbers have changed since 1 rating of 2" in page
    assert "figure gone, not in this report" in page
    (finished / "review.toml").write_text("[[rating]]\n")
    assert "give what is rated" in call("report", finished, code=1)


@pytest.fixture(scope="module")
def browser(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Browser]:
    one = Browser(tmp_path_factory.mktemp("browser"))
    yield one
    one.close()


@pytest.fixture(scope="module")
def page(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A page that has ratings already, one of them of earlier numbers."""
    earlier = (
        Rating("figure", "zoom", "reject", HOSTILE, "R", "2026-01-02", OLD),
        Rating("run", "push", "accept", "", "", "", HASH),
    )
    file = tmp_path_factory.mktemp("report") / "report.html"
    file.write_bytes(html.render(replace(document(), rated=Rated(HASH, "c" * 32, ("roll", "push"), earlier))))
    return file


def fill(browser: Browser, button: str, verdict: str, comment: str) -> None:
    """Rate by the page's own buttons."""
    browser.run(f"document.querySelector({button!r}).click()")
    assert browser.run("document.querySelector('dialog').open")
    browser.run(f"document.querySelector('dialog select').value = {verdict!r}")
    browser.run(f"document.querySelector('dialog textarea').value = {json.dumps(comment)}")
    browser.run("document.querySelector('dialog input').value = 'A \"B\"'")
    browser.run("document.querySelector('dialog button').click()")
    assert not browser.run("document.querySelector('dialog').open")


@pytest.mark.medium
@BROWSER
def test_what_the_page_exports_is_what_was_said_and_the_study_s_reader_takes_it(browser, page, tmp_path):
    browser.open(page)
    assert browser.said == []
    fill(browser, "#zoom .tools button[aria-label^=Rate]", "doubt", HOSTILE)
    browser.run("document.querySelector('.reviewing select').value = 'roll'")
    fill(browser, ".reviewing .tools button", "accept", "fine \ud800 half")
    fill(browser, ".reviewing .tools button:nth-of-type(2)", "reject", "first")
    fill(browser, ".reviewing .tools button:nth-of-type(2)", "accept", "on the whole")
    text = browser.run("reviewToml()")
    assert len(tomllib.loads(text)["rating"]) == 4
    old, kept, new, run, study = read(tmp_path, text)
    assert (study.subject, study.verdict, study.comment) == ("study", "accept", "on the whole")
    assert (old.comment, old.results) == (HOSTILE, OLD)
    assert (kept.subject, kept.name, kept.results) == ("run", "push", HASH)
    assert (new.subject, new.name, new.verdict, new.comment, new.reviewer, new.results) == (
        "figure", "zoom", "doubt", HOSTILE, 'A "B"', HASH,
    )  # fmt: skip
    assert (run.name, run.comment) == ("roll", "fine \N{REPLACEMENT CHARACTER} half")
    assert re.fullmatch(r"\d{4}-\d\d-\d\d", new.date)
    assert browser.run("document.querySelector('#zoom .tools button[aria-label^=Rate]').textContent") == "Rated: doubt"
    assert browser.run("document.title") != "hacked"
    assert (
        browser.run("[...document.querySelectorAll('.reviewing li')].some((item) => item.childElementCount)") is False
    )
    assert browser.said == []


@pytest.mark.medium
@BROWSER
def test_a_rating_may_be_changed_and_taken_back(browser, page):
    browser.open(page)
    button = "#zoom .tools button[aria-label^=Rate]"
    fill(browser, button, "doubt", "one")
    fill(browser, button, "accept", "two")
    assert browser.run("ratings.filter((r) => r.name === 'zoom').map((r) => r.comment)") == [HOSTILE, "two"]
    fill(browser, button, "", "")
    assert browser.run("ratings.filter((r) => r.name === 'zoom').map((r) => r.comment)") == [HOSTILE]
    assert browser.run(f"document.querySelector('{button}').textContent") == "Rate"


@pytest.mark.medium
@BROWSER
def test_without_a_script_or_on_paper_nothing_of_it_is_there(browser, page):
    browser.open(page, script=False)
    assert browser.run("document.querySelectorAll('.reviewing, dialog, button').length") == 0
    browser.open(page)
    browser.call("Emulation.setEmulatedMedia", media="print")
    assert browser.run("document.querySelector('.reviewing').checkVisibility()") is False


def test_a_page_that_takes_no_ratings_has_nothing_of_it():
    assert b"reviewToml" not in html.render(document())
