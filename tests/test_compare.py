"""`davinci-forces compare` and a study's baseline: what changed, came and went, and what is no results.json."""

import json
import math
import shutil
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

from davinci_forces.cli import app
from davinci_forces.errors import BadStudy
from davinci_forces.report.changes import Change, StatedValue, changes
from davinci_forces.study import reading
from tests.arm import write_study


def call(*arguments, code=0) -> str:
    result = CliRunner().invoke(app, [str(a) for a in arguments], env={"COLUMNS": "400", "TERM": "dumb"})
    assert result.exit_code == code, result.output
    return result.output


def compared(a: Path, b: Path) -> list[dict]:
    return json.loads(call("compare", a, b, "--json"))


def results(file: Path, **values) -> Path:
    """A results.json of values, or of (value, std)."""
    pairs = {key: value if isinstance(value, tuple) else (value, None) for key, value in values.items()}
    rows = [{"key": key, "value": value, "std": std, "unit": "N"} for key, (value, std) in pairs.items()]
    file.write_text(json.dumps(rows))
    return file


def changed(a: StatedValue, b: StatedValue) -> bool:
    return bool(changes({"x": a}, {"x": b}))


def test_a_number_has_changed_beyond_two_standard_errors_of_the_difference():
    std = math.hypot(0.3, 0.4)
    for sign in (1, -1):
        assert not changed(StatedValue(5.0, 0.3), StatedValue(5.0 + sign * 1.999 * std, 0.4))
        assert changed(StatedValue(5.0, 0.3), StatedValue(5.0 + sign * 2.001 * std, 0.4))


def test_the_error_of_one_side_alone_counts():
    assert not changed(StatedValue(1.0), StatedValue(1.1, 0.06))
    assert changed(StatedValue(1.0), StatedValue(1.1, 0.04))


@pytest.mark.parametrize("std", [None, 0.0])
def test_without_an_error_a_billionth_is_a_change(std):
    assert not changed(StatedValue(3e6, std), StatedValue(3e6 * (1 + 0.9e-9), std))
    assert changed(StatedValue(3e6, std), StatedValue(3e6 * (1 + 1.1e-9), std))
    assert changed(StatedValue(0.0, std), StatedValue(1e-300, std))
    assert not changed(StatedValue(2.2e-318, std), StatedValue(2.7e-318, std))  # subnormal, with few digits
    assert changed(StatedValue(2.2e-318, std), StatedValue(3e-308, std))


def test_text_and_truth_are_compared_as_they_are_and_nan_is_nan():
    assert not changed(StatedValue("lse"), StatedValue("lse"))
    assert changed(StatedValue("lse"), StatedValue("wlse"))
    assert changed(StatedValue(True), StatedValue(False))
    assert changed(StatedValue(True), StatedValue(1.0))
    assert not changed(StatedValue(math.nan, 1.0), StatedValue(math.nan, 1.0))
    assert changed(StatedValue(math.nan, 1.0), StatedValue(0.0, 1.0))
    assert changed(StatedValue(1.0, 5.0), StatedValue(math.inf, 5.0))


def test_contacts_are_paired_by_their_times_whatever_their_numbers():
    def numbers(*windows: tuple[float, float, float]) -> dict[str, StatedValue]:
        names = ("onset", "release", "peak")
        rows = [(f"contact.a.roll.{n}", window) for n, window in enumerate(windows, 1)]
        return {f"{key}.{name}": StatedValue(x, 0.1) for key, row in rows for name, x in zip(names, row, strict=True)}

    false_one, small, large = (2.0, 3.0, 0.3), (5.0, 6.0, 1.0), (8.0, 9.5, 4.0)
    gone = changes(numbers(false_one, small, large), numbers(small, (8.05, 9.5, 5.0)))
    assert [(c.key, c.after and c.after.value) for c in gone] == [
        *((f"contact.a.roll.1.{name}", None) for name in ("onset", "release", "peak")),
        ("contact.a.roll.3.peak", 5.0),
    ]
    push = {"tissue.a.1.onset": StatedValue(1.0, 0.1), "tissue.a.1.k_t": StatedValue(9.0, 0.1)}  # it has no release
    assert not changes(push, push)
    came = changes(numbers(small, large), numbers(false_one, small, large))
    assert [(c.key, c.before) for c in came] == [(f"contact.a.roll.1.{n}", None) for n in ("onset", "release", "peak")]


def test_another_unit_is_a_change():
    assert changed(StatedValue(1.0, 0.1, "N m"), StatedValue(1.0, 0.1, "A"))


def test_z_counts_standard_errors_of_the_difference():
    change = Change("x", StatedValue(1.0, 3.0), StatedValue(21.0, 4.0))
    assert (change.std, change.z) == (5.0, 4.0)
    assert Change("x", StatedValue(1.0), StatedValue(2.0)).z is None
    assert Change("x", None, StatedValue(2.0, 1.0)).std is None


def test_rows_name_what_changed_came_and_went(tmp_path):
    a = results(tmp_path / "a.json", same=1.0, moved=(1.0, 0.3), gone=2.0, odd=math.nan)
    b = results(tmp_path / "b.json", moved=(3.0, 0.4), new=4.0, same=1.0, odd=1.0)
    assert compared(a, b) == [
        {"key": "moved", "a": 1.0, "b": 3.0, "std": 0.5, "z": 4.0},
        {"key": "gone", "a": 2.0, "b": None, "std": None, "z": None},
        {"key": "odd", "a": "nan", "b": 1.0, "std": None, "z": None},
        {"key": "new", "a": None, "b": 4.0, "std": None, "z": None},
    ]
    said = call("compare", a, b)
    assert "2 of the 3 shared numbers changed" in said
    assert "1 removed:\n  gone" in said
    assert "1 added:\n  new" in said
    assert "+4.0" in said


def test_page_one_comes_first_what_was_not_chosen_last_and_ten_changes_of_a_joint_are_listed(tmp_path):
    """Within a rank by standard errors; a number without an error is behind those with one."""
    keys = [f"fit.roll.lse.p{i}" for i in range(3)] + [f"fit.roll.chosen.lse.p{i}" for i in range(12)]
    keys += ["contact.a.roll.1.peak", "noise.a.roll.sigma", "fit.slide.m", "cv.a.roll.lse.model_error"]
    page_one = ["predict.a.roll.chosen.model_error", "effort.a.roll.coverage"]
    before = dict.fromkeys([*keys, *page_one], (1.0, 0.1)) | {"tip.a.rms": 1.0, "ekf-euler.a.roll.level": 1.0}
    after = {key: (2.0 + i, 0.1) for i, key in enumerate(keys)} | dict.fromkeys(page_one, (1.5, 0.1))
    after |= {"tip.a.rms": 3.0, "ekf-euler.a.roll.level": 9.0}
    a, b = results(tmp_path / "a.json", **before), results(tmp_path / "b.json", **after)
    first, roll, slide, other = call("compare", a, b).split("\n\n")[:4]
    *_, counted, by_chance = first.splitlines()
    assert counted.endswith(
        "changed: 2 of accuracy, 12 of model, 1 of contacts, 1 of forces, 1 of noise, 6 of candidates"
    )
    assert by_chance.startswith("21 of the 21 with a standard error did; between independent recordings, about 1 would")
    listed = [line.strip().split("  ")[:2] for line in roll.splitlines()[2:-1]]
    assert [row[0] for row in listed] == ["accuracy"] * 2 + ["contacts"] + ["model"] * 7
    assert "fit.roll.chosen.lse.p11" in roll.splitlines()[5]
    assert roll.splitlines()[-1] == "  and 5 of model, 1 of noise, 5 of candidates: --all lists them"
    every = call("compare", a, b, "--all").split("\n\n")[1].splitlines()
    assert [line.split()[1] for line in every[-6:]] == [
        "noise.a.roll.sigma", "cv.a.roll.lse.model_error", *(f"fit.roll.lse.p{i}" for i in (2, 1, 0)),
        "ekf-euler.a.roll.level",
    ]  # fmt: skip
    assert "slide: 1 changed" in slide
    assert "not of one joint: 1 changed" in other
    said = call("compare", a, b, "--all")
    assert all(key in said for key in (*before, "tip.a.rms"))
    assert "--all" not in said
    assert "Accuracy, of which verdicts are made, is listed first" in call("compare", "--help")


def test_values_come_before_standard_errors_and_what_repeats_another_change_comes_last(tmp_path):
    fits = [f"fit.roll.chosen.{estimator}.inertia" for estimator in ("ridge", "consistent")]
    before = {f"{fit}.std_noise": 1.0 for fit in fits} | dict.fromkeys(fits, (1.0, 0.1))
    before |= {"weight.a.roll.fit_std": 1.0, "noise.a.roll.sigma": (1.0, 0.1)}
    after = {key: 5.0 if key.endswith(("std_noise", "_std")) else (2.0, 0.1) for key in before}
    said = call("compare", results(tmp_path / "a.json", **before), results(tmp_path / "b.json", **after))
    rows = [line.split() for line in said.split("\n\n")[1].splitlines()[2:]]
    listed = [next(word for word in row if "." in word and "roll" in word) for row in rows]
    assert listed == [fits[0], "noise.a.roll.sigma", f"{fits[0]}.std_noise", "weight.a.roll.fit_std",
                      fits[1], f"{fits[1]}.std_noise"]  # fmt: skip
    assert "changed: 2 of model, 1 of noise, 3 of standard errors" in said


def test_a_parameter_of_a_joint_in_a_model_of_the_arm_is_that_joint_s(tmp_path):
    of = {"hand-roll": "hand_roll", "roll": "roll"}
    keys = [f"fit.arm.chosen.ridge.coulomb_friction_of_{slug}" for slug in of.values()]
    others = ["fit.arm.chosen.ridge.mass_of_hand", "predict.push_of_roll.hand-roll.chosen.r2"]
    before = {f"threshold.{joint}.alarm_level": 1.0 for joint in of} | dict.fromkeys([*keys, *others], (1.0, 0.1))
    before |= {f"{keys[0]}.std_noise": 1.0}
    after = {key: value if key.startswith("threshold") else 9.0 for key, value in before.items()}
    pair = [results(tmp_path / f"{name}.json", **numbers) for name, numbers in (("a", before), ("b", after))]
    groups = {part.split(":")[0]: part for part in call("compare", *pair).split("\n\n")[1:]}
    assert [*groups] == ["hand-roll", "roll", "arm"]
    counts = {name: part.splitlines()[0] for name, part in groups.items()}
    assert counts == {"hand-roll": "hand-roll: 3 changed", "roll": "roll: 1 changed", "arm": "arm: 1 changed"}
    assert f"{keys[0]}.std_noise" in groups["hand-roll"]
    assert keys[1] in groups["roll"]
    assert others[0] in groups["arm"]


def test_two_robots_are_told_apart(tmp_path):
    folders = [tmp_path / robot for robot in ("davinci", "ur10e")]
    for i, folder in enumerate(folders):
        folder.mkdir()
        (folder / "summary.json").write_text(json.dumps({"robot": folder.name}))
        results(folder / "results.json", x=float(i))
    pair = [folder / "results.json" for folder in folders]
    said = call("compare", *pair)
    assert "1 numbers of robot ur10e" in said
    assert "these are different robots" in said
    assert "changed" not in said
    assert "1 of the 1 shared numbers changed" in call("compare", *pair, "--all")


def test_a_change_in_a_late_digit_is_shown_in_as_many(tmp_path):
    a, b = results(tmp_path / "a.json", x=1.0), results(tmp_path / "b.json", x=1.0 + 1e-8)
    assert "1.00000001 N" in call("compare", a, b)


def test_a_study_its_report_and_its_numbers_are_the_same_and_do_not_differ(analysed):
    home = analysed.parent.parent
    for name in (analysed, home / "reports" / "arm", home / "reports" / "arm" / "results.json"):
        assert compared(analysed, name) == []
    assert "0 of the " in call("compare", analysed, analysed)


def test_one_altered_value_is_the_one_that_is_named(analysed, tmp_path):
    rows = json.loads((analysed.parent.parent / "reports/arm/results.json").read_text())
    [row] = [row for row in rows if row["key"] == "fit.hand_roll.independent.lse.inertia"]
    before = row["value"]
    row["value"] += 3.0 * row["std"]
    (tmp_path / "other.json").write_text(json.dumps(rows))
    [found] = compared(analysed, tmp_path / "other.json")
    assert (found["key"], found["a"], found["b"]) == (row["key"], before, row["value"])
    assert found["z"] == pytest.approx(3.0 / math.sqrt(2.0))


@pytest.fixture
def finished(analysed, tmp_path) -> Path:
    shutil.copytree(analysed.parent.parent, tmp_path / "lab")
    return tmp_path / "lab" / "raw" / "arm"


@pytest.mark.medium
def test_an_altered_contact_log_changes_its_own_numbers_alone(analysed, finished):
    """In the middle of its window: a smoother's tail reaches free motion, of which bands of other logs are made."""
    rows = [line.split(",") for line in (finished / "push.csv").read_text().splitlines()]
    for row in rows[1:]:
        if 4.8 < float(row[0]) < 5.1:
            row[3] = repr(float(row[3]) + 1.0)  # pushed twice as hard
    (finished / "push.csv").write_text("\n".join(",".join(row) for row in rows) + "\n")
    call("all", finished)
    keys = [row["key"] for row in compared(analysed, finished)]
    assert "contact.push.hand_roll.1.peak" in keys
    assert not [key for key in keys if ".push." not in key]


@pytest.mark.medium
def test_two_runs_of_the_same_data_find_nothing(analysed, tmp_path):
    study = write_study(tmp_path / "raw" / "arm")
    call("all", study)
    assert compared(analysed, study) == []


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("{", "is no results.json: "),
        ("{}", "it holds no list of numbers"),
        ("[1]", "number 1: it is not"),
        ('[{"key": "x", "value": [1]}]', "number 1 (x): its value is [1], not a number"),
        ('[{"key": "x", "value": 1, "std": -1}]', "(x): its std is -1"),
        ('[{"key": "x", "value": 1, "std": true}]', "(x): its std is True"),
        ('[{"key": "x", "value": 1, "unit": 1}]', "(x): its unit is 1"),
        ('[{"key": "x", "value": 1}, {"key": "x", "value": 2}]', "number 2 (x): the key appears twice"),
    ],
)
def test_what_is_no_results_json_is_said_to_be_none(tmp_path, text, words):
    good, bad = results(tmp_path / "good.json", x=1.0), tmp_path / "bad.json"
    bad.write_text(text)
    for pair in ((good, bad), (bad, good)):
        said = call("compare", *pair, code=1)
        assert str(bad) in said
        assert words in said


def test_what_is_not_there_is_said_with_its_remedy(tmp_path):
    good = results(tmp_path / "good.json", x=1.0)
    assert "name a study" in call("compare", good, tmp_path / "none.json", code=1)
    assert "holds neither study.toml nor results.json" in call("compare", tmp_path / ".", good, code=1)
    study = write_study(tmp_path / "raw" / "arm")
    assert f"run `davinci-forces all {study}`" in call("compare", study, good, code=1)


def test_a_file_that_is_no_text_is_said_to_be_none(tmp_path):
    (tmp_path / "bad.json").write_bytes(np.arange(200, dtype=np.uint8).tobytes())
    assert "is no results.json" in call("compare", tmp_path / "bad.json", tmp_path / "bad.json", code=1)


@pytest.mark.parametrize(
    ("line", "words"),
    [
        ('baseline = "old.json"', "file 'old.json' is not in"),
        ('baseline = "../old.json"', "lies outside the study"),
        ("baseline = 3", "baseline must be text"),
    ],
)
def test_a_baseline_that_cannot_be_is_a_problem_of_its_line(tmp_path, line, words):
    study = write_study(tmp_path / "arm")
    text = (study / "study.toml").read_text()
    (study / "study.toml").write_text(f"{line}\n{text}")
    with pytest.raises(BadStudy, match=rf"study\.toml:1: .*{words}"):
        reading.read(study)


@pytest.mark.medium
def test_a_report_says_what_changed_since_its_baseline_and_is_made_anew_when_that_changes(finished):
    rows = json.loads((finished.parents[1] / "reports/arm/results.json").read_text())
    kept = [dict(row) for row in rows if row["key"] != "period.roll"]
    kept[0]["value"] += 1.0
    changed_key = kept[0]["key"]
    study, baseline = finished / "study.toml", finished / "old.json"
    baseline.write_text(json.dumps([*kept, {"key": "gone.<b>", "value": 1.0, "std": None, "unit": ""}]))
    study.write_text(f'baseline = "old.json"\n{study.read_text()}')
    call("report", finished)
    page = (finished.parents[1] / "reports/arm/report.html").read_text()
    assert "Since the baseline" in page
    assert "New numbers: 1; missing: 1" in page
    assert "gone.&lt;b&gt;" in page
    assert changed_key in page
    assert "nothing to do" in call("report", finished)
    call("verify", finished)
    baseline.write_text(json.dumps(rows))
    assert "raw/old.json changed" in call("report", finished)
    assert "New numbers: 0; missing: 0" in (finished.parents[1] / "reports/arm/report.html").read_text()
    baseline.write_text("[")
    assert f"{baseline} is no results.json" in call("report", finished, code=1)
