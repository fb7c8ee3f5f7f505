"""The filter as samples arrive: its numbers are those of the analysis, and bad samples leave it as it was."""

import json
import subprocess
import sys
from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose

from davinci_forces.exports import renderer
from davinci_forces.exports.identified import export_of
from davinci_forces.filters import online, tracker
from davinci_forces.filters.online import (
    BAD_INPUT,
    OK,
    OTHER_RATE,
    OUTSIDE_VALIDITY,
    STARTING,
    LinkTree,
    OnlineJoint,
    Stream,
    Window,
    delay_of,
)
from davinci_forces.filters.problem import FilterInput, filter_inputs
from davinci_forces.filters.response import noise_model
from davinci_forces.identification.joint_models import Identified
from davinci_forces.maths.mechanics.kinematics import jacobian
from davinci_forces.maths.models.memory import efforts
from davinci_forces.records import Choice, Contact, FilterNoise, Fit, JointModel, Motion, Track
from davinci_forces.records.catalogue import Catalogue
from davinci_forces.robots.davinci import ROBOT as DAVINCI
from davinci_forces.stages.forces import stream as stage
from tests import arm
from tests.exported import NOISE, ORIGIN, RATE, export, motion, motion_of

T_S = 0.02


@pytest.mark.parametrize("structure", ["independent", "coupled"])
def test_effort_and_inertia_are_those_of_the_model_with_every_term(structure):
    exported, moved = export(DAVINCI, structure), motion(3)
    document = exported.document()
    links = LinkTree(document["chain"], document["gravity"])
    for number, joint in enumerate(exported.joints):
        of_model = motion_of(joint, moved)
        row = joint.model.efforts.index(joint.name)
        tau = efforts(joint.model, joint.fit.theta, of_model)[:, row]
        [*dynamics] = joint.model.joint_dynamics(joint.fit.theta, of_model)
        about = document["joints"][number]
        tried = OnlineJoint(about, document["models"][about["model"]], document["coordinates"], links)
        stream = Stream(document)
        for k in range(len(moved.q)):
            if k and moved.segment[k] != moved.segment[k - 1]:
                tried.restart()
            q, dq, ddq = (x[k] for x in moved[:3])
            of_links, M = stream._links_effort(tried, q, dq, ddq)
            own = q[number], dq[number], ddq[number]
            tau_hat, *_ = tried.step((0.0, 0.0), own, 0.0, of_links, M)
            assert tau_hat == pytest.approx(tau[k], abs=1e-11 * np.abs(tau).max())
            M += sum(term.value * term.acceleration for term in tried.terms)
            assert pytest.approx(dynamics[row].inertia[k], rel=1e-11) == M


@pytest.mark.parametrize("structure", ["independent", "coupled"])
def test_a_joint_filtered_sample_by_sample_is_filtered_as_a_whole(structure):
    exported, moved = export(DAVINCI, structure), motion(3)
    document, N = exported.document(), int(np.flatnonzero(np.diff(moved.segment))[0]) + 1
    links, stream = LinkTree(document["chain"], document["gravity"]), Stream(document)
    for number, joint in enumerate(exported.joints):
        about, of_model = document["joints"][number], motion_of(joint, moved)
        tried = OnlineJoint(about, document["models"][about["model"]], document["coordinates"], links)
        row = joint.model.efforts.index(joint.name)
        tau = efforts(joint.model, joint.fit.theta, of_model)[:, row] + 0.3
        dynamics = joint.model.joint_dynamics(joint.fit.theta, of_model)[row]
        q, dq, ddq = (x[:, number] for x in moved[:3])
        part = FilterInput(dynamics, q, dq, ddq, tau, 1.0 / RATE, about["filter"]["initial_std"]).part(slice(0, N))
        expected, found = tracker("ekf")(part, NOISE).tau_ext, []
        for k in range(N):
            of_links, M = stream._links_effort(tried, *(x[k] for x in moved[:3]))
            found.append(tried.step((q[k], dq[k]), (q[k], dq[k], ddq[k]), tau[k], of_links, M)[1])
        assert_allclose(found, expected, atol=1e-9 * np.abs(tau).max())


def test_the_force_at_the_tip_balances_the_efforts():
    stream = Stream(export(DAVINCI, "coupled").document())
    q, force = np.array([0.2, -0.3, 0.12]), np.array([1.0, -2.0, 0.5])
    J, _ = jacobian(DAVINCI.chain, q)
    assert_allclose(stream.links.tip_jacobian(q), J, atol=1e-14)
    assert_allclose(stream._force(q, J.T @ force), force, rtol=1e-10)


@pytest.fixture(scope="module")
def small(lab, catalogue):
    return export_of(lab.study, catalogue, ORIGIN)


@pytest.fixture(scope="module")
def roll(lab, catalogue):
    """One joint, for what a stream does of all alike: its steps take a third of the time."""
    return export_of(lab.study, catalogue, ORIGIN, ["hand_roll"])


def samples_of(catalogue, log, names):
    motions = {m.joint: m for m in catalogue.select(Motion, log=log)}
    first = motions[names[0]]
    return first, [np.stack([getattr(motions[n], x) for n in names], 1) for x in ("q_measured", "tau", "dq_measured")]


def test_samples_one_by_one_give_what_the_study_measures_of_a_stream(lab, catalogue, small):
    """The stage filters arrays; a stream filters samples: from one moment on, both are the same numbers."""
    log = next(c.log for c in catalogue.records(Contact) if c.joint == "hand_roll")
    stream = Stream(export_of(lab.study, catalogue, ORIGIN, ["hand_roll"]).document())
    first, (q, tau, dq) = samples_of(catalogue, log, ["hand_roll"])
    logged = dq if first.velocity == "logged" else [None] * len(q)
    out = [stream.step(*sample) for sample in zip(first.t, q, tau, logged, strict=True)]
    identified = Identified(lab.study.robot, [*catalogue.records(Fit), *catalogue.records(Choice)])
    [model] = catalogue.select(JointModel, log=log, joint="hand_roll")
    along = stage.CausalModels(identified, catalogue.select(Motion, log=log))
    causal = along.with_fit(model, identified.fit_of("hand_roll", f"{model.model}.{model.estimator}"))
    [tuned] = catalogue.select(FilterNoise, joint="hand_roll")
    noise = noise_model(tuned, lab.study.robot.joint("hand_roll"), 1 / model.rate, lab.study.settings.q_tau)
    [part] = filter_inputs(causal)
    expected = tracker("ekf")(part, noise).tau_ext
    late = round(stream.delay * stream.rate)
    ours, later = np.array([e.tau_ext[0] for e in out])[late:], slice(500, len(q) - late)
    assert_allclose(ours[later], expected[later], atol=1e-3 * np.ptp(expected))
    assert_allclose([e.t for e in out[late:]], first.t[: len(q) - late], atol=1e-9)
    [streamed] = stage.compare(
        next(t for t in catalogue.select(Track, log=log, joint="hand_roll")), expected, None,
        next(e for e in lab.study.logs if e.name == log), stream.delay, tuned.delay,
    )  # fmt: skip
    assert streamed.stream_loss < 2.0


def test_the_ratio_of_peaks_is_the_median_of_long_contacts_with_its_standard_error(lab, catalogue):
    contact = next(c for c in catalogue.records(Contact) if c.joint == "hand_roll")
    [track] = catalogue.select(Track, log=contact.log, joint="hand_roll")
    onset, peaks = track.t[0] + np.array([1.0, 3.5, 6.0, 8.5]), (2.0, 2.2, 1.6, 9.0)
    last = np.array([2.0, 2.0, 2.0, 0.1])  # the last contact is too short to count
    columns = dict.fromkeys(Contact.columns(), np.ones(4))
    found = replace(
        contact, **columns | {"onset": onset, "release": onset + last, "duration": last, "peak": columns["peak"] * 2}
    )
    tau_ext = np.zeros(len(track))
    for start, duration, peak in zip(onset, last, peaks, strict=True):
        tau_ext[(track.t >= start) & (track.t <= start + duration)] = peak
    about = next(e for e in lab.study.logs if e.name == contact.log)
    [streamed] = stage.compare(track, tau_ext, found, about, 0.1, 0.1)
    ratios = np.array(peaks[:3]) / 2.0
    assert streamed.peak_ratio == pytest.approx(1.0)
    assert streamed.peak_ratio_std == pytest.approx(np.sqrt(np.pi / 2.0) * ratios.std(ddof=1) / np.sqrt(3.0), rel=1e-4)
    assert_allclose(streamed.peak, peaks)


def test_bad_samples_leave_everything_as_it_was(small):
    stream, other = Stream(small.document()), Stream(small.document())
    n = len(stream.coordinates)
    random = np.random.default_rng(0)
    for k in range(200):
        q, tau = 0.1 * np.sin(0.02 * k + np.arange(n)), random.normal(size=n)
        expected = other.step(k * T_S, q, tau)
        if k % 10 == 5:
            for t, bad_q, bad_tau in (
                (np.nan, q, tau), (np.inf, q, tau), ((k - 1) * T_S, q, tau), ((k - 2) * T_S, q, tau),
                (k * T_S, np.full(n, np.nan), tau), (k * T_S, q, np.full(n, np.inf)),
            ):  # fmt: skip
                assert stream.step(t, bad_q, bad_tau).status == (BAD_INPUT,) * len(stream.joints)
        assert_allclose(stream.step(k * T_S, q, tau).tau_ext, expected.tau_ext, rtol=0, atol=0)
    with pytest.raises(ValueError, match="one number for each of"):
        stream.step(3.0, np.zeros(n + 1), np.zeros(n))


def test_velocities_are_given_always_or_never(small):
    stream, zero = Stream(small.document()), np.zeros(len(small.joints))
    stream.step(0.0, zero, zero, zero)
    with pytest.raises(ValueError, match="give dq in every step or in none"):
        stream.step(T_S, zero, zero)
    stream.restart()
    stream.step(2 * T_S, zero, zero)


def test_after_a_restart_a_log_may_begin_again(small):
    stream = Stream(small.document())
    n, runs = len(stream.coordinates), []
    for _ in range(2):
        stream.restart()
        runs.append([stream.step(k * T_S, np.full(n, 0.01 * k), np.ones(n)) for k in range(80)])
    first, again = runs
    assert [effort.status for effort in again] == [effort.status for effort in first]
    assert_allclose([effort.tau_ext for effort in again], [effort.tau_ext for effort in first])


def test_a_gap_starts_anew(small):
    stream, other = Stream(small.document()), Stream(small.document())
    n = len(stream.coordinates)
    for k in range(100):
        stream.step(k * T_S, np.full(n, 0.3), np.full(n, 5.0))
    for k in range(300):
        q, tau = 0.1 * np.sin(0.02 * k + np.arange(n)), np.cos(0.1 * k + np.arange(n))
        ours, theirs = (s.step(start + k * T_S, q, tau) for s, start in ((stream, 5.0), (other, 0.0)))
        assert ours.status == theirs.status
        assert_allclose(ours.tau_ext, theirs.tau_ext, rtol=0, atol=0)
    assert STARTING not in ours.status


@pytest.mark.parametrize("place", [0.0, 0.05, 0.0537])
def test_a_window_gives_a_cubic_and_its_derivatives_exactly(place):
    window, rate = Window.design(100.0, 17.0, place), 100.0
    t = np.arange(200) / rate
    c = np.array([0.3, -1.0, 2.0, 0.7])
    powers = [np.polynomial.Polynomial(c).deriv(d)(t - place) for d in range(3)]
    interior = slice(40, 160)
    for computed, exact in zip(
        (window.filter_signal(np.polynomial.Polynomial(c)(t), i) for i in range(3)), powers, strict=True
    ):
        assert_allclose(computed[interior], exact[interior], rtol=1e-7, atol=1e-9)


@pytest.mark.parametrize("velocity", ["logged", "derived"])
def test_the_motion_of_a_stream_is_that_of_a_cubic_by_what_was_measured(catalogue, velocity):
    motion = catalogue.records(Motion)[0]
    t = np.arange(300) / 100.0
    q, dq, ddq = t**3 - 2.0 * t, 3.0 * t**2 - 2.0, 6.0 * t
    zero = np.zeros(300, int)
    columns = {
        name: zero if x.dtype.kind == "i" else t
        for name in motion.columns()
        if (x := getattr(motion, name)) is not None
    }
    columns |= {"q_measured": q, "dq_measured": dq if velocity == "logged" else 7.0 + 0.0 * t}
    made = stage._motion(replace(motion, rate=100.0, velocity=velocity, effort_lag=0.0, **columns), 8.0, 0.0)
    inner = slice(50, -50)
    for found, true in zip(made[:3], (q, dq, ddq), strict=True):
        assert_allclose(found[inner, 0], true[inner], atol=1e-6)


@pytest.mark.parametrize("rate", [100.0, 200.0, 1000.0, 100_000.0])
def test_a_window_passes_half_at_the_cutoff(rate):
    half = online.half_width(rate, 17.0)
    gains = [
        online.weights(h, 0.0, rate)[0] @ np.cos(2 * np.pi * 17.0 / rate * np.arange(-h, h + 1))
        for h in (half - 1, half)
    ]
    assert gains[0] > 0.5 >= gains[1]
    assert delay_of([(rate, 17.0, 0.0)]) == pytest.approx(half / rate)
    assert delay_of([(rate, 17.0, 0.02)]) == pytest.approx(half / rate - 0.02)


def test_contacts_and_standstill_are_told(small):
    stream = Stream(small.document())
    n, filters = len(stream.coordinates), stream.filters
    rest = [sum(f.valid[0]) / 2.0 for f in filters]
    for k in range(400):
        estimate = stream.step(k * T_S, rest, np.zeros(n))
    still = [f.static for f in filters]
    moving = Stream(small.document())
    for joint in moving.filters:
        joint.static = 0.0
    for k in range(400):
        other = moving.step(k * T_S, rest, np.zeros(n))
    assert min(still) > 0.0
    np.testing.assert_allclose(estimate.std**2 - other.std**2, np.array(still) ** 2 / 3.0, rtol=1e-9)
    for k in range(400, 900):
        estimate = stream.step(k * T_S, rest, np.full(n, 50.0))
    assert (estimate.contact[[f.alarm is not None for f in filters]] == 1).all()
    assert estimate.status == (OK,) * len(filters)  # a push raises the effort, and the motion stays that of the study
    for k in range(900, 1000):
        estimate = stream.step(k * T_S, np.full(n, 40.0), np.zeros(n))
    assert estimate.status == (OUTSIDE_VALIDITY,) * len(filters)


def test_the_band_holds_a_push_that_the_filter_shows_late(small):
    """Triangles on joints at rest: the errors of the flanks are those of the lag, and much larger than the noise."""
    stream, n = Stream(small.document()), len(small.joints)
    rest = [sum(f.valid[0]) / 2.0 for f in stream.filters]
    t = np.arange(1200) * T_S
    push = 20.0 * np.clip(1.0 - np.abs((t - 6.0) % 4.0 - 2.0), 0.0, None)
    for joint in stream.filters:
        joint.static = 0.0
    out = [stream.step(*sample) for sample in zip(t, [rest] * len(t), push[:, None] * np.ones(n), strict=True)]
    steady = slice(400, None)
    at = np.interp([e.t for e in out[steady]], t, push)
    rest_of = np.array([e.tau_ext for e in out[steady]]) - out[350].tau_ext - at[:, None]
    std = np.array([e.std for e in out[steady]])
    plain = std.min(axis=0)
    assert (np.abs(rest_of) < 1.96 * plain).mean() < 0.6
    assert (np.abs(rest_of) < 1.96 * std).mean() > 0.85


def test_no_contact_is_told_before_the_filter_has_settled(small):
    stream, n = Stream(small.document()), len(small.joints)
    rest = [sum(f.valid[0]) / 2.0 for f in stream.filters]
    out = [stream.step(k * T_S, rest, np.full(n, 50.0)) for k in range(200)]
    first = next(k for k, e in enumerate(out) if np.isfinite(e.tau_ext).all())
    assert {e.status for e in out[: first + round(1.0 / T_S)]} == {(STARTING,) * n}
    assert all((e.contact == -1).all() for e in out[: first + round(1.0 / T_S)])
    assert STARTING not in out[first + round(1.0 / T_S) + 1].status


def test_the_package_for_ros_is_the_same_core(small, tmp_path):
    """Without ROS, its core is imported beside the model, with numpy alone, and gives the same numbers."""
    files = renderer("ros2")(small).files
    for name, text in files.items():
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / name).write_text(text)
        if name.endswith(".py"):
            compile(text, name, "exec")
    assert {"package.xml", "setup.py", "setup.cfg", "davinci_forces_stream/node.py"} <= set(files)
    script = """
import json, math, sys
sys.modules["davinci_forces"] = None  # not there
from davinci_forces_stream.online import Stream
stream = Stream(json.load(open("davinci_forces_stream/model.json")))
n = len(stream.coordinates)
for k in range(200):
    e = stream.step(0.02 * k, [0.1 * math.sin(0.02 * k)] * n, [math.cos(0.1 * k)] * n)
assert not {m.partition(".")[0] for m in sys.modules} & {"scipy", "numba", "pandas"}
print(json.dumps([e.tau_ext.tolist(), e.std.tolist()]))
"""
    done = subprocess.run(
        [sys.executable, "-I", "-c", f"import sys; sys.path.insert(0, '.')\n{script}"], cwd=tmp_path,
        capture_output=True, text=True,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    stream = Stream(small.document())
    n = len(stream.coordinates)
    for k in range(200):
        e = stream.step(0.02 * k, [0.1 * np.sin(0.02 * k)] * n, [np.cos(0.1 * k)] * n)
    assert_allclose(json.loads(done.stdout), [e.tau_ext, e.std], rtol=1e-9)


def test_joints_of_several_rates_or_without_a_filter_are_refused(small):
    document = small.document()
    document["joints"][0]["filter"] = {**document["joints"][0]["filter"], "rate": 77.0}
    with pytest.raises(ValueError, match=r"have several rates \(50, 77 Hz\); export the model again"):
        Stream(document)
    document["joints"][1]["filter"] = None
    with pytest.raises(ValueError, match="the filter noise of hand_pitch; leave that joint out"):
        Stream(document)


def test_logs_of_several_rates_give_filters_of_the_lowest(lab, catalogue):
    """A controller samples all joints at one rate; a filter runs at any, with the noise that was tuned."""
    noises = [replace(n, rate=2 * n.rate) if n.joint == "hand_roll" else n for n in catalogue.records(FilterNoise)]
    mixed = Catalogue(lambda kind: noises if kind is FilterNoise else catalogue.records(kind))
    several = export_of(lab.study, mixed, ORIGIN)
    assert several.document() == export_of(lab.study, catalogue, ORIGIN).document()
    assert Stream(several.document()).rate == pytest.approx(1.0 / T_S)


@pytest.mark.parametrize("faster", [10.0, 2.0, 1.04, 0.96, 0.6, 0.5, 0.1])
def test_samples_at_another_rate_warn_and_give_no_number(roll, faster):
    stream = Stream(roll.document())
    rest = np.zeros(len(stream.coordinates))
    times = np.arange(300) * T_S / faster
    message = rf"samples come at {faster / T_S:.4g} Hz, the filter takes 50 Hz; resample .* or identify"
    with pytest.warns(UserWarning, match=message) as warned:
        estimates = [stream.step(t, rest, rest) for t in times]
    assert len(warned) == 1
    assert {e.status[0] for e in estimates[200:]} == {OTHER_RATE}
    assert np.isnan([estimates[-1].tau_ext, estimates[-1].std]).all()
    later = [stream.step(t, rest, rest) for t in times[-1] + T_S * np.arange(1, 900)]
    assert list(dict.fromkeys(e.status[0] for e in later))[:2] == [OTHER_RATE, STARTING]
    assert np.isfinite(later[-1].tau_ext).all()


def test_jitter_and_single_gaps_are_no_other_rate(roll):
    random, k = np.random.default_rng(0), np.arange(2000)
    for times in (k + random.uniform(-0.2, 0.2, len(k)), k[k % 10 > 0], k + 50 * (k // 20), 1.01 * k):
        stream = Stream(roll.document())
        rest = np.zeros(len(stream.coordinates))
        assert OTHER_RATE not in {stream.step(t * T_S, rest, rest).status[0] for t in times}


def test_a_motion_that_is_later_than_the_effort_by_its_lag_needs_that_much_less_of_a_delay():
    recorded = arm.motion(arm.signal(periods=1, noise=0.0))
    late, plain = (stage._motion(replace(recorded, effort_lag=by), 17.0, lag) for by, lag in ((0.03, 0.1), (0.0, 0.07)))
    for name in ("q", "dq", "ddq"):
        assert_allclose(getattr(late, name), getattr(plain, name), atol=1e-12)
    assert np.abs(stage._motion(recorded, 17.0, 0.1).ddq - plain.ddq).max() > 1e-9
