"""The motion of a joint without noise, and its model along a log, which all later stages start from."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from davinci_forces.filters.problem import filter_inputs
from davinci_forces.maths.models.independent import regressor
from davinci_forces.maths.models.terms import bias
from davinci_forces.maths.signals.smoothing import lowpass, measured_motion, noise_std, share_passed
from davinci_forces.records import (
    Average,
    Choice,
    Diagnostic,
    Fit,
    JointModel,
    Motion,
    Prediction,
    Recording,
    Residual,
    Signal,
)
from davinci_forces.stages.model import choose, fit, predict
from davinci_forces.stages.recordings import average as averaging
from davinci_forces.stages.recordings import resample
from davinci_forces.study.entries import ROLES
from tests import arm
from tests.test_averaging import entry
from tests.test_estimation import trajectory

RATE, CUTOFF = 100.0, 17.0


def resampled(role="identification", velocity="logged", gap=False) -> tuple[Signal, Motion]:
    signal = arm.signal(periods=2)
    kept = np.abs(signal.t - 12.0) > 1.0 if gap else np.ones(len(signal), bool)
    columns = {name: getattr(signal, name)[kept] for name in ("t", "q", "dq", "tau", "filled")}
    made = list(resample.run(Recording("run", "hand_roll", role, RATE, velocity, **columns), arm.joint("hand_roll"),
                             lowpass=CUTOFF))  # fmt: skip
    return tuple(next(record for record in made if isinstance(record, kind)) for kind in (Signal, Motion))


def hidden(motion):
    """The size of a velocity whose sign is as likely noise as not: the median of |noise| that the low-pass passes."""
    return 0.6744897501960817 * motion.sigma_dq * np.sqrt(share_passed(motion.rate, CUTOFF))


@pytest.mark.parametrize("role", ROLES)
def test_every_log_has_its_motion_whatever_its_role(role):
    signal, motion = resampled(role, gap=True)
    assert (motion.role, motion.cutoff, motion.effort_lag, motion.at_rest) == (role, CUTOFF, 0.0, 0)
    for name, measured in (("t", "t"), ("q", "q_measured"), ("dq", "dq_measured"), ("tau", "tau"), ("segment",) * 2):
        assert_array_equal(getattr(signal, name), getattr(motion, measured))
    assert set(motion.segment) == {0, 1}
    for number in (0, 1):
        part = motion.segment == number
        assert_array_equal(motion.q[part], lowpass(signal.q[part], signal.rate, CUTOFF))
        dq = lowpass(signal.dq[part], signal.rate, CUTOFF)
        assert_array_equal(motion.dq[part], np.where(np.abs(dq) < hidden(motion), 0.0, dq))
        assert_array_equal(motion.ddq[part], np.gradient(dq, 1.0 / signal.rate))
    for x, sigma in ((signal.q, "sigma_q"), (signal.dq, "sigma_dq"), (signal.tau, "sigma_tau")):
        assert getattr(motion, sigma) == noise_std(x, signal.segment, signal.rate, CUTOFF)


def test_a_velocity_that_was_not_logged_is_that_of_the_low_passed_position():
    signal, motion = resampled(velocity="derived")
    dq = np.gradient(motion.q, 1.0 / signal.rate)
    assert_array_equal(motion.dq, np.where(np.abs(dq) < 0.6745 * motion.sigma_dq, 0.0, dq))
    assert_array_equal(signal.dq, dq)
    assert motion.sigma_dq == noise_std(signal.dq, signal.segment, signal.rate, CUTOFF)


def test_a_lag_of_the_effort_gives_the_motion_so_long_before_within_each_segment():
    t, lag = np.arange(2000) / RATE, 0.0137
    segment = (t > 9.0).astype(int)
    columns = measured_motion(np.sin(4 * t), 4 * np.cos(4 * t), segment, RATE, CUTOFF, lag=lag)
    inside = (np.abs(t - 9.0) > 0.5) & (t > 0.5) & (t < 19.5)
    for before, wanted in zip(columns, (np.sin, lambda x: 4 * np.cos(x)), strict=False):
        assert_allclose(before[inside], wanted(4 * (t - lag))[inside], atol=1e-3)


@pytest.mark.parametrize("lag", [-0.0275, 0.0137])
def test_a_delayed_motion_goes_on_at_the_ends_of_each_segment_as_its_velocity_says(lag):
    t = np.arange(400) / RATE
    segment = (t > 1.5).astype(int)
    q, dq, _ = measured_motion(0.3 * t, np.full(len(t), 0.3), segment, RATE, CUTOFF, lag=lag)
    assert_allclose(dq, 0.3)
    assert_allclose(q, 0.3 * (t - lag), atol=1e-5)  # the low-pass errs at the ends


@pytest.fixture(scope="module")
def identified() -> tuple[Signal, list[Fit], list[Prediction]]:
    """Three periods and a half of the roll, their fits, and what refits without a period predict of them."""
    signal = arm.signal(periods=3.5)
    own, motion = trajectory(signal), arm.motion(signal)
    fits = [r for r in fit.run([own], [motion], arm.ARM, lowpass=CUTOFF) if isinstance(r, Fit)]
    made = fit.apply([motion], [own], [], entry(), arm.ARM, lowpass=CUTOFF)
    return signal, fits, [r for r in made if isinstance(r, Prediction)]


def test_the_model_of_a_joint_is_its_fit_along_the_low_passed_motion(identified):
    signal, fits, _ = identified
    [model], motion = arm.models([signal], fits, fit="independent.huber"), arm.motion(signal)
    theta = next(f.theta for f in fits if f.estimator == "huber")
    assert (model.model, model.estimator, model.stand_in) == ("independent", "huber", "")
    terms = arm.joint("hand_roll").terms
    assert_allclose(model.tau_hat, regressor(terms, motion.q, motion.dq, motion.ddq) @ theta)
    b, _, _ = bias(filter_inputs(model)[0].joint.coefficients, model.q, model.dq, 0.0)
    assert_allclose(model.inertia * model.ddq + b + model.tau_known, model.tau_hat)
    assert_array_equal(model.q_measured, signal.q)


def test_the_fit_that_the_study_names_is_scored_and_has_its_residual_although_it_was_not_chosen(identified):
    signal, fits, _ = identified
    named = replace(next(f for f in fits if f.estimator == "huber"), model="other")
    fresh, about = arm.motion(replace(signal, log="fresh", role="validation")), entry(name="fresh", role="validation")
    made = [*predict.run([fresh], [*fits, named], about, arm.ARM, lowpass=CUTOFF, fit="other.huber")]
    scores = {(p.model, p.estimator): p.relative_error for p in made if isinstance(p, Prediction)}
    assert scores["other", "huber"] == scores["independent", "huber"]
    without = [*predict.run([fresh], [*fits, named], about, arm.ARM, lowpass=CUTOFF, fit="independent.huber")]
    assert all(p.model != "other" for p in without if isinstance(p, Prediction))
    along = predict.apply([arm.motion(signal)], [], [], [*fits, named], entry(), arm.ARM, fit="other.huber")
    assert [(r.model, r.estimator) for r in along if isinstance(r, Residual)] == [("other", "huber")]


@pytest.mark.parametrize(("end", "is_edge"), [(4, True), (60, False)])
def test_what_is_not_scored_at_an_end_of_a_log_may_be_due_to_the_low_pass_if_it_is_as_short(identified, end, is_edge):
    signal, fits, _ = identified
    fresh = arm.motion(replace(signal, log="fresh", role="validation"))
    tau = fresh.tau.copy()
    tau[:end] += 30.0
    about = entry(name="fresh", role="validation")
    made = predict.run([replace(fresh, tau=tau)], fits, about, arm.ARM, lowpass=CUTOFF, fit="independent.lse")
    [said] = [text for d in made if isinstance(d, Diagnostic) and d.subject.endswith(".steps") for text in d.text]
    assert "are not scored: the effort steps there" in said
    assert ("or where a log begins or ends amid a motion" in said) == is_edge
    assert ("leave them out by `skip` and `until`" in said) == (not is_edge)


def test_a_residual_is_bounded_and_0_where_the_joint_rests_in_every_period(identified):
    """A rest of a tenth of the period; all of the first is unscored, too, as where a log starts from rest."""
    signal, fits, predictions = identified
    [model] = arm.models([signal], fits, predictions)
    made = averaging.run([signal], entry(), arm.ARM, harmonics=0, lowpass=CUTOFF)
    [average] = [record for record in made if isinstance(record, Average)]
    phase = (model.t - average.t_start) % average.period / average.period
    rests = (phase > 0.45) & (phase < 0.55)
    model = replace(model, unscored=np.where(rests | (model.t < average.t_start + 0.5), 1, 0))
    made = predict.residual_of(model, average, ("chosen", "lse"))
    scored = predict.residual_of(replace(model, unscored=np.zeros(len(model), int)), average, ("chosen", "lse"))
    errors, at = made.tau - made.tau_hat, made.t / average.period
    assert np.abs(errors[(at > 0.46) & (at < 0.54)]).max() == 0.0
    assert np.abs(made.tau).max() <= 1.2 * np.abs(model.tau).max()
    elsewhere = (at < 0.44) | (at > 0.56)
    assert np.corrcoef(made.tau[elsewhere], scored.tau[elsewhere])[0, 1] > 0.999
    last = model.t > average.t_start + (average.periods - 1) * average.period
    once = predict.residual_of(replace(model, unscored=np.where(rests & ~last, 1, 0)), average, ("chosen", "lse"))
    assert (np.abs(once.tau - once.tau_hat)[(at > 0.46) & (at < 0.54)] > 0.0).all()  # of one period is of use


def test_an_identification_log_is_predicted_by_refits_that_had_not_seen_the_sample(identified):
    signal, fits, predictions = identified
    [model] = arm.models([signal], fits, predictions)
    refit = next(p for p in predictions if p.estimator == "lse")
    there = signal.t < refit.t[-1] + 0.5 / RATE
    assert_array_equal(model.tau_hat_unseen[there], refit.tau_hat)
    assert np.isnan(model.tau_hat_unseen[~there]).sum() > 0.4 * 10.0 * RATE
    assert (model.scheme, model.path, model.path_unseen) == ("leave one period out", "same path", "same path")
    # A period of more effort moves what is predicted of the others, and not what is of its own.
    more = replace(signal, tau=signal.tau + np.where((signal.t >= 10.0) & (signal.t < 20.0), np.sign(signal.dq), 0.0))
    altered = fit.apply([arm.motion(more)], [trajectory(more)], [], entry(), arm.ARM, lowpass=CUTOFF)
    [other] = arm.models([more], fits, [r for r in altered if isinstance(r, Prediction)])
    moved = np.abs(other.tau_hat_unseen - model.tau_hat_unseen)
    assert np.median(moved[1000:2000]) < 0.05 * np.median(moved[:1000])


def test_no_refit_is_asked_of_a_log_that_no_fit_has_seen(identified):
    signal, fits, predictions = identified
    [model] = arm.models([replace(signal, role="validation")], fits, predictions)
    assert np.isnan(model.tau_hat_unseen).all()
    assert (model.scheme, model.path, model.path_unseen) == ("validation", "another path", "another path")
    [model] = arm.models([signal], fits)
    assert (model.scheme, model.path_unseen) == ("", "")


def test_a_joint_without_a_model_says_why_once(identified):
    signal, fits, _ = identified
    backward = [replace(f, theta=-f.theta) for f in fits]
    for role in ("identification", "validation", "contact", "weight", "tissue"):
        each = replace(signal, role=role), replace(arm.signal("hand_pitch", periods=3.5), role=role)
        model, pitch = arm.models(each, fits)
        assert isinstance(model, JointModel)
        assert isinstance(pitch, Diagnostic)
        assert "run/hand_pitch: no identification log moves this joint" in pitch.text[0]
        [wrong] = arm.models(each[:1], backward)
        assert "the inertia of independent.lse is not positive" in wrong.text[0]
    assert not arm.models([replace(signal, role="friction")], fits)


def test_where_a_log_lacks_joints_of_the_chosen_model_that_of_the_joint_by_itself_stands_in(identified):
    from davinci_forces.robots import davinci
    from tests.test_explain import fit as of_roll

    fits = [of_roll("independent"), of_roll("coupled")]
    [note, model] = arm.models([identified[0]], fits, fit="coupled.lse", robot=davinci.ROBOT)
    assert "the log does not hold the other joints that coupled.lse needs, so independent.lse is used" in note.text[0]
    assert (model.model, note.text[0].endswith(model.stand_in)) == ("independent", True)


@pytest.mark.parametrize(("physical", "used"), [(1, "independent+dahl"), (0, "independent")])
def test_the_best_physical_model_of_a_joint_by_itself_stands_in(identified, physical, used):
    from davinci_forces.robots import davinci
    from tests.test_explain import fit as of_roll

    fits = [of_roll("independent"), of_roll("coupled"), replace(of_roll("independent"), model="independent+dahl")]
    variants = np.array(["coupled", "independent+dahl", "independent"], object)
    columns = dict.fromkeys(Choice.columns(), np.zeros(3)) | {"candidate": variants, "variant": variants}
    columns |= {"score": np.array([0.1, 0.2, 0.3]), "physical": np.array([1, physical, 1])}
    about = dict.fromkeys(Choice.scalars(), "") | {"group": "hand_roll", "model": "coupled", "estimator": "lse"}
    made = arm.models([identified[0]], [*fits, Choice(**about | columns)], fit="chosen", robot=davinci.ROBOT)
    assert any(f"coupled.lse needs, so {used}.lse is used" in d.text[0] for d in made if isinstance(d, Diagnostic))
    assert [m.model for m in made if isinstance(m, JointModel)] == [used]


def test_the_stage_has_a_record_of_its_own_for_every_joint_that_a_fit_describes(identified):
    signal, fits, _ = identified
    made = list(predict.apply([arm.motion(signal)], [], [], fits, entry(), arm.ARM, fit="independent.lse"))
    assert [record.key for record in made] == [("run", "hand_roll")]


def test_a_log_without_some_joints_of_the_arm_is_named_with_the_remedy():
    def log(name: str, *joints: str):
        return SimpleNamespace(joints=joints, records=[SimpleNamespace(log=name, joint=joints[0])])

    names = [joint.name for joint in arm.ARM.joints]
    (warning,) = choose.not_of_arm([log("whole", *names), log("part", names[0])], arm.ARM)
    assert warning.severity.tolist() == ["warning"]
    assert warning.text[0].startswith(f"part: no model of the whole arm is fitted to this log, as it lacks {names[1]}")


@pytest.mark.parametrize(
    ("moving", "together"), [([(1, 0, 0), (0, 1, 0)], False), ([(1, 0, 0), (1, 1, 0)], True), ([(0, 1, 0)], True)]
)
def test_joints_recorded_one_at_a_time_are_named_with_the_remedy_where_they_couple(moving, together):
    from davinci_forces.robots import davinci

    names = [joint.name for joint in arm.ARM.joints]
    logs = [
        SimpleNamespace(
            records=[SimpleNamespace(joint=n, at_rest=not m) for n, m in zip(names, moves, strict=True)],
            is_moving=np.array(moves, bool),
        )
        for moves in moving
    ]
    warnings = list(choose.never_together(logs, davinci.ROBOT))
    assert [str(w.text[0]) for w in warnings] == [
        "arm: no identification log moves hand_roll and hand_pitch together, so the effort that each needs for the "
        "motion of the others is not identified; where they move together, record an excitation of all: "
        "`davinci-forces excite davinci all`"
    ] * (not together)
    assert not list(choose.never_together(logs, arm.ARM))  # which has no chain


def test_efforts_in_amperes_are_said_to_keep_joints_from_sharing_links():
    from davinci_forces.robots import davinci

    first, *others = davinci.ROBOT.joints
    robot = replace(davinci.ROBOT, joints=(replace(first, effort="A"), *others))
    [warning] = choose.no_shared_links(robot)
    assert "the effort of hand_roll is in A, so no model is tried whose joints share links" in warning.text[0]
    assert not list(choose.no_shared_links(davinci.ROBOT))
