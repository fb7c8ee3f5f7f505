"""The model in C gives the numbers of the model in Python, and refuses what it must not use."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose

from davinci_forces.exports import renderer
from davinci_forces.filters import tracker
from davinci_forces.filters.problem import FilterInput
from davinci_forces.maths.models.memory import efforts
from davinci_forces.robots.davinci import ROBOT as DAVINCI
from davinci_forces.robots.dvrk_psm import ROBOT as PSM
from tests.compiled_model import BAD, OK, OTHER_RATE, OUTSIDE, CompiledModel
from tests.exported import NOISE, RATE, export, motion, motion_of

ROBOTS = {"davinci": DAVINCI, "psm": PSM, "tilted": DAVINCI.with_base((0.3, -0.7, 0.2))}


@pytest.fixture(
    scope="module", params=[(name, kind) for name in ROBOTS for kind in ("independent", "coupled")], ids="-".join
)
def model(request, tmp_path_factory):
    given = export(ROBOTS[request.param[0]], request.param[1])
    return given, CompiledModel(renderer("c")(given).files, tmp_path_factory.mktemp("c"))


def test_a_whole_log_gives_the_numbers_of_the_model_and_of_the_filter(model):
    given, compiled = model
    moved, random = motion(len(given.joints)), np.random.default_rng(1)
    N, halves = len(moved.q), np.flatnonzero(np.diff(moved.segment)) + 1
    t, lags = np.arange(N) / RATE + 0.5 * (moved.segment > 0), []
    for i, joint in enumerate(given.joints):
        of_joint, row = motion_of(joint, moved), joint.model.efforts.index(joint.name)
        tau_hat = efforts(joint.model, joint.fit.theta, of_joint)[:, row]
        q, dq = (x[:, i] + s * random.normal(size=N) for x, s in ((moved.q, 1e-4), (moved.dq, 1e-3)))
        tau = tau_hat + 0.1 * random.normal(size=N) + (t > 2.0)
        dynamics = joint.model.joint_dynamics(joint.fit.theta, of_joint)[row]
        whole = FilterInput(dynamics, q, dq, moved.ddq[:, i], tau, 1.0 / RATE, 0.7)
        parts = [whole.part(slice(0, halves[0])), whole.part(slice(halves[0], N))]
        expected = np.concatenate(
            [[x.tau_ext, x.tau_ext_std] for x in (tracker("ekf")(part, NOISE) for part in parts)], axis=1
        )
        compiled.restart()
        rows = []
        for k in range(N):
            status = compiled.step(i, t[k], tau[k], q[k], dq[k], moved.q[k], moved.dq[k], moved.ddq[k])
            assert status in (OK, OUTSIDE)
            r = compiled.result
            rows.append((r.tau_hat, r.tau_ext, r.std_filter, r.std, r.contact))
        hat, tau_ext, std_filter, std, contact = np.array(rows).T
        assert_allclose(hat, tau_hat, rtol=0, atol=1e-12 * np.abs(tau_hat).max())
        assert_allclose(tau_ext, expected[0], rtol=0, atol=1e-12 * np.abs(tau).max())
        assert_allclose(std_filter, expected[1], rtol=1e-12)
        band, speed = joint.filter["band"], np.searchsorted([0.1, 0.3, 0.6], np.abs(moved.dq[:, i]))
        total = np.array(band["factor"])[speed] * np.sqrt(std_filter**2 + band["model_variance"])
        total, late = np.maximum(std_filter, total), np.empty(N)
        for part in (slice(0, halves[0]), slice(halves[0], N)):
            late[part] = smooth(tau_ext[part], 1.0 / (RATE * joint.filter["lag"]))
        lag = np.maximum(np.abs(tau_ext - late) - total, 0.0)
        assert_allclose(std, np.hypot(total, lag), rtol=1e-9)
        lags.append(float(lag.max()))
        since = np.where(np.arange(N) < halves[0], np.arange(N), np.arange(N) - halves[0]) + 1
        assert (contact == np.where(since / RATE > 1.0, np.abs(tau_ext) > 0.02, -1)).all()
        assert (contact == 1).any()
    assert max(lags) > 0.0 or len(given.fits) < len(given.joints)  # at the step; a coupled filter is too slow for it


def smooth(x: np.ndarray, share: float) -> np.ndarray:
    """A first-order low-pass (N,), which takes this share of what is left at each sample."""
    late = [x[0]]
    for value in x[1:]:
        late.append(late[-1] + share * (value - late[-1]))
    return np.array(late)


@pytest.mark.parametrize("structure", ["independent", "coupled"])
def test_floats_give_four_digits_over_a_whole_log(structure, tmp_path):
    given = export(DAVINCI, structure)
    (tmp_path / "floats").mkdir()
    exact = CompiledModel(renderer("c")(given).files, tmp_path)
    floats = CompiledModel(renderer("c")(given).files, tmp_path / "floats", floats=True)
    moved, random = motion(len(given.joints)), np.random.default_rng(1)
    t = np.arange(len(moved.q)) / RATE + 0.5 * (moved.segment > 0)
    for i, joint in enumerate(given.joints):
        row = joint.model.efforts.index(joint.name)
        tau = efforts(joint.model, joint.fit.theta, motion_of(joint, moved))[:, row] + (t > 2.0)
        noise = random.normal(size=(2, len(t)))
        results = []
        for compiled in (exact, floats):
            compiled.restart()
            rows = []
            for k in range(len(t)):
                q, dq = moved.q[k, i] + 1e-4 * noise[0, k], moved.dq[k, i] + 1e-3 * noise[1, k]
                assert compiled.step(i, t[k], tau[k], q, dq, moved.q[k], moved.dq[k], moved.ddq[k]) != BAD
                r = compiled.result
                rows.append((r.tau_hat, r.tau_ext, r.std))
            results.append(np.array(rows))
        size = np.abs(tau).max()
        assert_allclose(results[1], results[0], rtol=0, atol=1e-4 * size)
        assert not np.array_equal(*results)


def test_inertia_bias_and_gravity_are_those_of_the_model(model):
    given, compiled = model
    moved, N = motion(len(given.joints), N=40), 40
    compiled.restart()
    for i, joint in enumerate(given.joints):
        row, theta = joint.model.efforts.index(joint.name), joint.fit.theta
        alone = motion_of(joint, moved._replace(segment=np.arange(N)))  # every sample begins anew
        still = alone._replace(dq=0 * alone.dq, ddq=0 * alone.ddq)
        unaccelerated = alone._replace(ddq=0 * alone.ddq)
        inertias = (joint.model.inertia_columns(alone.q) @ theta)[:, row, row]
        of_model = (efforts(joint.model, theta, x)[:, row] for x in (alone, still, unaccelerated))
        for k, (M, tau, G, b) in enumerate(zip(inertias, *of_model, strict=True)):
            q, dq, ddq = (x[k] for x in moved[:3])
            size = 1e-12 * max(abs(tau), abs(b), abs(M), 1.0)
            assert compiled.call("inertia", i, q)[1] == pytest.approx(M, abs=size)
            assert compiled.call("bias", i, q, dq, state=True)[1] == pytest.approx(b, abs=size)
            assert compiled.call("effort", i, q, dq, ddq, state=True)[1] == pytest.approx(tau, abs=size)
            assert compiled.call("gravity", i, q)[1] == pytest.approx(np.clip(G, -60.0, 60.0), abs=size)


def test_friction_for_compensation_is_less_than_the_model_s_and_never_drives(model):
    given, compiled = model
    moved, lower = motion(len(given.joints)), 0
    for i, joint in enumerate(given.joints):
        compiled.restart()
        zero = np.zeros(len(given.joints))
        for k in range(0, len(moved.q), 7):
            compiled.step(i, k / RATE, 0.0, moved.q[k, i], moved.dq[k, i], *(x[k] for x in moved[:3]))
            q, dq = moved.q[k], moved.dq[k]
            friction = compiled.call("bias", i, q, dq, state=True)[1] - compiled.call("gravity", i, q)[1]
            compensation = compiled.call("friction", i, q, dq, state=True)[1]
            assert compensation * dq[i] >= 0.0
            if joint.fit.structure == "independent":  # else the bias has Coriolis efforts, too
                least = max(np.sign(dq[i]) * friction, 0.0)
                assert abs(compensation) <= 0.9 * least + 1e-12
                lower += abs(compensation) > 0.0
        assert compiled.call("friction", i, q, zero, state=True) == (OK, 0.0)
    assert lower or given.joints[0].fit.structure == "coupled"


def test_gravity_and_friction_are_limited_to_the_largest_effort_recorded(tmp_path):
    given = export(DAVINCI, "independent")
    small = {**given.joints[0].validity, "effort": [-0.02, 0.01]}
    tiny = replace(given, joints=tuple(j._replace(validity=small) for j in given.joints))
    compiled = CompiledModel(renderer("c")(tiny).files, tmp_path)
    for q in (0.5, -1.5):
        assert abs(compiled.call("gravity", 0, (q, 0, 0))[1]) == 0.02
    assert compiled.call("friction", 0, (0.5, 0, 0), (1.0, 0, 0), state=True)[1] == 0.02
    assert compiled.call("friction", 0, (-1.5, 0, 0), (-1.0, 0, 0), state=True)[1] == 0.0  # the model's would drive


def test_bad_input_changes_nothing_and_a_gap_restarts(model):
    given, compiled = model
    zero = [0.0] * len(given.joints)
    good = (0.0, 0.1, 0.2, zero, zero, zero)
    compiled.restart()
    assert compiled.step(0, 0.00, *good) == OK
    assert compiled.step(0, 0.01, *good) == OK
    before, result = bytes(compiled.state), bytes(compiled.result)
    bad = [(t, *good) for t in (0.01, 0.0, np.nan, np.inf)]
    for place in (1, 2, 3):
        bad += [(0.02, *(wrong if place == k else x for k, x in enumerate(good, 1))) for wrong in (np.nan, -np.inf)]
    bad += [(0.02, *good[:3], *([np.nan, 0, 0] if k == j else zero for k in range(3))) for j in range(3)]
    for sample in bad:
        assert compiled.step(0, *sample) == BAD, sample
        assert (bytes(compiled.state), bytes(compiled.result)) == (before, result)
    for joint in (-1, len(given.joints)):
        assert compiled.step(joint, 0.02, *good) == BAD
        assert compiled.call("gravity", joint, zero)[0] == BAD
    assert compiled.step(0, 0.02, *good) == OK
    fast = [[9.5, 0, 0] if k == 1 else zero for k in range(3)]
    assert compiled.step(0, 0.03, *good[:3], *fast) == OUTSIDE
    assert compiled.step(0, 0.04, 61.0, *good[1:]) == OK  # a push raises the effort beyond that of free motion
    uncertain = compiled.result.std_filter
    assert compiled.step(0, 0.10, *good) == OK
    assert compiled.result.std_filter == pytest.approx(0.7) != uncertain
    assert np.isnan(compiled.call("gravity", 0, [np.nan, 0, 0])[1])


@pytest.fixture(scope="module")
def plain(tmp_path_factory):
    given = export(DAVINCI, "independent")
    return CompiledModel(renderer("c")(given).files, tmp_path_factory.mktemp("plain"))


def steps(compiled, times):
    zero = [0.0] * 3
    return [compiled.step(0, t, 0.1, 0.2, 0.0, [0.2, 0.0, 0.0], zero, zero) for t in times]


@pytest.mark.parametrize("faster", [10.0, 2.0, 1.04, 0.96, 0.6, 0.5, 0.1])
def test_samples_at_another_rate_give_no_number_until_the_rate_is_that_of_the_filter(plain, faster):
    plain.restart()
    times = np.arange(300) / (faster * RATE)
    statuses = steps(plain, times)
    assert statuses[0] == OK
    assert set(statuses[200:]) == {OTHER_RATE}
    r = plain.result
    assert np.isnan([r.tau_hat, r.tau_ext, r.std_filter, r.std]).all()
    assert r.contact == -1
    for t in times[-1] + np.arange(1, 900) / RATE:
        if steps(plain, [t]) == [OK]:
            break
    assert np.isfinite([r.tau_hat, r.tau_ext, r.std]).all()
    assert r.std_filter == pytest.approx(0.7)  # it begins anew


def test_jitter_and_single_gaps_are_no_other_rate(plain):
    random, k = np.random.default_rng(0), np.arange(2000)
    for times in (k + random.uniform(-0.2, 0.2, len(k)), k[k % 10 > 0], k + 50 * (k // 20), 1.01 * k):
        plain.restart()
        assert set(steps(plain, times / RATE)) == {OK}


def test_the_header_states_the_rate_and_the_period():
    header = renderer("c")(export(DAVINCI, "independent")).files["model.h"]
    assert "#define DF_RATE 100.0" in header
    assert "#define DF_PERIOD 0.01" in header
    assert "low-pass at 17 Hz" in header


def test_the_header_states_what_an_ampere_counts_where_currents_were_measured():
    header = renderer("c")(export(DAVINCI, "independent")).files["model.h"]
    assert "hand_roll: 1 A of its motor counts as 8.76 N m" in header  # 200 * 0.0438
    assert "hand_pitch: 1 A" not in header
