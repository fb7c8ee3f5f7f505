"""An estimated force against a force sensor: errors, range, lag and coverage are those that were put in."""

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.stats import norm

from davinci_forces.maths.contact.force_sensor import errors, interpolate_sensor, lag, reach
from davinci_forces.records import Diagnostic, SensorForce, TipForce, Touch, store
from davinci_forces.robots import load
from davinci_forces.runner import runs
from davinci_forces.simulation import study_folder
from davinci_forces.simulation.scenario import ForceSensor
from davinci_forces.simulation.scenario import reading as scenario
from davinci_forces.stages.tip import sense
from davinci_forces.study import Source
from tests.conftest import TWO_FRICTIONS
from tests.test_averaging import entry
from tests.test_tip import NAMES, PUSH, RATE, STD, T, efforts, noise, run, tracks

ROBOT = "davinci"
LAG, NOISE = 0.02, 0.1
LOG = "matched-tip-contact"
AXES = ("x", "y", "z", "vector")
CHANNELS = tuple(Source(f"{name}.q", name, "angle") for name in NAMES)


def touch(f, t=T) -> Touch:
    """What a sensor of three axes (N, 3), or of one (N,), records."""
    unknown = np.full(len(t), np.nan)
    columns = {"force": f} if f.ndim == 1 else {f"force_{a}": f[:, i] for i, a in enumerate("xyz")}
    counts = {"sample": np.arange(len(t)), "push": np.zeros(len(t), int)}
    other = dict.fromkeys({*Touch.columns()} - {*columns, *counts, "t"}, unknown)
    return Touch(log="push", role="contact", t=t, **columns, **counts, **other)


def sensed(of: Touch, forces=(), own=(), **about) -> list[SensorForce | Diagnostic]:
    about = {"name": "push", "role": "contact", "channels": CHANNELS} | about
    return list(sense.run(of, forces, own, entry(**about), load(ROBOT, Path())))


def late(f, by, t=T) -> np.ndarray:
    return np.stack([np.interp(t - by, t, column) for column in f.T], axis=-1)


def tip(tau) -> TipForce:
    return run(ROBOT, tracks(ROBOT, tau))[TipForce]


def test_errors_are_those_of_the_noise_that_was_put_in_and_most_bands_hold():
    random, N, sigma = np.random.default_rng(1), 20_000, np.array([0.3, 0.2, 0.5])
    f = np.sin(np.arange(N) / 300.0)[:, None] * [2.0, -1.0, 4.0]
    estimated = f + random.normal(0.0, sigma, (N, 3)) + [0.1, 0.0, 0.0]
    of = errors(estimated, np.broadcast_to(np.diag(sigma**2 + [0.01, 0, 0]), (N, 3, 3)), f)
    assert of.force_error == pytest.approx(math.sqrt(0.01 + (sigma**2).sum()), abs=4 * of.force_error_std)
    assert of.force_bias == pytest.approx(0.1, abs=4 * of.force_bias_std)
    assert of.force_range == pytest.approx(np.mean([4.0, 2.0, 8.0]), rel=1e-3)
    relative = np.mean([math.hypot(0.3, 0.1), 0.2, 0.5]) / of.force_range
    assert of.force_relative_error == pytest.approx(relative, abs=4 * of.force_relative_error_std)
    assert of.sensor_coverage == pytest.approx(0.95, abs=0.01)
    one = errors(estimated[:, 1:2], np.full((N, 1, 1), 0.04), f[:, 1:2])
    assert one.sensor_coverage == pytest.approx(0.95, abs=4 * one.sensor_coverage_std)
    narrow = errors(estimated[:, 1:2], np.full((N, 1, 1), 0.01), f[:, 1:2])
    assert narrow.sensor_coverage == pytest.approx(0.6727, abs=0.02)


def test_a_bias_along_one_axis_keeps_its_sign():
    f = np.sin(T)[:, None]
    assert errors(f - 0.5, np.ones((len(T), 1, 1)), f).force_bias == pytest.approx(-0.5)


def test_a_sensor_is_not_read_across_a_gap_or_beyond_its_ends():
    clock = np.array([0.0, 0.01, 0.02, 0.5, 0.51])
    shown = interpolate_sensor(np.array([-0.1, 0.005, 0.02, 0.3, 0.505, 0.6]), clock, clock[:, None], reach=0.03)
    assert_allclose(shown[:, 0], [np.nan, 0.005, 0.02, np.nan, 0.505, np.nan])


@pytest.mark.parametrize("by", [-0.05, 0.0, 0.013, LAG, 0.1])
def test_a_lag_is_found_between_samples_and_under_noise(by):
    random = np.random.default_rng(2)
    f = np.clip(1 - np.abs(T % 5.0 - 2.5), 0, None)[:, None] * [3.0, -4.0, 12.0]  # eight pushes
    shown = late(f, by) + random.normal(0.0, 0.5, f.shape)
    found, std = lag(T, f + random.normal(0.0, 0.2, f.shape), T, shown, RATE, np.ones(len(T), bool))
    assert found == pytest.approx(by, abs=min(4 * std, 3e-3))


def test_no_lag_is_told_of_forces_that_are_not_alike_or_too_far_apart():
    random, every = np.random.default_rng(3), np.ones(len(T), bool)
    for size in (1e-3, 1.0, 1e3):  # of the sensor's force, of which the correlation knows nothing
        assert math.isnan(lag(T, PUSH, T, size * random.normal(size=PUSH.shape), RATE, every)[0])
        assert math.isnan(lag(T, PUSH, T, size * late(PUSH, 0.6), RATE, every)[0])
        assert lag(T, PUSH, T, size * late(PUSH, 0.05), RATE, every)[0] == pytest.approx(0.05, abs=3e-3)


def test_a_sensor_of_three_axes_is_compared_axis_by_axis_and_as_a_vector():
    tau, random = noise(1), np.random.default_rng(4)
    estimate = tip(efforts(ROBOT, PUSH) + tau)
    made = {one.axis: one for one in sensed(touch(late(PUSH, LAG) + random.normal(0.0, 0.1, PUSH.shape)), [estimate])}
    assert list(made) == ["x", "y", "z", "vector"]
    # the whole of the error: that of the efforts, what the sensor is late, and its noise
    J = np.linalg.inv(np.swapaxes(jacobians(), -1, -2))
    true = np.einsum("nij,nj->ni", J, tau) + PUSH - late(PUSH, LAG)
    judged = (T >= 1.0) & (estimate.near_singular == 0)
    for i, axis in enumerate("xyz"):
        one = made[axis]
        assert one.force_error == pytest.approx(math.sqrt(np.mean(true[judged, i] ** 2) + 0.01), rel=0.03)
        inside = np.abs(true[judged, i]) <= 1.96 * one.estimated_force_std[judged]
        assert one.sensor_coverage == pytest.approx(np.mean(inside), abs=0.02)
        assert_allclose(one.estimated_force, getattr(estimate, f"f_{axis}"))
    whole = made["vector"]
    assert whole.sensor_lag == pytest.approx(LAG, abs=4e-3)
    assert whole.force_range == pytest.approx(np.mean([made[a].force_range for a in "xyz"]))
    assert whole.force_relative_error == pytest.approx(
        np.mean([made[a].force_error for a in "xyz"]) / whole.force_range, rel=1e-6
    )
    assert whole.force_error == pytest.approx(math.hypot(*(made[a].force_error for a in "xyz")))
    assert whole.sensor_coverage == pytest.approx(0.95, abs=0.03)


def jacobians() -> np.ndarray:
    """J (N, 3, 3) along the motion: row i is what a newton along axis i makes of the joints."""
    return np.stack([efforts(ROBOT, np.tile(row, (len(T), 1))) for row in np.eye(3)], axis=1)


def test_a_sensor_of_one_axis_is_compared_with_the_size_of_the_force():
    estimate = tip(efforts(ROBOT, PUSH))
    [one] = sensed(touch(-np.linalg.norm(PUSH, axis=1)), [estimate])
    assert one.axis == "size"
    assert one.force_error < 1e-9
    assert one.sensor_coverage == 1.0


def test_a_sensor_of_the_opposite_sign_is_named_axis_by_axis():
    """One of the force on the robot, one with its z axis down, and one that is right."""
    estimate = tip(efforts(ROBOT, PUSH) + noise(1))
    for signs, said in (((-1, -1, -1), "force_x, force_y, force_z"), ((1, 1, -1), "force_z"), ((1, 1, 1), "")):
        found = [
            text for one in sensed(touch(PUSH * signs), [estimate]) if isinstance(one, Diagnostic) for text in one.text
        ]
        assert [text.partition("write sign = -1 with ")[2].removesuffix(" in study.toml") for text in found] == [
            said
        ] * bool(said)


def test_without_a_force_at_the_tip_the_joint_that_slides_is_compared_with_its_sign():
    tau = np.zeros((len(T), 3))
    tau[:, 2] = -PUSH[:, 2]
    [one] = sensed(touch(PUSH[:, 2] + 0.2), [], tracks(ROBOT, tau))
    assert one.axis == "instrument_slide"
    assert one.force_error == pytest.approx(0.2)
    assert one.force_bias == pytest.approx(0.2)
    assert_allclose(one.estimated_force_std, STD[2])


def test_a_log_with_a_sensor_and_nothing_to_compare_says_so():
    [said] = sensed(touch(PUSH))
    assert isinstance(said, Diagnostic)
    assert "its force sensor is not compared with an estimate" in said.text[0]
    assert said.severity.tolist() == ["warning"]  # so the terminal and page one show it
    at_rest = tracks(ROBOT, np.zeros((len(T), 3)), at_rest=(1, 1, 1))
    assert isinstance(sensed(touch(PUSH), [], at_rest)[0], Diagnostic)


def test_logs_without_a_sensor_or_without_joints_are_passed_over():
    assert not sensed(touch(np.full(len(T), np.nan)))
    assert not sensed(touch(PUSH), channels=())


def test_the_size_of_a_tiny_force_is_its_length_with_the_variance_along_it():
    f, C = 1e-5 * np.array([[3.0, 0.0, 4.0], [0.0, 0.0, 0.0]]), np.diag([1.0, 2.0, 3.0])[None] + np.zeros((2, 1, 1))
    force = sense.size(sense.EstimatedForce(np.arange(2.0), f, C, np.ones(2, bool)))
    assert_allclose(force.f[:, 0], [5e-5, 0.0])
    assert_allclose(force.C[:, 0, 0], [0.36 * 1.0 + 0.64 * 3.0, 1.0])  # that of x0 where there is no direction


def test_samples_near_a_singular_pose_are_not_judged():
    estimate = tip(efforts(ROBOT, PUSH))
    near = replace(estimate, near_singular=(T > 20.0).astype(np.int64))
    assert sensed(touch(PUSH), [near])[0].tested == int(((T >= 1.0) & (T <= 20.0)).sum())


@pytest.fixture(scope="module")
def simulated(tmp_path_factory) -> Path:
    """The arm of the demonstration, pushed at its tip, with a sensor there: identified, tracked and compared."""
    home = tmp_path_factory.mktemp("sensor")
    demo = scenario.load(TWO_FRICTIONS)
    names = {f"matched-{joint}-{kind}" for joint in ("roll", "pitch", "slide") for kind in ("excitation", "validation")}
    logs = tuple(log for log in demo.logs if log.name in names)
    [pushed] = [log for log in demo.logs if log.name == LOG]
    logs += (replace(pushed, sensor=ForceSensor(noise=NOISE, lag=LAG)),)
    study_folder.write(replace(demo, logs=logs), home / "raw" / "arm", False, lambda _: None)
    assert runs.run(home / "raw" / "arm", ["sense"], jobs=2, verbosity="quiet")
    return home / "processed" / "arm"


@pytest.mark.medium
def test_a_simulated_sensor_gives_the_error_the_lag_and_the_coverage_that_were_simulated(simulated):
    """Error and coverage are those of the estimate against the true force as late as the sensor, and its noise."""
    made = {axis: store.read(SensorForce, simulated, Path("sensor_force", LOG, f"{axis}.parquet")) for axis in AXES}
    force = store.read(TipForce, simulated, Path("tip_force", f"{LOG}.parquet"))
    [log] = [log for log in scenario.load(TWO_FRICTIONS).logs if log.name == LOG]
    true = sum(np.outer(push.effort_at(force.t - LAG), np.array(push.direction)) for push in log.tip)
    judged = (force.t >= 1.0) & (force.near_singular == 0)
    squares = 0.0
    for i, axis in enumerate("xyz"):
        e, std = (getattr(force, f"f_{axis}") - true[:, i])[judged], np.sqrt(getattr(force, f"c_{axis}{axis}"))[judged]
        squares += np.mean(e**2) + NOISE**2
        assert made[axis].force_error == pytest.approx(math.sqrt(np.mean(e**2) + NOISE**2), rel=0.03)
        # a sample is within the band by what the noise leaves of the way to its edges
        inside = norm.cdf((1.96 * std - e) / NOISE) - norm.cdf((-1.96 * std - e) / NOISE)
        assert made[axis].sensor_coverage == pytest.approx(np.mean(inside), abs=0.01)
    whole = made["vector"]
    assert whole.force_error == pytest.approx(math.sqrt(squares), rel=0.03)
    assert whole.sensor_lag == pytest.approx(LAG, abs=5e-3)


def test_a_band_of_three_axes_is_an_ellipsoid_and_the_largest_error_has_the_deviation_along_itself():
    """chi^2 of three degrees of freedom is 7.815 at 95 %; of one, 1.96 squared."""
    sigma = np.diag([0.04, 0.09, 0.25])
    for k, limit in ((3, np.sqrt(7.815)), (1, 1.95996)):
        C = np.broadcast_to(sigma[:k, :k], (400, k, k))
        along = np.array([0.6, 0.0, 0.8])[:k] / np.linalg.norm([0.6, 0.0, 0.8][:k])
        reach_of = 1.0 / np.sqrt(along @ np.linalg.inv(sigma[:k, :k]) @ along)
        sizes = limit * reach_of * np.where(np.arange(400) < 100, 1.001, 0.999)
        found = errors(sizes[:, None] * along, C, np.zeros((400, k)))
        assert found.sensor_coverage == 0.75
        assert found.force_error_max == pytest.approx(sizes[0], rel=1e-9)
        assert found.force_error_max_std == pytest.approx(np.sqrt(along @ sigma[:k, :k] @ along), rel=1e-9)


@pytest.mark.parametrize(
    ("width", "at", "expected"), [(1.5, 20, 0), (3.0, 20, 1), (80.0, 20, 10), (80.0, 4, 4), (80.0, 36, 4)]
)
def test_a_peak_has_the_neighbours_of_at_least_half_its_correlation_on_both_sides(width, at, expected):
    assert reach(1.0 - np.abs(np.arange(41.0) - at) / width, at) == expected
