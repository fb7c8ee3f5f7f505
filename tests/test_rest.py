"""A joint that rests: its friction has no known sign, it is not judged, and what pushes it harder is found."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose

from davinci_forces.maths.models.independent import regressor
from davinci_forces.maths.models.memory import deflection
from davinci_forces.maths.models.model import ArmMotion
from davinci_forces.maths.signals.standstill import without_doubtful_signs
from davinci_forces.records import (
    Average,
    Contact,
    Diagnostic,
    ErrorBand,
    Fit,
    FreeMotion,
    MeasurementNoise,
    Prediction,
    Signal,
    Trajectory,
)
from davinci_forces.stages.forces import assess, calibrate, ekf, measure, tune
from davinci_forces.stages.model import fit, predict
from davinci_forces.stages.recordings import average, differentiate
from davinci_forces.study import LogEntry
from tests import arm
from tests.report.report_records import free_space, record

RATE, LOWPASS = 100.0, 17.0
JOINT = arm.joint("hand_roll")
COULOMB = arm.THETA["hand_roll"][3]
REST = (20.0, 44.0)  # [s]


def resting(stuck, push=0.0, role="contact", seed=3) -> Signal:
    """Two periods, a rest in which friction holds `stuck` times its Coulomb level, and the second period again.

    From 30 to 33 s something is pushed.
    """
    moving = arm.signal("hand_roll", periods=3, seed=seed, role=role, log=role)
    before = moving.t < REST[0]
    q_0 = arm.excitation("hand_roll", np.array(REST[0]))[0]
    rng, t = np.random.default_rng(seed), np.arange(*REST, 1.0 / RATE)
    still = np.zeros_like(t)
    gravity = regressor(JOINT.terms, q_0 + still, still, still) @ arm.THETA["hand_roll"]
    tau = gravity + stuck * COULOMB + np.where((t > 30.0) & (t < 33.0), push, 0.0)
    tau = tau + arm.NOISE["hand_roll"] * rng.normal(size=len(t))
    columns = {"q": q_0 + 1e-5 * rng.normal(size=len(t)), "dq": 1e-4 * rng.normal(size=len(t)), "tau": tau}
    parts = {name: np.concatenate([getattr(moving, name)[before], x, getattr(moving, name)[~before]])
             for name, x in columns.items()}  # fmt: skip
    times = np.arange(len(parts["q"])) / RATE
    zero = np.zeros(len(times), int)
    return replace(moving, t=times, segment=zero, filled=zero, **parts)


def entry(role) -> LogEntry:
    return LogEntry(role, ("x",), role, (), contact=((30.0, 33.0),) if role == "contact" else ())


@pytest.fixture(scope="module")
def identified():
    """The fits, the noise and the error band of the roll, from an excitation and a check that rests, too."""
    signal = arm.signal("hand_roll", periods=6)
    means = average.run([signal], entry("identification"), arm.ARM, harmonics=0, lowpass=LOWPASS)
    [mean] = [r for r in means if isinstance(r, Average)]
    [own] = [r for r in differentiate.run(mean, JOINT, harmonics=0) if isinstance(r, Trajectory)]
    records = list(fit.run([own], [arm.motion(signal)], arm.ARM, lowpass=LOWPASS))
    fits, [between] = ([r for r in records if isinstance(r, kind)] for kind in (Fit, MeasurementNoise))
    [model] = arm.models([signal], fits)
    [noise] = tune.gather(tune.run(model, between, lowpass=LOWPASS, delay=0.1), delay=0.1)
    free = [calibrated(resting(stuck, role="validation"), fits, noise) for stuck in (0.9, -0.9)]
    return fits, noise, free


def calibrated(signal, fits, noise) -> FreeMotion:
    [model] = arm.models([signal], fits)
    [free] = calibrate.run(model, noise, entry("validation"), JOINT, q_tau=0.0)
    return free


def tracked(signal, identified):
    fits, noise, free = identified
    [model] = arm.models([signal], fits)
    [band] = calibrate.gather(free[:1])
    assert isinstance(band, ErrorBand)
    [track] = ekf.run(model, noise, band, entry(signal.role), JOINT, q_tau=0.0)
    return track


def pushed(stuck, push, identified):
    """The contacts of a resting joint that is pushed, and the threshold."""
    space, _ = assess.run(tracked(resting(stuck, role="validation"), identified), entry("validation"), arm.ARM)
    thresholds = list(assess.gather([space]))
    track = tracked(resting(stuck, push), identified)
    made = list(measure.run(track, thresholds, entry("contact"), arm.ARM))
    return next(r for r in made if isinstance(r, Contact)), track


@pytest.mark.parametrize("stuck", [0.9, -0.9])
@pytest.mark.parametrize("side", [1.0, -1.0])
def test_a_push_on_a_resting_joint_is_found_above_its_friction_and_not_claimed_below(identified, stuck, side):
    contact, track = pushed(stuck, side * (2.0 * COULOMB + 0.5), identified)
    assert (contact.found[0], contact.above[0]) == (1, 1)
    assert contact.onset[0] == pytest.approx(30.0, abs=measure.WINDOW_MARGIN)
    assert abs(contact.mean[0] - side * (2.0 * COULOMB + 0.5)) < 2.0 * contact.mean_std[0] < 4.0 * COULOMB
    assert track.static_friction == pytest.approx(COULOMB, rel=0.1)
    weak, _ = pushed(stuck, side * 0.1 * COULOMB, identified)
    assert (weak.found[0], weak.above[0]) == (0, 0)
    assert len(weak) == len(contact) == 1  # friction at rest is no contact


def test_the_band_at_rest_holds_all_of_the_friction_and_elsewhere_none(identified):
    track = tracked(resting(0.9), identified)
    rest = track.standing > 0
    assert_allclose([track.t[rest][0], track.t[rest][-1]], REST, atol=0.7)
    assert (1.96 * track.tau_ext_std[rest] > track.static_friction).all()
    away = (track.t < 19.0) & (track.t > 2.0)
    assert track.tau_ext_std[away].max() < 0.5 * track.static_friction


def test_friction_held_at_rest_moves_no_score_no_level_and_no_band(identified):
    fits, _, (one, other) = identified
    size = np.abs(one.tau_ext_smooth).max()
    assert_allclose(one.tau_ext_smooth, other.tau_ext_smooth, atol=1e-2 * size)  # forgotten within the transient
    scores, spaces = [], []
    for stuck in (0.9, -0.9):
        signal = resting(stuck, role="validation")
        made = list(
            predict.run([arm.motion(signal)], fits, entry("validation"), arm.ARM, lowpass=LOWPASS, fit="chosen")
        )
        scores.append([r.relative_error for r in made if isinstance(r, Prediction)])
        space, _ = assess.run(tracked(signal, identified), entry("validation"), arm.ARM)
        spaces.append([space.free_rms, space.coverage, space.detection_level, space.free_max])
    assert_allclose(*scores, rtol=2e-3)  # the low-pass carries a little of it beyond the samples left out
    assert_allclose(*spaces, rtol=1e-2)


def test_no_sign_is_that_of_rounding(identified):
    """At rest the low-passed velocity is rounding, 1e-28 or noise; the model predicts neither sign of friction."""
    signal = resting(0.0, role="validation")
    quiet = (signal.t > REST[0]) & (signal.t < REST[1])
    signal = replace(signal, dq=np.where(quiet, 0.0, signal.dq))
    [model] = arm.models([signal], identified[0])
    inside = (signal.t > REST[0] + 0.5) & (signal.t < REST[1] - 0.5)
    gravity = model.gravity_sine * np.sin(model.q)
    assert_allclose(model.tau_hat[inside], (gravity + model.inertia * model.ddq)[inside], atol=1e-9)


def test_a_velocity_within_its_noise_has_no_sign_and_a_presliding_friction_keeps_its_state():
    t = np.arange(2000) / RATE
    dq = np.where(t < 10.0, np.sin(t), 1e-3 * np.random.default_rng(0).normal(size=len(t)))
    standing = np.zeros(len(t), bool)
    signs = np.sign(without_doubtful_signs(dq, standing, 0.0, 1e-3))
    assert np.mean(signs[t >= 10.0] == 0.0) == pytest.approx(0.5, abs=0.06)
    assert np.mean(signs[t < 10.0] == 0.0) < 0.01
    held = without_doubtful_signs(dq, t >= 10.0, 0.0, 1e-3)[:, None]
    z, _ = deflection(ArmMotion(held, held, held, 1.0 / RATE, np.zeros(len(t), int)), 0, 0.01)
    assert np.ptp(z[t >= 10.0 + 1.0 / RATE]) == 0.0
    assert abs(z[-1]) > 0.99


def judged(signal, fits, **stated):
    """The relative errors of a log, and what is said of steps in it."""
    about = replace(entry(signal.role), **stated)
    made = list(predict.run([arm.motion(signal)], fits, about, arm.ARM, lowpass=LOWPASS, fit="chosen"))
    errors = {r.estimator: r.relative_error for r in made if isinstance(r, Prediction)}
    return errors, [text for r in made if isinstance(r, Diagnostic) for text in r.text]


@pytest.mark.parametrize(("first", "last"), [(0.0, 3.0), (57.5, 60.0)])
def test_a_step_as_the_controller_starts_or_stops_is_named_and_not_scored(identified, first, last):
    whole = arm.signal("hand_roll", periods=6, seed=5, role="validation", log="check")
    off = (whole.t >= first) & (whole.t < last)
    stepped = replace(whole, tau=whole.tau + 1.0 * off)
    (errors, remarks), (wanted, none) = (judged(signal, identified[0]) for signal in (stepped, whole))
    assert not none
    assert len(remarks) == 1
    start, end = (float(x) for x in remarks[0].split(": ")[1].split(" s are")[0].split(" to "))
    assert (start, end) == pytest.approx((first, last), abs=0.15)
    assert errors["lse"] == pytest.approx(wanted["lse"], rel=0.1)
    [model] = arm.models([stepped], identified[0])
    assert_allclose(model.t[model.unscored > 0][[0, -1]], (start, end), atol=0.02)


@pytest.mark.parametrize("role", ["validation", "contact"])
def test_an_effort_with_a_wrong_sign_is_named_and_a_hard_push_is_not(identified, role):
    right = arm.signal("hand_roll", periods=3, seed=5, role=role, log="check")
    push = np.where((right.t > 2.0) & (right.t < 4.0), 2.0 * np.abs(right.tau).max(), 0.0)
    for log, wrong in (
        (replace(right, tau=-right.tau), True),
        (right, False),
        (replace(right, tau=right.tau + push), False),
    ):
        _, remarks = judged(log, identified[0])
        assert any("check/hand_roll: the effort is the opposite of the model's" in x for x in remarks) == wrong


@pytest.mark.parametrize("seed", range(8))
def test_no_part_of_motion_that_is_hard_to_predict_and_no_contact_is_left_out(identified, seed):
    """Friction twice as large, which jumps at reversals, of which one log has one, near its start; and a push."""
    signal = arm.signal("hand_roll", periods=3, seed=seed, role="validation", log="check")
    harder = replace(signal, tau=signal.tau + COULOMB * np.sign(signal.dq))
    reversals = signal.t[1:][np.diff(np.sign(arm.excitation("hand_roll", signal.t)[1])) != 0]
    gap = np.argmax(np.diff(reversals))
    once = (signal.t > reversals[gap] - 0.3) & (signal.t < reversals[gap + 1] - 0.3)
    single = replace(
        harder, **{name: getattr(harder, name)[once] for name in ("t", "q", "dq", "tau", "segment", "filled")}
    )
    touched = replace(signal, tau=signal.tau + np.where((signal.t > 2.0) & (signal.t < 3.0), 1.0, 0.0))
    for log in (harder, single):
        assert not judged(log, identified[0])[1]
    assert not judged(replace(touched, role="contact"), identified[0], contact=((1.9, 3.1),))[1]
    assert judged(touched, identified[0])[1]  # nobody stated it: named


def test_without_an_error_in_free_motion_there_is_no_alarm_level_and_no_error_of_one():
    space = free_space(joint="hand_roll", tested=1000, quartile_coverage=np.ones(4), quartile_coverage_std=np.zeros(4))
    [threshold] = assess.gather([space])
    assert (threshold.alarm_level, threshold.alarm_level_std) == (0.0, 0.0)
    [threshold] = assess.gather([replace(space, free_rms=0.1, free_rms_std=0.01, free_max=0.3, crossings=1.0)])
    assert threshold.alarm_level_std / threshold.alarm_level == pytest.approx(0.1)


def test_a_band_is_that_of_at_most_twenty_logs_from_the_first_to_the_last():
    """The cost of each later task does not grow with the study."""
    motions = [record(FreeMotion, 5, log=f"log-{i}", joint="hand_roll", block=np.zeros(5, int)) for i in range(43)]
    [band] = calibrate.gather(motions)
    logs = list(dict.fromkeys(band.source))
    assert 10 < len(logs) <= 20
    assert {"log-0", "log-42"} <= set(logs)
    assert [len(set(next(iter(calibrate.gather(motions[:n]))).source)) for n in (1, 7)] == [1, 7]
