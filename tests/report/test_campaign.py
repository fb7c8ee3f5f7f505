"""`davinci-forces campaign`: many studies on one page, and what of their numbers drifts, varies or stands out."""

import json
import re
import shutil
from datetime import date, timedelta
from pathlib import Path
from urllib.parse import unquote

import numpy as np
import pytest
from browser import CHROMIUM, Browser
from numpy.testing import assert_allclose
from typer.testing import CliRunner

from davinci_forces.cli import app
from davinci_forces.maths.estimation.drift import control_limits, holm, outlier_probabilities, scatter, trend
from davinci_forces.report.content import literal
from davinci_forces.report.content.inline import Span, parse

JOINTS = {"hand_roll": "N m", "instrument_slide": "N"}
PARAMETERS = ("inertia", "gravity, sine", "viscous friction", "Coulomb friction")
STD = 0.01


def call(*arguments, code=0) -> str:
    result = CliRunner().invoke(app, [str(a) for a in arguments], env={"COLUMNS": "400", "TERM": "dumb"})
    assert result.exit_code == code, result.output
    return result.output


def report(home: Path, name: str, started: str, values: dict[str, float], joints=JOINTS) -> Path:
    """A study and the two files of its report that a campaign reads: parameters of 1 but for these, given by key."""
    study, folder = home / "raw" / name, home / "reports" / name
    for made in (study, folder):
        made.mkdir(parents=True)
    (study / "study.toml").write_text("")
    rows, digests = [], []
    for joint, effort in joints.items():
        keys = {f"fit.{joint}.independent.lse.{p}": "kg m^2" for p in PARAMETERS}
        floors = {n: f"ekf.check.{joint}.{n}" for n in ("model_error", "detection_level", "coverage")}
        keys |= dict.fromkeys(floors.values(), effort)
        rows += [{"key": k, "value": values.get(k, 1.0), "std": STD, "unit": unit} for k, unit in keys.items()]
        rows.append({"key": f"fit.{joint}.independent.lse.r2", "value": 0.9, "std": None, "unit": "1"})
        digests.append({"joint": joint, "verdict": "good", "same_path": False, **floors})
    (folder / "results.json").write_text(json.dumps(rows))
    about = {"title": name, "robot": "arm", "simulated": False, "started": started, "joints": digests}
    (folder / "summary.json").write_text(json.dumps(about))
    (folder / "report.html").write_text("")
    return study


def lab(home: Path, count: int, change=lambda i, key: 0.0, dated=True) -> list[Path]:
    """So many studies three days apart, whose numbers are 1, give or take their errors, and `change`."""
    random, studies = np.random.default_rng(0), []
    keys = [f"fit.{joint}.independent.lse.{p}" for joint in JOINTS for p in PARAMETERS]
    for i in range(count):
        when = f"{date(2024, 1, 1) + timedelta(3 * i)}T09:00:00" if dated else ""
        values = {key: 1.0 + STD * random.normal() + change(i, key) for key in keys}
        studies.append(report(home, f"run-{i:02}", when, values))
    return studies


def put_in_use(home: Path, study: Path, model: str, numbers: dict[str, float]) -> None:
    """Let the model error of the hand roll be of this model, and add numbers under keys."""
    summary, stated = (home / "reports" / study.name / name for name in ("summary.json", "results.json"))
    error = f"predict.check.hand_roll.{model}.model_error"
    rows = [{"key": k, "value": x, "std": STD, "unit": "N m"} for k, x in {error: 1.0, **numbers}.items()]
    stated.write_text(json.dumps([*json.loads(stated.read_text()), *rows]))
    summary.write_text(summary.read_text().replace("ekf.check.hand_roll.model_error", error))


def number_of_tests(home: Path) -> int:
    """How many tests share the chance of a false alarm."""
    return int(re.search(r"in all (\d+)\s+tests", page(home))[1])


def page(home: Path) -> str:
    return (home / "reports" / "campaign.html").read_text(encoding="utf-8")


def findings(home: Path) -> list[str]:
    """What the page says is beyond standard errors."""
    bullets = re.search(r"Beyond standard errors.*?<ul>(.*?)</ul>", page(home), re.S)
    items = re.findall(r"<li>(.*?)</li>", bullets[1], re.S) if bullets else []
    return [" ".join(re.sub(r"<[^>]+>", "", item).split()) for item in items]


def test_thirty_studies_fit_one_page_each_linked_to_its_report(tmp_path):
    call("campaign", *lab(tmp_path, 30))
    assert (tmp_path / "reports" / "campaign.pdf").read_bytes().startswith(b"%PDF")
    assert len(page(tmp_path).encode()) < 5e6
    links = re.findall(r'href="(run-\d\d/report\.html)">run-\d\d</a>', page(tmp_path))
    assert {link: links.count(link) for link in links} == {
        f"run-{i:02}/report.html": 1 + 2 * len(JOINTS) for i in range(30)
    }
    assert all((tmp_path / "reports" / link).is_file() for link in links)
    assert "recorded from 2024-01-01 to 2024-03-28" in page(tmp_path)


def test_numbers_that_scatter_as_their_errors_say_are_no_finding(tmp_path):
    call("campaign", *lab(tmp_path, 30))
    assert findings(tmp_path) == []
    assert "No number drifts, varies or stands out" in page(tmp_path)


def test_a_drift_beyond_errors_is_named_with_its_size_and_nothing_else_is(tmp_path):
    key = "fit.hand_roll.independent.lse.viscous friction"
    call("campaign", *lab(tmp_path, 12, lambda i, k: 0.003 * 3 * i * (k == key)))
    [said] = [text for text in findings(tmp_path) if "drifts" in text]
    assert "Hand roll, viscous friction drifts by" in said
    assert "kg m² a day" in said
    slope = float(re.search(r"\((\d\.\d+) ±", said)[1]) if "×" in said else float(re.search(r"by (\d\.\d+)", said)[1])
    assert slope == pytest.approx(3.0 if "×" in said else 0.003, rel=0.1)
    assert all("viscous friction" in text and "Hand roll" in text for text in findings(tmp_path))


def test_a_study_that_stands_out_is_named_and_makes_no_drift(tmp_path):
    key = "fit.instrument_slide.independent.lse.inertia"
    call("campaign", *lab(tmp_path, 12, lambda i, k: 0.2 * (i == 11 and k == key)))
    said = findings(tmp_path)
    assert [text for text in said if "run-11 stands out" in text and "inertia" in text]
    assert not [text for text in said if "drifts" in text]


@pytest.mark.parametrize(
    ("model", "fit", "suffix"),
    [
        ("chosen", "arm.chosen.ridge", "_of_hand_roll"),
        ("chosen_by_log", "hand_roll.chosen.lse", ""),
        ("independent+stribeck.ridge", "hand_roll.independent+stribeck.ridge", ""),
    ],
)
def test_friction_of_the_model_in_use_is_tested_too(tmp_path, model, fit, suffix):
    """Also where that of each joint by itself does not change; the others here are none of this joint and model."""
    studies = lab(tmp_path, 4)
    call("campaign", *studies)
    before, (group, variant, estimator) = number_of_tests(tmp_path), fit.split(".")
    assert findings(tmp_path) == []
    names = [
        f"{fit}.coulomb_friction_of_hand_pitch",
        f"{fit}.coulomb_friction{suffix}.std_noise",
        f"{fit}.inertia{suffix}",
    ]
    names += [f"{group}.{variant}{e}.coulomb_friction{suffix}" for e in (".consistent", f"+dahl.{estimator}")]
    for i, study in enumerate(studies):
        numbers = {f"fit.{fit}.{kind}_friction{suffix}": 1.0 for kind in ("coulomb", "viscous")}
        numbers[f"fit.{fit}.coulomb_friction{suffix}"] += 0.25 * (i == 3)
        put_in_use(tmp_path, study, model, numbers | {f"fit.{name}": 1.0 + i for name in names})
    call("campaign", *studies)
    [said] = findings(tmp_path)
    assert said.startswith("Hand roll, Coulomb friction of the model in use varies by more than its standard errors")
    trend, scatter, outliers, parameters = 1, 1, 4, 2
    assert number_of_tests(tmp_path) == before + parameters * (trend + scatter + outliers)


@pytest.mark.parametrize("other", ["arm.chosen.lse", "arm.chosen.ridge", "hand_roll.chosen.ridge"])
def test_friction_of_another_model_than_the_newest_is_not_compared(tmp_path, other):
    """Nor of the same model with another estimator, or with more friction."""
    studies = lab(tmp_path, 5)
    for i, study in enumerate(studies[:4]):  # the model of the last study has no friction
        fit = other if i == 0 else "arm.chosen.ridge"
        of = "_of_hand_roll" * fit.startswith("arm")
        more = {f"fit.{fit}.stribeck_friction{of}": 1.0} if i == 0 and fit == "arm.chosen.ridge" else {}
        put_in_use(tmp_path, study, "chosen", {f"fit.{fit}.coulomb_friction{of}": 9.0 if i == 0 else 1.0, **more})
    call("campaign", *studies)
    assert findings(tmp_path) == []
    table = page(tmp_path).split("Hand roll: parameters, in every study")[1].partition("</table>")[0]
    heading, *rows = re.findall(r"<tr.*?</tr>", table, re.S)
    assert "Coulomb friction of the model in use" in heading
    assert ["–" in row for row in rows] == [True, False, False, False, True]


def test_least_squares_in_use_is_one_series(tmp_path):
    studies = lab(tmp_path, 3)
    for study in studies:
        put_in_use(tmp_path, study, "independent.lse", {})
    call("campaign", *studies)
    assert "friction of the model in use" not in page(tmp_path)


def test_joints_of_two_robots_share_nothing_but_a_name(tmp_path):
    """Alone, each robot's numbers agree; together, they would vary beyond their errors."""
    studies = lab(tmp_path, 8, lambda i, key: 0.5 * (i % 2))
    call("campaign", *studies)
    assert "varies" in " ".join(findings(tmp_path))
    for study in studies[1::2]:
        summary = tmp_path / "reports" / study.name / "summary.json"
        summary.write_text(summary.read_text().replace('"robot": "arm"', '"robot": "other"'))
    call("campaign", *studies)
    assert findings(tmp_path) == []
    headings = re.findall(r"<h2[^>]*>(.*?)</h2>", page(tmp_path), re.S)
    for heading in ("Hand roll, arm", "Hand roll, other", "Instrument slide, arm", "Instrument slide, other"):
        assert any(heading in text for text in headings), headings


def test_a_chart_has_dates_and_limits_that_values_in_control_keep(tmp_path):
    call("campaign", *lab(tmp_path, 12))
    text = unquote(page(tmp_path))
    assert re.search(r"01-\d\d", text)
    assert "2024" in text
    assert "control limits, which 99.7 %" in text


def test_control_limits_hold_as_many_values_as_they_say():
    random, std, inside = np.random.default_rng(5), np.linspace(0.5, 2.0, 8), []
    for _ in range(2000):
        x, further = 3.0 * std * random.normal(size=(2, 8))  # so that the scatter widens the limits
        centre, width = control_limits(x, std, 0.9)
        inside.append(np.mean(np.abs(further - centre) <= width))
    assert np.mean(inside) == pytest.approx(0.9, abs=0.01)
    few = np.array([1.0, 1.1, 1.2, 1.3])  # they scatter less than errors of 2: Student's quantile of three, 3.182
    centre, width = control_limits(few, np.full(4, 2.0), 0.95)
    assert_allclose([centre, *width], [1.15, *[3.182446 * 2.0 * 1.25**0.5] * 4], rtol=1e-6)
    equal, x = np.ones(1000), random.normal(size=1000)
    centre, width = control_limits(x, equal, 0.9973)
    assert centre == pytest.approx(x.mean())
    assert_allclose(width, 3.0 * max(x.std(ddof=1), 1.0), rtol=0.01)  # Shewhart's
    assert_allclose(control_limits(x, 0.5 * equal, 0.9973)[1], 3.0 * x.std(ddof=1), rtol=0.01)  # of the scatter


def test_without_dates_the_order_is_that_of_the_list(tmp_path):
    studies = lab(tmp_path, 4, dated=False)
    call("campaign", *studies[::-1])
    assert re.findall(r'href="(run-\d\d)/', page(tmp_path))[:4] == ["run-03", "run-02", "run-01", "run-00"]
    assert "in the order in which they are named" in page(tmp_path)


def test_studies_without_results_are_named_and_left_out(tmp_path):
    studies = lab(tmp_path, 3)
    (tmp_path / "reports" / "run-01" / "results.json").unlink()
    said = call("campaign", tmp_path / "raw" / "*")
    assert f"{studies[1]}: left out, it has no results; run `davinci-forces all {studies[1]}`" in said
    assert "run-01" not in re.findall(r'href="(run-\d\d)/', page(tmp_path))
    assert "Left out, as they have no results" in page(tmp_path)


def test_a_campaign_of_nothing_or_of_what_cannot_be_read_says_so(tmp_path):
    studies = lab(tmp_path, 2)
    summary = tmp_path / "reports" / "run-00" / "summary.json"
    text = summary.read_text()
    for content in ("{", "[]", text.replace('"good"', '"<b>"'), text.replace('"arm"', "3")):
        summary.write_text(content)
        assert f"{summary} is not as the report wrote it" in call("campaign", *studies, code=1)
    summary.unlink()
    assert f"{summary} does not exist" in call("campaign", *studies, code=1)
    shutil.rmtree(tmp_path / "reports")
    assert "no study has results" in call("campaign", *studies, code=1)


def test_the_page_goes_where_it_is_asked_to_and_still_leads_to_the_reports(tmp_path):
    call("campaign", *lab(tmp_path, 2), "--out", tmp_path / "elsewhere" / "here")
    [link, *_] = re.findall(
        r'href="([^"]*run-00/report\.html)"', (tmp_path / "elsewhere/here/campaign.html").read_text()
    )
    assert (tmp_path / "elsewhere" / "here" / link).resolve() == tmp_path / "reports/run-00/report.html"


def test_names_that_are_markup_appear_as_text(tmp_path):
    name = "a<b>]($x$"
    call("campaign", report(tmp_path, name, "", {}), *lab(tmp_path, 1))
    assert 'a%3Cb%3E%5D%28%24x%24/report.html">a&lt;b&gt;]($x$</a>' in page(tmp_path)
    assert "<b>" not in page(tmp_path)


def test_the_same_studies_give_the_same_bytes(tmp_path):
    studies = lab(tmp_path, 3)
    made = []
    for out in ("one", "two"):
        call("campaign", *studies, "--out", tmp_path / out)
        made.append([(tmp_path / out / f"campaign.{ending}").read_bytes() for ending in ("html", "pdf")])
    assert made[0] == made[1]


@pytest.mark.medium
@pytest.mark.skipif(CHROMIUM is None, reason="no Chromium on the path to open the page in")
def test_a_campaign_opens_in_a_browser_without_a_word_of_error(tmp_path):
    call("campaign", *lab(tmp_path, 30))
    browser = Browser(tmp_path)
    try:
        browser.open(tmp_path / "reports" / "campaign.html")
        assert browser.run("document.querySelectorAll('figure img').length") == len(JOINTS)
        assert browser.run("[...document.images].every(image => image.complete && image.naturalWidth > 100)")
        assert browser.run("document.querySelector('#campaign-studies tbody').rows.length") == 30
        assert browser.said == []
    finally:
        browser.close()


@pytest.mark.medium
def test_a_report_says_what_a_campaign_asks(analysed, tmp_path):
    call("campaign", analysed, "--out", tmp_path)
    text = (tmp_path / "campaign.html").read_text()
    assert "Hand roll: parameters, in every study" in text
    assert "Detection level" in text
    assert "Coulomb friction of the model in use" in text
    rows = {row["key"] for row in json.loads((analysed.parent.parent / "reports/arm/results.json").read_text())}
    about = json.loads((analysed.parent.parent / "reports/arm/summary.json").read_text())
    keys = [joint[name] for joint in about["joints"] for name in ("model_error", "detection_level", "coverage")]
    assert rows.issuperset(key for key in keys if key is not None)
    assert any(keys)


def test_a_link_is_a_mark_and_words_may_hold_brackets():
    words = literal("a]b[c").replace("]", "\\]")
    assert parse(f"[{words}](x/report.html)") == (Span("link", "a]b[c", "x/report.html"),)
    assert [span.kind for span in parse(literal("[a](x)"))] == ["text"]


def test_a_trend_is_as_uncertain_as_weighted_least_squares_says():
    random, t = np.random.default_rng(1), np.arange(20.0)
    std = random.uniform(0.5, 2.0, 20)
    lines = [trend(t, 0.1 * t + std * random.normal(size=20), std) for _ in range(400)]
    slopes, errors = (np.array([getattr(line, name) for line in lines]) for name in ("slope", "std"))
    assert slopes.mean() == pytest.approx(0.1, abs=4 * slopes.std() / 20)
    # the errors are those of weights alone, or wider where values scatter
    exact = np.sqrt(1.0 / np.sum(std**-2 * (t - np.average(t, weights=std**-2)) ** 2))
    assert slopes.std() == pytest.approx(exact, rel=0.15)
    assert errors.min() == pytest.approx(exact)
    assert trend(np.array([0.0, 0.0, 1.0]), np.zeros(3), np.ones(3)) is None


@pytest.mark.slow
def test_what_is_constant_alarms_no_more_often_than_stated():
    random, alarms = np.random.default_rng(2), 0
    for _ in range(300):
        x = random.normal(size=10)
        p = [
            trend(np.arange(10.0), x, np.ones(10)).p,
            scatter(x, np.ones(10)),
            *outlier_probabilities(x, np.ones(10)).tolist(),
        ]
        alarms += bool(holm(p, 0.05).any())
    assert alarms <= 15 + 4 * np.sqrt(15)


def test_a_trend_through_values_that_scatter_is_that_of_statsmodels():
    from statsmodels.api import WLS, add_constant

    random = np.random.default_rng(4)
    t, std = np.arange(12.0), random.uniform(0.5, 2.0, 12)
    x = 0.2 * t + 3.0 * std * random.normal(size=12)
    fit = WLS(x, add_constant(t), weights=std**-2).fit()
    assert fit.scale > 1.0
    assert_allclose(trend(t, x, std), (fit.params[1], fit.bse[1], fit.pvalues[1]), rtol=1e-9)
    quiet = trend(t, 0.2 * t, std)  # whose errors WLS would take to be nothing
    assert quiet.std == pytest.approx(fit.bse[1] / np.sqrt(fit.scale), rel=1e-9)


def test_holm_stops_at_the_first_test_that_does_not_tell():
    assert holm([0.04, 0.001, 0.02, 0.3], 0.05).tolist() == [False, True, False, False]
    assert holm([0.01, 0.012, 0.02, 0.03], 0.05).tolist() == [True, True, True, True]


def test_holm_s_tests_are_those_of_statsmodels():
    from statsmodels.stats.multitest import multipletests

    random = np.random.default_rng(3)
    for n in (1, 2, 9):
        p = random.uniform(size=n) ** 4
        assert holm(p, 0.05).tolist() == multipletests(p, 0.05, method="holm")[0].tolist()
