"""Logs that are wrong: one readable message each, the other logs go on, and nothing is lost."""

import html
import re
from dataclasses import replace

import numpy as np
import pytest

import davinci_forces
from tests import arm
from tests.test_runs import call, contents


@pytest.fixture
def lab(tmp_path):
    """A study of a good log and one to be spoilt."""
    folder = tmp_path / "raw" / "arm"
    good = arm.signal("hand_roll", period=2.0, rate=50.0, periods=5)
    arm.write_csv(folder / "good.csv", [good])
    arm.write_csv(folder / "bad.csv", [good])
    describe(folder)
    return folder


def describe(folder, more="", joints=("hand_roll",), role="identification"):
    arm.write_robot(folder)
    text = 'title = "T"\nrobot = "arm.toml"\n' + arm.log_table("good", "good.csv", "identification", ["hand_roll"])
    (folder / "study.toml").write_text(text + arm.log_table("bad", "bad.csv", role, joints, more))


def edit(folder, change):
    file = folder / "bad.csv"
    lines = file.read_text().splitlines()
    file.write_text("\n".join(change(lines)) + "\n")


def cell(lines, row, column, value):
    cells = lines[row].split(",")
    cells[column] = value
    return [*lines[:row], ",".join(cells), *lines[row + 1 :]]


def run(folder, code=1) -> str:
    before = contents(folder)
    said = " ".join(call_any("fit", folder).split())
    assert contents(folder) == before
    assert "Traceback" not in said
    good = folder.parent.parent / "processed" / "arm" / "recording" / "good" / "hand_roll.parquet"
    assert good.exists()
    return said


def call_any(name, folder) -> str:
    from typer.testing import CliRunner

    from davinci_forces.cli import app

    result = CliRunner().invoke(app, [name, str(folder)])
    assert result.exit_code in (0, 1), result.output
    return result.output


@pytest.mark.parametrize(
    ("change", "says"),
    [
        (lambda lines: cell(lines, 40, 2, "broken"), "bad.csv"),
        (lambda lines: cell(lines, 40, 2, "inf"), "channel 'hand_roll.dq' holds inf at row 39 (counted from 0)"),
        (
            lambda lines: cell(lines, 40, 0, "0.5"),
            "time does not increase at row 39 (counted from 0): 0.76 s, then 0.5 s",
        ),
        (
            lambda lines: cell(lines, 40, 0, lines[39].split(",")[0]),
            "time does not increase at row 39 (counted from 0): 0.76 s",
        ),
        (lambda lines: lines[:1], "bad.csv"),
        (lambda lines: lines[:2], "1 samples are too few"),
        (lambda lines: [line.replace("hand_roll.q", "q1") for line in lines], "there is no channel 'hand_roll.q'"),
        (
            lambda lines: [lines[0], *(",".join([line.split(",")[0], "0.1", "0.0", "0.5"]) for line in lines[1:])],
            "bad: no joint moves",
        ),
    ],
    ids=[
        "text", "infinite", "time goes back", "time stands still", "header only", "one row", "no channel",
        "constant",
    ],
)  # fmt: skip
def test_a_spoilt_log_is_named_and_the_good_one_goes_on(lab, change, says):
    edit(lab, change)
    assert says in run(lab)


def test_a_log_of_one_period_is_not_averaged_which_is_remarked_on(lab):
    edit(lab, lambda lines: lines[:120])
    run(lab)
    remarks = " ".join(davinci_forces.read(lab, "Diagnostic")["text"])
    assert "bad: 2.38 s contain no motion that repeats at least twice, so nothing is averaged" in remarks


def test_what_is_kept_of_an_error_knows_no_folder_of_this_machine(lab, tmp_path):
    edit(lab, lambda lines: cell(lines, 40, 2, "inf"))
    run(lab)
    kept = contents(tmp_path / "processed")
    assert any(b"bad.csv: channel" in content for content in kept.values())
    assert not [name for name, content in kept.items() if str(tmp_path).encode() in content]


def test_an_empty_log_is_named(lab):
    (lab / "bad.csv").write_bytes(b"")
    assert "bad.csv: the file is empty (0 bytes)" in run(lab)


def test_a_last_row_that_was_cut_is_dropped_with_a_warning(lab):
    file = lab / "bad.csv"
    file.write_text(file.read_text().rstrip("\n").rpartition(",")[0])
    said = run(lab)
    assert "warning: bad:" in said
    assert "error" not in said


def test_a_binary_log_that_was_cut_keeps_its_whole_rows_with_a_warning(lab):
    """LabVIEW writes channel after channel, so the later ones miss the end of a file that was cut."""
    from nptdms import ChannelObject, TdmsWriter

    signal = arm.signal("hand_roll", period=2.0, rate=50.0, periods=5)
    columns = {"time": signal.t, "hand_roll.q": signal.q, "hand_roll.dq": signal.dq, "hand_roll.tau": signal.tau}
    with TdmsWriter(str(lab / "bad.tdms")) as file:
        file.write_segment([ChannelObject("arm", name, values) for name, values in columns.items()])
    content = (lab / "bad.tdms").read_bytes()
    (lab / "bad.csv").unlink()
    (lab / "bad.tdms").write_bytes(content[: -8 * 40])
    (lab / "study.toml").write_text((lab / "study.toml").read_text().replace("bad.csv", "bad.tdms"))
    said = run(lab)
    assert "its last 40 rows lack some channels and are left out" in said
    assert "error" not in said
    import davinci_forces

    assert len(davinci_forces.read(lab, "Recording", log="bad")) == len(signal) - 40


def test_joints_of_different_lengths_are_named(lab):
    edit(lab, lambda lines: [line if i < 200 else ",".join([*line.split(",")[:3], ""]) for i, line in enumerate(lines)])
    assert "channel 'hand_roll.tau' has no sample at row 199 (counted from 0)" in run(lab)


def test_an_unknown_unit_in_the_log_asks_for_one_in_the_study(lab):
    edit(lab, lambda lines: [lines[0].replace("hand_roll.tau", "hand_roll.tau [lbf]"), *lines[1:]])
    text = (lab / "study.toml").read_text()
    head, tail = text.rsplit('"hand_roll.tau" = "hand_roll.tau"', 1)
    (lab / "study.toml").write_text(head + '"hand_roll.tau" = "hand_roll.tau [lbf]"' + tail)
    assert "is in 'lbf', which is an unknown unit, but hand_roll.tau needs torque; give its unit" in run(lab)


def test_a_log_and_a_study_that_disagree_on_a_unit_are_an_error(lab):
    edit(lab, lambda lines: [lines[0].replace("hand_roll.q", "hand_roll.q [deg]"), *lines[1:]])
    text = (lab / "study.toml").read_text()
    head, tail = text.rsplit('"hand_roll.q" = "hand_roll.q"', 1)
    (lab / "study.toml").write_text(head + '"hand_roll.q" = { channel = "hand_roll.q [deg]", unit = "rad" }' + tail)
    assert "is in 'deg', but study.toml says 'rad'" in run(lab)


def test_a_log_without_a_clock_asks_for_a_rate(lab):
    text = (lab / "study.toml").read_text()
    head, tail = text.rsplit('time = "time"\n', 1)
    (lab / "study.toml").write_text(head + tail)
    edit(lab, lambda lines: [line.replace("time", "sample") for line in lines])
    assert "the log has no clock; name its time channel in [log.channels], or give rate = ... [Hz]" in run(lab)


def test_units_signs_and_offsets_come_to_the_joint_in_si(lab):
    """Position in degrees off by 5 and mirrored, effort as a current in mA: the recording is the same."""
    import davinci_forces

    signal = arm.signal("hand_roll", period=2.0, rate=50.0, periods=5)
    changed = replace(signal, q=-np.rad2deg(signal.q) - 5, tau=signal.tau / (200 * 0.0438) * 1e3)
    arm.write_csv(lab / "bad.csv", [changed])
    text = (lab / "study.toml").read_text()
    head, tail = text.rsplit('"hand_roll.q" = "hand_roll.q"', 1)
    tail = tail.replace(
        '"hand_roll.tau" = "hand_roll.tau"', '"hand_roll.i" = { channel = "hand_roll.tau", unit = "mA" }'
    )
    head += '"hand_roll.q" = { channel = "hand_roll.q", unit = "deg", sign = -1, offset = 5.0 }'
    motor = "\n[robot_overrides.hand_roll]\ngear_ratio = 200.0\ntorque_constant = 0.0438\n"
    (lab / "study.toml").write_text((head + tail).replace("[[log]]", motor + "[[log]]", 1))
    call("ingest", lab)
    good, bad = (davinci_forces.read(lab, "Recording", log=name) for name in ("good", "bad"))
    for column in ("t", "q", "dq", "tau"):
        np.testing.assert_allclose(bad[column], good[column], atol=1e-12)


def test_the_transient_is_skipped_and_the_clock_kept(lab):
    import davinci_forces

    describe(lab, more="skip = 1.0")
    call("ingest", lab)
    bad = davinci_forces.read(lab, "Recording", log="bad")
    assert bad["t"].iloc[0] == 1.0


def test_a_log_ends_where_the_study_says_whatever_comes_after(lab):
    """`until` counts from the log's first sample, as `skip` does; a recorder may die as it pleases after it."""
    import davinci_forces

    describe(lab, more="skip = 1.0\nuntil = 6.5")
    edit(lab, lambda lines: cell(cell(lines, 400, 0, "0.5"), 401, 2, "nan"))
    said = call("ingest", lab)
    bad = davinci_forces.read(lab, "Recording", log="bad")
    assert (bad["t"].iloc[0], bad["t"].iloc[-1]) == (1.0, 6.5)
    assert davinci_forces.read(lab, "LogSummary", log="bad")["duration"].iloc[0] == 6.5
    assert "until" not in said


def test_an_end_that_the_log_does_not_reach_is_remarked_on(lab):
    describe(lab, more="until = 61.0")
    said = " ".join(call("ingest", lab).split())
    assert "bad: until = 61 s leaves nothing out, because the log ends after 9.98 s" in said


@pytest.mark.parametrize("name", ["contact", "free"])
def test_a_window_that_the_log_does_not_reach_is_remarked_on(lab, name):
    describe(lab, more=f"{name} = [[70, 80]]")
    said = " ".join(call("ingest", lab).split())
    window = f"bad: the {name} window 70 to 80 s lies outside the log, which goes from 0 to 9.98 s"
    assert f"{window} from its first sample on; correct `{name}` in study.toml" in said


def test_too_little_before_the_end_is_refused(lab):
    describe(lab, more="until = 0.005")
    assert "1 samples are too few, with 0 s skipped at the start and those after 0.005 s left out" in run(lab)


def test_a_gap_is_marked_and_not_bridged(lab):
    import davinci_forces

    edit(lab, lambda lines: [*lines[:200], *lines[215:]])
    said = call("ingest", lab)
    assert "the longest time between samples is 0.32 s" in " ".join(said.split())
    call("resample", lab)
    signal = davinci_forces.read(lab, "Signal", log="bad")
    assert signal["gaps"].iloc[0] == 1
    assert list(np.unique(signal["segment"])) == [0, 1]
    assert np.diff(signal["t"]).max() == pytest.approx(0.32)


@pytest.mark.parametrize("jump", [3.0, 1.7e9])
def test_a_clock_that_jumps_while_the_motion_goes_on_is_set_back_and_said_to_be(lab, jump):
    import davinci_forces

    signal = arm.signal("hand_roll", period=2.0, rate=50.0, periods=5)
    arm.write_csv(lab / "bad.csv", [replace(signal, t=signal.t + np.where(signal.t < 4.2, 0.0, jump))])
    said = run(lab)
    assert f"bad: the clock jumps while the motion continues, by {jump:.6g} s after 4.180 s" in said
    assert "gap" not in said
    good, bad = (davinci_forces.read(lab, "Recording", log=name) for name in ("good", "bad"))
    np.testing.assert_allclose(bad["t"], good["t"], atol=1e-6)
    assert davinci_forces.read(lab, "Average", log="bad")["period"].iloc[0] == pytest.approx(2.0, abs=1e-4)


def test_a_clock_that_jumps_in_a_log_of_another_role_has_a_gap(lab):
    """Windows of contact count on the log's own clock."""
    import davinci_forces

    describe(lab, role="validation")
    signal = arm.signal("hand_roll", period=2.0, rate=50.0, periods=5)
    arm.write_csv(lab / "bad.csv", [replace(signal, t=signal.t + np.where(signal.t < 4.2, 0.0, 3.0))])
    call("ingest", lab)
    assert np.diff(davinci_forces.read(lab, "Recording", log="bad")["t"]).max() == pytest.approx(3.02)


@pytest.mark.parametrize("rows", [7, 20, 64, 100])
def test_a_clock_is_set_back_wherever_the_blocks_of_a_log_end(tmp_path, rows):
    from davinci_forces.logs import open_log
    from davinci_forces.study import reading as study
    from davinci_forces.study.intake import Intake, without_clock_jumps

    signal = arm.signal("hand_roll", period=2.0, rate=50.0, periods=5)
    speed = np.abs(arm.excitation("hand_roll", signal.t, 2.0)[1])
    describe(tmp_path)
    entry = study.read(tmp_path).log("bad")
    for at in range(180, 260, 3):
        late = signal.t + np.where(np.arange(len(signal)) < at, 0.0, 3.0)
        arm.write_csv(tmp_path / "bad.csv", [replace(signal, t=late)])
        log = open_log(tmp_path / "bad.csv")
        reading = Intake(log, entry, arm.ARM)
        [whole] = log.blocks(reading.names)
        parts = [{k: v[i : i + rows] for k, v in whole.items()} for i in range(0, len(signal), rows)]
        t = np.concatenate([block["time"] for block in without_clock_jumps(reading, iter(parts))])
        if speed[at] > 0.1:
            np.testing.assert_allclose(t, signal.t, atol=1e-9)


def test_an_uneven_clock_is_made_uniform_and_said_to_be(lab):
    import davinci_forces

    rng = np.random.default_rng(0)
    signal = arm.signal("hand_roll", period=2.0, rate=50.0, periods=5, noise=0)
    t = signal.t + rng.uniform(-0.2, 0.2, len(signal)) / 50
    q, dq, _ = arm.excitation("hand_roll", t, 2.0)
    arm.write_csv(lab / "bad.csv", [replace(signal, t=t, q=q, dq=dq, tau=np.sin(t))])
    call("ingest", lab)
    call("resample", lab)
    made = davinci_forces.read(lab, "Signal", log="bad")
    assert "cubic spline" in made["method"].iloc[0]
    assert np.ptp(np.diff(made["t"])) < 1e-9
    np.testing.assert_allclose(made["tau"], np.sin(made["t"] + t[0]), atol=1e-5)


def test_velocity_that_was_not_logged_is_derived(lab):
    import davinci_forces

    text = (lab / "study.toml").read_text()
    head, tail = text.rsplit('"hand_roll.dq" = "hand_roll.dq"\n', 1)
    (lab / "study.toml").write_text(head + tail)
    call("ingest", lab)
    call("resample", lab)
    good, bad = (davinci_forces.read(lab, "Signal", log=name) for name in ("good", "bad"))
    assert bad["velocity"].iloc[0] == "derived"
    middle = slice(50, -50)
    np.testing.assert_allclose(bad["dq"][middle], good["dq"][middle], atol=0.02)


def test_rows_that_repeat_are_flagged(lab):
    def repeated(lines):
        return [
            line if i % 4 else ",".join([line.split(",")[0], *lines[i - 1].split(",")[1:]])
            for i, line in enumerate(lines)
        ]

    edit(lab, lambda lines: [lines[0], *repeated(lines[1:])])
    said = " ".join(call("ingest", lab).split())
    assert "repeat the one before in every channel used" in said


def test_parts_of_a_log_are_read_as_one(lab):
    import davinci_forces

    lines = (lab / "bad.csv").read_text().splitlines()
    (lab / "one.csv").write_text("\n".join(lines[:300]) + "\n")
    (lab / "two.csv").write_text("\n".join([lines[0], *lines[300:]]) + "\n")
    text = (lab / "study.toml").read_text().replace('file = "bad.csv"', 'files = ["one.csv", "two.csv"]')
    (lab / "study.toml").write_text(text)
    call("ingest", lab)
    good, bad = (davinci_forces.read(lab, "Recording", log=name) for name in ("good", "bad"))
    np.testing.assert_array_equal(good["tau"], bad["tau"])


def test_names_that_are_markup_appear_as_text_in_both_reports(lab, tmp_path):
    import shutil
    import subprocess

    nasty = ["<script>alert(1)</script>", "#set page()", "$x$ & @y *b* `c`"]
    signal = arm.signal("hand_roll", period=2.0, rate=50.0, periods=5)
    rows = np.column_stack([signal.t, signal.q, signal.dq, signal.tau]).tolist()
    header = "\t".join(["time", *nasty])
    (lab / "bad.csv").write_text("\n".join([header, *("\t".join(map(repr, row)) for row in rows)]) + "\n")
    text = (lab / "study.toml").read_text()
    for symbol, name in zip(("q", "dq", "tau"), nasty, strict=True):
        head, tail = text.rsplit(f'"hand_roll.{symbol}" = "hand_roll.{symbol}"', 1)
        text = head + f'"hand_roll.{symbol}" = "{name}"' + tail
    title = " ".join(nasty)  # which both show; channels are on screen only
    (lab / "study.toml").write_text(re.sub(r'^title = ".*"$', f'title = "{title}"', text, count=1, flags=re.M))
    call("all", lab)
    made = tmp_path / "reports" / "arm"
    page = (made / "report.html").read_text()
    assert "<script>alert(1)" not in page
    assert all(html.escape(name) in page for name in nasty)
    assert "&lt;script&gt;alert(1)&lt;/script&gt;" in page
    if shutil.which("pdftotext"):
        said = subprocess.run(["pdftotext", "-layout", made / "report.pdf", "-"], capture_output=True, text=True).stdout
        for name in nasty:
            assert name in said
