"""Tissue logs as files: what is read of them, what a study may say of them, and what `new` makes of their headers."""

import json
import re

import numpy as np
import pytest
from typer.testing import CliRunner

import davinci_forces
from davinci_forces.cli import app
from davinci_forces.errors import BadStudy
from davinci_forces.logs import open_log
from davinci_forces.records import Touch
from davinci_forces.stages.recordings import ingest
from davinci_forces.study import WHOLE_LOG, reading
from tests import arm
from tests.test_shipped_studies import analysed

PROBES = """[[log]]
name = "probes"
file = "probes.csv"
role = "tissue"
{more}
[log.channels]
push = "probe"
depth = { channel = "depth", unit = "mm" }
force = "force_norm"
"""
HEADER = "probe,depth,force_normal,force_norm"


def probes(pushes=12, samples=10, stiffness=450.0, seed=0):
    rng = np.random.default_rng(seed)
    depth = np.tile(np.linspace(0, 2, samples), pushes)
    force = 1e-3 * stiffness * depth + 0.1 + 0.01 * rng.normal(size=len(depth))
    return np.column_stack([np.repeat(np.arange(pushes), samples), depth, 0.9 * force, force])


def study(tmp_path, more='contact = "all"', rows=None, text=PROBES, header=HEADER):
    folder = tmp_path / "raw" / "palpation"
    folder.mkdir(parents=True, exist_ok=True)
    lines = [",".join(map(repr, row)) for row in (probes() if rows is None else rows).tolist()]
    (folder / "probes.csv").write_text("\n".join([header, *lines]) + "\n")
    (folder / "study.toml").write_text('title = "T"\nrobot = "davinci"\n' + text.replace("{more}", more))
    return folder


def stages(folder, *names):
    done = [CliRunner().invoke(app, [name, str(folder)]) for name in names]
    return " ".join(" ".join(d.output for d in done).split())


def test_a_file_of_probes_needs_no_clock(tmp_path):
    folder = study(tmp_path)
    said = stages(folder, "ingest", "palpate")
    assert "error" not in said
    touch = davinci_forces.read(folder, "Touch")
    assert touch["t"].isna().all()
    assert list(touch["sample"]) == list(range(120))
    np.testing.assert_allclose(touch["depth"].max(), 2e-3)
    assert touch.attrs["units"]["depth"] == "m"
    pushes = davinci_forces.read(folder, "Push")
    assert set(pushes["push"]) == set(range(12))
    assert pushes["k_t"].median() == pytest.approx(450, rel=0.02)
    [summary] = davinci_forces.read(folder, "LogSummary").groupby("log", observed=True)
    assert summary[1]["rate"].isna().all()  # nobody may take the number of a sample for its time


@pytest.mark.slow
@pytest.mark.usefixtures("quick_design")
def test_the_report_of_a_user_s_probes_states_the_stiffness_without_the_thesis(tmp_path):
    folder = study(tmp_path)
    stages(folder, "ingest", "palpate", "report")
    reports = tmp_path / "reports" / "palpation"
    assert "tissue probes: 45" in (reports / "summary.txt").read_text()
    results = {r["key"]: r for r in json.loads((reports / "results.json").read_text())}
    assert results["tissue.probes.stiffness"]["value"] == pytest.approx(450, rel=0.01)
    assert results["tissue.probes.stiffness"]["unit"] == "N/m"
    assert results["tissue.probes.pushes"]["value"] == 12
    assert "log.probes.rate" not in results
    html = (reports / "report.html").read_text()
    text = html.partition('id="references"')[0]  # the references name the thesis as a source
    assert not re.search(r"457\.24|thesis’s|thesis's|“thesis”|Fig 8\.9|section 8\.", text)
    assert 'id="tissue"' in html


@pytest.mark.parametrize(
    ("more", "says"),
    [
        ("skip = 1.0", "the log has no clock, but skip, until and contact windows are in seconds"),
        ("until = 3.0", "the log has no clock, but skip, until and contact windows are in seconds"),
        ("contact = [[1, 2]]", "the log has no clock, but skip, until and contact windows are in seconds"),
    ],
)
def test_what_counts_in_seconds_needs_a_clock(tmp_path, more, says):
    folder = study(tmp_path, more)
    assert says in stages(folder, "ingest")
    assert says not in stages(study(tmp_path, f"{more}\nrate = 10.0"), "ingest")


def test_a_number_of_a_push_is_whole(tmp_path):
    rows = probes()
    rows[15:, 0] += 0.5
    said = stages(study(tmp_path, rows=rows), "ingest")
    assert "channel 'probe' holds 1.5 at row 15 (counted from 0), but the number of a push must be whole" in said


def test_a_joint_of_a_tissue_log_needs_a_clock_as_any_other(tmp_path):
    text = PROBES + '"instrument_slide.q" = "depth"\n"instrument_slide.tau" = "force_norm"\n'
    assert "the log has no clock; name its time channel" in stages(study(tmp_path, text=text), "ingest")


def test_a_log_is_passed_on_block_by_block_and_its_samples_are_counted_on(tmp_path, monkeypatch):
    """So a log of any size fits in memory."""
    folder = study(tmp_path)
    study_read = reading.read(folder)
    log = open_log(folder / "probes.csv")
    whole = {name: np.concatenate([b[name] for b in log.blocks([name])]) for name in ("probe", "depth", "force_norm")}
    parts = [{name: values[i : i + 50] for name, values in whole.items()} for i in range(0, 120, 50)]
    monkeypatch.setattr(log, "blocks", lambda names: iter(parts))
    made = [r for r in ingest.run(log, study_read.logs[0], study_read.robot) if isinstance(r, Touch)]
    assert [len(touch) for touch in made] == [50, 50, 20]
    assert np.concatenate([touch.sample for touch in made]).tolist() == list(range(120))
    np.testing.assert_allclose(made[1].depth, 1e-3 * whole["depth"][50:100])


@pytest.mark.parametrize(
    ("old", "new", "says"),
    [
        ('role = "tissue"', 'role = "contact"', 'contact = "all" is only for logs of role tissue; give a list'),
        ('contact = "all"', 'contact = "most"', "contact must be a list of [start, end]"),
        ('force = "force_norm"', "", "a tissue log needs a force; give force, or force_x, force_y, force_z"),
        ('force = "force_norm"', 'force_x = "force_norm"', "give force_y and force_z, too"),
        ('depth = { channel = "depth", unit = "mm" }', "", "a tissue log needs a depth; give depth, or tip_x"),
        ('depth = { channel = "depth", unit = "mm" }', 'tip_x = "depth"\ntip_y = "probe"', "give tip_z, too"),
    ],
)
def test_what_a_tissue_log_lacks_is_said_with_its_remedy(tmp_path, old, new, says):
    folder = study(tmp_path)
    text = (folder / "study.toml").read_text()
    assert old in text
    (folder / "study.toml").write_text(text.replace(old, new))
    with pytest.raises(BadStudy, match=r".*") as raised:
        reading.read(folder)
    assert says in str(raised.value)


def test_all_of_a_log_is_contact_where_the_study_says_so(tmp_path):
    [entry] = reading.read(study(tmp_path)).logs
    assert entry.contact == WHOLE_LOG
    assert not entry.needs_clock


def test_a_slide_tells_depth_and_force_of_a_tissue_log(tmp_path):
    arm.write_robot(tmp_path)
    text = 'title = "T"\nrobot = "arm.toml"\n' + arm.log_table("a", "a.csv", "tissue", ["instrument_slide"])
    (tmp_path / "study.toml").write_text(text)
    assert reading.read(tmp_path).logs[0].joints == ("instrument_slide",)
    (tmp_path / "study.toml").write_text(text.replace("instrument_slide", "hand_roll"))
    with pytest.raises(BadStudy, match="a tissue log needs a depth"):
        reading.read(tmp_path)


@pytest.mark.parametrize(
    ("header", "quantities"),
    [
        (HEADER, {"push": "probe", "depth": "depth", "force": "force_norm"}),
        ("Probe,Depth (mm),Normal Force (N),Force Norm (N)",
         {"push": "Probe", "depth": "Depth (mm)", "force": "Force Norm (N)"}),
        ("probe no.,indentation_mm,normal force", {"push": "probe no.", "depth": "indentation_mm",
         "force": "normal force"}),
        ("t_s,x,y,z,fx,fy,fz", {"time": "t_s", "tip_x": "x", "tip_z": "z", "force_x": "fx", "force_z": "fz"}),
        ("time,probe depth,load", {"time": "time", "depth": "probe depth", "force": "load"}),
        ("time,Tip X,Tip Y,Tip Z,Force X,Force Y,Force Z", {"tip_y": "Tip Y", "force_y": "Force Y"}),
    ],
)  # fmt: skip
def test_new_recognises_pushes_by_the_names_of_channels(tmp_path, header, quantities):
    columns = len(header.split(","))
    rows = np.column_stack([np.arange(5.0)] * columns)
    folder = study(tmp_path, rows=rows, header=header)
    (folder / "study.toml").unlink()
    assert CliRunner().invoke(app, ["new", str(folder / "probes.csv")]).exit_code == 0
    [entry] = reading.read(folder).logs
    assert entry.role == "tissue"
    found = {source.quantity: source.channel for source in entry.channels}
    assert quantities.items() <= found.items()
    by_unit = {source.quantity: source.unit for source in entry.channels}
    if "mm" in header:
        assert by_unit["depth"] == "mm"


@pytest.mark.parametrize("header", ["time,roll position,roll current", "time,x,y,z", "time,fx,depth", "a,b,c"])
def test_new_takes_no_other_log_for_pushes(tmp_path, header):
    rows = np.column_stack([np.arange(5.0)] * len(header.split(",")))
    folder = study(tmp_path, rows=rows, header=header)
    said = CliRunner().invoke(app, ["new", "--print", str(folder / "probes.csv")]).output
    assert 'role = "tissue"' not in said
    assert 'role = "tissue"' not in said


@pytest.fixture(scope="module")
def phantom(data, tmp_path_factory):
    """The study that ships, on the recordings."""
    return analysed("palpation", "palpate", data, tmp_path_factory.mktemp("phantom"))


def test_real_probes_of_a_phantom(phantom):
    """Public recordings of an arm with a force sensor: 453 N/m, most pushes between 423 and 507."""
    tissue = davinci_forces.read(phantom, "Stiffness", log="probes")
    counted = tissue[tissue["counted"] == 1]["k_t"]
    assert tissue["stiffness"].iloc[0] == pytest.approx(453, rel=0.05)
    assert counted.median() == pytest.approx(453, rel=0.05)
    assert (tissue["stiffness_q1"].iloc[0], tissue["stiffness_q3"].iloc[0]) == pytest.approx((423, 507), rel=0.05)
    assert len(tissue) == 727


@pytest.mark.medium
def test_real_pushes_over_a_surface_are_found_one_by_one(phantom):
    """A second each over six minutes; where force begins to rise is where the eye puts it: at the foot of each rise."""
    tissue, pushes = (davinci_forces.read(phantom, kind, log="continuous") for kind in ("Stiffness", "Push"))
    assert 340 <= len(tissue) <= 380
    known = tissue.dropna(subset=["onset_depth"])
    assert len(known) > 0.6 * len(tissue)
    for number in known["push"].iloc[::20]:
        push = pushes[pushes["push"] == number]
        foot = push[push["loading"] == 1].iloc[: push["inside"].argmax() + 1]["force"]
        assert np.ptp(foot) < 0.3 * np.ptp(push["force"])
    assert (tissue["k_t"] > 0).mean() > 0.98
