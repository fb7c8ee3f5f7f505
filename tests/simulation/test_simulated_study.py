"""A simulated study: complete, readable, labelled, the same twice, and true to its truth."""

import tomllib
from pathlib import Path

import numpy as np
import pytest
import typer
from scipy.signal import lfilter
from typer.testing import CliRunner

from davinci_forces.commands import simulate
from davinci_forces.errors import BadRequest
from davinci_forces.estimators import ESTIMATORS
from davinci_forces.logs import open_log
from davinci_forces.maths.excitation.fourier import motion
from davinci_forces.maths.models.independent import regressor
from davinci_forces.records import Average, Fit, Signal, Trajectory
from davinci_forces.simulation import study_folder
from davinci_forces.simulation.scenario import SensorNoise
from davinci_forces.simulation.scenario.reading import load
from davinci_forces.simulation.sensors import drift, generator, quantise
from davinci_forces.stages.model import fit
from davinci_forces.stages.recordings import average, differentiate
from davinci_forces.study import Study, reading
from tests.test_runs import call

app = typer.Typer()
app.command()(simulate.run)
SHORT = """
title = "Both ways of recording"
robot = "davinci"
seed = 7
rate = 100.0
started = "2016-05-02T09:00:00"
[joint.hand_roll]
label = "Roll"
encoder_step = 3.141592653589793e-3
current_step = 1e-4
theta = { inertia = 0.4, "gravity, sine" = 0.1, "viscous friction" = 0.3, "Coulomb friction" = 0.2 }
noise = { q = 1e-5, dq = 1e-3, tau = 0.1 }
"""
LOG = """
[[log]]
name = "log-{0}"
file = "log_{0}.{1}"
role = "contact"
duration = 5.0
clock = "{2}"
current_unit = "{3}"
moves.hand_roll = {{ period = 5.0, a = [0.1], b = [0.2] }}
external.hand_roll = [ {{ shape = "pulse", start = 2.0, end = 4.0, peak = 1.0 }} ]
"""
EXCITED = [("roll", "hand_roll", 1.0), ("pitch", "hand_pitch", 1e-3), ("slide", "instrument_slide", 1.0)]
BIASED = {"prior"}  # drawn to a guess
KINDS = [("tdms", "channel", "A"), ("tdms", "header", "mA"), ("lvm", "channel", "mA"), ("lvm", "header", "A")]


@pytest.fixture(scope="module")
def demo(tmp_path_factory) -> Path:
    folder = tmp_path_factory.mktemp("simulated") / "davinci-joints"
    study_folder.write(load("davinci-joints"), folder, False, lambda _: None)
    return folder


def short(tmp_path) -> Path:
    file = tmp_path / "short.toml"
    file.write_text(SHORT + "".join(LOG.format(i, *kind) for i, kind in enumerate(KINDS)))
    return file


def channels(study: Study, name: str) -> dict[str, np.ndarray]:
    """The samples of a log by quantity, as its file gives them."""
    entry = study.log(name)
    log = open_log(study.folder / entry.files[0])
    sources = {str(source.channel): source.quantity for source in entry.channels}
    blocks = list(log.blocks(list(sources)))
    return {quantity: np.concatenate([b[channel] for b in blocks]) for channel, quantity in sources.items()}


def test_the_study_is_valid_complete_labelled_and_small(demo):
    study = reading.read(demo)
    assert study.simulated
    assert not study.absent()
    assert {entry.role for entry in study.logs} == {"identification", "validation", "contact"}
    assert sum(file.stat().st_size for file in demo.iterdir()) < 5e6
    assert tomllib.loads((demo / "truth.toml").read_text())["simulated"] is True
    for entry in study.logs:
        assert b"SIMULATED" in (demo / entry.files[0]).read_bytes()[:4096]


def test_the_contact_windows_of_the_study_are_the_pushes_of_the_truth(demo):
    truth = {entry["name"]: entry for entry in tomllib.loads((demo / "truth.toml").read_text())["log"]}
    for entry in reading.read(demo).logs:
        pushes = truth[entry.name].get("push", [])
        assert list(entry.contact) == [(push["start"], push["end"]) for push in pushes]
        assert bool(pushes) == (entry.role == "contact")


@pytest.mark.parametrize(("name", "joint", "size"), EXCITED)
def test_least_squares_on_the_excitation_gives_the_truth_within_its_standard_errors(demo, name, joint, size):
    study, truth = reading.read(demo), tomllib.loads((demo / "truth.toml").read_text())["theta"][joint]
    it, columns = study.robot.joint(joint), channels(study, f"{name}-excitation")
    log = next(entry for entry in load("davinci-joints").logs if entry.name == f"{name}-excitation")
    tau = columns[f"{joint}.i"] * size * it.gear_ratio * it.torque_constant
    q, dq, ddq = motion(log.moves[joint], np.arange(len(tau)) / 100.0)
    assert columns[f"{joint}.theta_m"] / it.gear_ratio == pytest.approx(q, abs=6 * 2e-5)  # noise and encoder
    F = regressor(it.terms, q, dq, ddq)
    theta, residual = np.linalg.lstsq(F, tau, rcond=None)[:2]
    std = np.sqrt(np.diag(np.linalg.inv(F.T @ F)) * residual[0] / (len(tau) - len(theta)))
    assert np.abs(theta - list(truth.values())).max() < 4 * std.max()
    assert (np.abs(theta - list(truth.values())) < 4 * std).all()


@pytest.mark.parametrize(("name", "joint", "size"), EXCITED)
def test_every_unbiased_estimator_finds_the_truth_of_averaged_periods_within_its_standard_errors(
    demo, name, joint, size
):
    """All that the study's fits may state, but those that are drawn to a guess."""
    study, truth = reading.read(demo), tomllib.loads((demo / "truth.toml").read_text())["theta"][joint]
    it, columns = study.robot.joint(joint), channels(study, f"{name}-excitation")
    tau = columns[f"{joint}.i"] * size * it.gear_ratio * it.torque_constant
    q, t = columns[f"{joint}.theta_m"] / it.gear_ratio, np.arange(len(tau)) / 100.0
    log, segment = f"{name}-excitation", np.zeros(len(t), int)
    signal = Signal(log, joint, "identification", 100.0, "as recorded", "differences", 0, 0, t=t, q=q,
                    dq=np.gradient(q, 0.01), tau=tau, segment=segment, filled=segment)  # fmt: skip
    entry = study.log(log)
    (average_of,) = [
        r for r in average.run([signal], entry, study.robot, harmonics=0, lowpass=17.0) if isinstance(r, Average)
    ]
    made = differentiate.run(average_of, it, harmonics=0)
    trajectories = [r for r in made if isinstance(r, Trajectory)]
    fits = {r.estimator: r for r in fit.run(trajectories, [], study.robot, lowpass=17.0) if isinstance(r, Fit)}
    assert set(fits) == set(ESTIMATORS)
    for estimator in set(ESTIMATORS) - BIASED:
        found = fits[estimator]
        off = found.theta - [truth[str(parameter)] for parameter in found.parameter]
        assert (np.abs(off) < 4 * found.theta_std).all(), (estimator, off / found.theta_std)


def test_every_way_of_recording_says_the_same_motion(tmp_path):
    study_folder.write(load(str(short(tmp_path))), tmp_path / "out", False, lambda _: None)
    study = reading.read(tmp_path / "out")
    w = 2 * np.pi / 5
    t = np.arange(500) / 100
    q = 0.1 / w * np.sin(w * t) - 0.2 / w * np.cos(w * t)
    for i, (kind, clock, unit) in enumerate(KINDS):
        entry = study.log(f"log-{i}")
        log, columns = open_log(study.folder / entry.files[0]), channels(study, f"log-{i}")
        assert log.format == kind
        if clock == "channel":
            assert columns["time"] == pytest.approx(t, abs=1e-6)
        else:
            assert (log.clock.step, log.clock.start) == (0.01, 0.0)
        assert columns["hand_roll.theta_m"] == pytest.approx(200 * q, abs=200 * 6e-5)
        amperes = columns["hand_roll.i"] * (1e-3 if unit == "mA" else 1.0)
        assert amperes / 1e-4 == pytest.approx(np.round(amperes / 1e-4), abs=0.011)  # LVM has six decimals
        pushed = amperes[200:400].mean() - amperes[np.r_[0:200, 400:500]].mean()
        assert 0.5 < pushed * 200 * 0.0438 < 1.5


def test_the_same_scenario_gives_the_same_bytes(tmp_path):
    for out in ("one", "two"):
        study_folder.write(load(str(short(tmp_path))), tmp_path / out, False, lambda _: None)
    files = sorted(file.name for file in (tmp_path / "one").iterdir())
    assert len(files) == len(KINDS) + 2
    for file in files:
        assert (tmp_path / "one" / file).read_bytes() == (tmp_path / "two" / file).read_bytes()


def test_another_seed_gives_other_noise(tmp_path):
    normal = [generator(seed, log, "hand_roll").normal() for seed, log in ((1, "a"), (2, "a"), (1, "b"))]
    assert len(set(normal)) == 3


def test_the_command_says_what_it_wrote_and_how_much(tmp_path):
    result = CliRunner().invoke(app, [str(short(tmp_path)), str(tmp_path / "out")], catch_exceptions=False)
    lines = result.stdout.splitlines()
    assert lines[0].startswith("log-0: 500 samples of hand_roll -> log_0.tdms, 0.0")
    assert lines[-1].startswith(str(tmp_path / "out"))
    assert "4 simulated logs" in lines[-1]


def test_a_folder_that_holds_something_is_left_alone(tmp_path):
    (tmp_path / "mine").mkdir()
    (tmp_path / "mine" / "thesis.txt").write_text("years of work")
    scenario = load(str(short(tmp_path)))
    for force, says in ((False, "is not empty"), (True, "has no truth.toml")):
        with pytest.raises(BadRequest, match=says):
            study_folder.write(scenario, tmp_path / "mine", force, lambda _: None)
    with pytest.raises(BadRequest, match="is a file"):
        study_folder.write(scenario, tmp_path / "mine" / "thesis.txt", True, lambda _: None)
    assert (tmp_path / "mine" / "thesis.txt").read_text() == "years of work"


def described(tmp_path, text: str | None = None) -> tuple[str, Path]:
    """A scenario, and a folder that holds its study.toml, or this text, and a note."""
    scenario, out = short(tmp_path), tmp_path / "short"
    out.mkdir()
    (out / "study.toml").write_text(text or study_folder.study_text(load(str(scenario))))
    (out / "note.txt").write_text("years of work")
    return str(scenario), out


def contents(folder: Path) -> dict[str, tuple[bytes, int]]:
    return {file.name: (file.read_bytes(), file.stat().st_mtime_ns) for file in folder.iterdir()}


def test_logs_and_truth_are_put_beside_the_study_of_the_scenario_and_no_other_file_changes(tmp_path):
    scenario, out = described(tmp_path)
    before = contents(out)
    simulate.run(scenario, out)
    after = contents(out)
    assert {name: after.pop(name) for name in before} == before
    study_folder.write(load(scenario), tmp_path / "new", False, lambda _: None)
    new = contents(tmp_path / "new")
    assert {"study.toml": new.pop("study.toml")[0]} == {"study.toml": before["study.toml"][0]}
    assert {name: content for name, (content, _) in after.items()} == {
        name: content for name, (content, _) in new.items()
    }
    assert sorted(path.name for path in tmp_path.iterdir()) == ["new", "short", "short.toml"]


@pytest.mark.parametrize(
    ("text", "present", "says"),
    [
        ("title = 'mine'\n", None, "study.toml is not what short writes"),
        (None, "log_0.tdms", "log_0.tdms exists already"),
    ],
)
def test_another_study_or_a_log_in_the_folder_is_refused_in_one_message_and_nothing_is_written(
    tmp_path, text, present, says
):
    scenario, out = described(tmp_path, text)
    if present:
        (out / present).write_text("recorded")
    before = contents(out)
    assert says in call("simulate", scenario, out, code=1).replace("\n", " ")
    assert contents(out) == before
    assert sorted(path.name for path in tmp_path.iterdir()) == ["short", "short.toml"]


def test_a_place_that_cannot_be_written_to_is_named(tmp_path):
    (tmp_path / "file").write_text("")
    with pytest.raises(OSError, match="file"):
        simulate.run(str(short(tmp_path)), tmp_path / "file" / "out")


def test_a_simulated_study_is_replaced_when_asked_for(tmp_path):
    scenario, out = load(str(short(tmp_path))), tmp_path / "out"
    study_folder.write(scenario, out, False, lambda _: None)
    (out / "left.over").write_text("")
    study_folder.write(scenario, out, True, lambda _: None)
    assert not (out / "left.over").exists()
    assert sorted(p.name for p in tmp_path.iterdir()) == ["out", "short.toml"]


def test_a_simulation_that_fails_leaves_nothing_behind(tmp_path, monkeypatch):
    def fail(*_):
        raise RuntimeError("the disk is full")

    monkeypatch.setattr(study_folder.sensors, "write", fail)
    with pytest.raises(RuntimeError):
        study_folder.write(load(str(short(tmp_path))), tmp_path / "out", False, lambda _: None)
    assert [p.name for p in tmp_path.iterdir()] == ["short.toml"]


def test_a_converter_gives_whole_steps():
    assert quantise(np.array([0.26, -0.24, 0.0]), 0.5) == pytest.approx([0.5, -0.0, 0.0])
    assert quantise(np.array([0.26]), 0.0) == pytest.approx([0.26])


def test_drift_has_its_deviation_and_its_correlation():
    noise = SensorNoise(drift=0.4, correlation=0.5)
    x = drift(noise, 100.0, 200_000, np.random.default_rng(3))
    pole = np.exp(-1 / 50)
    independent = 200_000 * (1 - pole) / (1 + pole)  # as many samples as tell something new
    assert x.std() == pytest.approx(0.4, rel=4 / np.sqrt(2 * independent))
    innovation = lfilter([1, -pole], [1], x)[1:]
    assert innovation.std() == pytest.approx(0.4 * np.sqrt(1 - pole**2), rel=4 / np.sqrt(2 * 200_000))
    assert abs(np.corrcoef(innovation[1:], innovation[:-1])[0, 1]) < 4 / np.sqrt(200_000)
