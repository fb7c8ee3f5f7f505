"""Masses from external efforts: the regression, the path that a tare shares, and the stages on a simulated arm."""

import sys
from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.special import chdtri

from davinci_forces.identification import loads
from davinci_forces.maths.contact.weighing import (
    MIN_AGREEMENT,
    PARTS,
    MassEstimate,
    Rows,
    agreement,
    better,
    error_between,
    fit_mass,
    offset,
    pooled_std,
    scaled_constant,
    spread_between,
    unit_load,
    widening_factor,
)
from davinci_forces.maths.periods.shift import circular, roll, straight
from davinci_forces.records import (
    Diagnostic,
    FreeWeight,
    JointModel,
    Load,
    Motion,
    Signal,
    TorqueConstant,
    Weight,
    store,
)
from davinci_forces.records.catalogue import Catalogue
from davinci_forces.report.context import Context
from davinci_forces.report.results import collect
from davinci_forces.report.sections import weight as weight_section
from davinci_forces.robots import dvrk_psm
from davinci_forces.runner import execution
from davinci_forces.runner.fingerprint import Fingerprint
from davinci_forces.runner.ledger import Folders
from davinci_forces.runner.plan import Task
from davinci_forces.stages import weigh
from davinci_forces.study import AttachedMass, Source, Weighing, Weighings
from tests import arm
from tests.arm import ARM
from tests.test_averaging import entry

RATE, PERIOD, PERIODS = 100.0, 5.0, 6
T = np.arange(round(PERIODS * PERIOD * RATE)) / RATE
ROBOT, MASS = dvrk_psm.ROBOT, 0.205
JOINTS = ("hand_roll", "hand_pitch", "instrument_slide")
HUNG = AttachedMass("hand_pitch", (0.0, -0.1, 0.5), MASS)


def remembered(function):
    """The function, which computes once for the same numbers; chains and other objects are told by what they are."""
    known = {}

    def told(x):
        if isinstance(x, np.ndarray):
            return x.shape, x.tobytes()
        return tuple(map(told, x)) if isinstance(x, list | tuple) else x if isinstance(x, float | int | str) else id(x)

    def once(*given):
        key = told(given)
        if key not in known:
            known[key] = given, function(*given)  # with what was given, whose place nothing else takes
        return known[key][1]

    return once


@pytest.fixture(scope="module", autouse=True)
def _motions_once():
    """Periods, derivatives and loads of each motion are found once: studies of seeds differ in their efforts alone."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(loads, "repetition", remembered(loads.repetition))
        patch.setattr(arm, "measured_motion", remembered(arm.measured_motion))
        for module in (loads.weighing, sys.modules[__name__]):
            patch.setattr(module, "unit_load", remembered(unit_load))
        yield


def rows(x, y, sigma=1.0) -> Rows:
    return Rows(x, y, np.arange(len(x)) * PARTS // len(x), sigma)


# The regression


def test_the_mass_of_several_joints_is_that_of_weighted_least_squares_with_an_offset_each():
    rng = np.random.default_rng(0)
    x, y = rng.normal(size=(2, 60)), rng.normal(size=(2, 60))
    sigma = (0.5, 2.0)
    A = np.zeros((120, 3))
    A[:60, 0], A[60:, 0], A[:60, 1], A[60:, 2] = x[0], x[1], 1.0, 1.0
    w = np.repeat(1 / np.array(sigma), 60)
    want = np.linalg.lstsq(A * w[:, None], y.ravel() * w, rcond=None)[0]
    each = [rows(x[j], y[j], sigma[j]) for j in range(2)]
    found = fit_mass(each).mass
    assert_allclose([found, *(offset(row, found) for row in each)], want, rtol=1e-10)


def test_a_column_that_hardly_varies_is_given_no_offset():
    x = -9.81 + 0.1 * np.sin(T)
    assert fit_mass([rows(x, 0.1 * x)]).mass == pytest.approx(0.1)
    assert offset(rows(x, 0.1 * x + 0.5), 0.1) == 0.0


def test_intervals_hold_the_mass_where_what_the_model_leaves_is_as_slow_as_a_part_of_the_path():
    """Errors correlated over 0.1 of a path: an interval of six parts holds the truth about as often as t says."""
    x, held, draws = np.sin(2 * np.pi * np.arange(600) / 600), 0, 400
    kernel = np.ones(60) / np.sqrt(60)
    for seed in range(draws):
        e = np.convolve(np.random.default_rng(seed).normal(size=659), kernel, mode="valid")
        found = fit_mass([rows(x, 0.2 * x + 0.1 * e)])
        held += abs(found.mass - 0.2) < 2.57 * found.std  # of Student's t with 5 degrees of freedom
    assert 0.90 < held / draws < 0.99


def test_noise_slower_than_a_part_of_the_path_is_in_the_error_between_periods():
    """Noise correlated over half a path, on a load that hardly varies: the jackknife alone holds far too few."""
    rng, x, K, n = np.random.default_rng(3), np.full(60, 9.81), 60, 5
    kernel, off, of_path = np.ones(K // 2) / np.sqrt(K // 2), [], []
    for _ in range(300):
        runs = []
        for _ in range(3):  # whose spreads are pooled
            noise = np.convolve(rng.normal(size=n * K + K // 2 - 1), kernel, mode="valid")
            runs.append([rows(x, 0.2 * x + noise[p * K : (p + 1) * K]) for p in range(n)])
        path = fit_mass([rows(x, np.mean([period.y for period in runs[0]], axis=0))])
        std = error_between([(n, spread_between(run)) for run in runs], n)
        off.append((path.mass - 0.2) / max(std, path.std))
        of_path.append((path.mass - 0.2) / path.std)
    assert 0.93 < np.mean(np.abs(off) < 1.96) < 0.985
    assert np.mean(np.abs(of_path) < 1.96) < 0.85


def test_few_periods_tell_no_spread():
    x = np.sin(2 * np.pi * np.arange(60) / 60)
    assert spread_between([rows(x, x)]) == 0.0
    assert error_between([(1, 0.0), (0, 0.0)], 1) == 0.0
    two = [rows(x, x), rows(x, 3.0 * x)]
    assert spread_between(two) == pytest.approx(np.sqrt(2.0))
    assert error_between([(2, 3.0), (2, 3.0)], 2) == 0.0
    assert error_between([(2, 3.0), (1, 0.0), (3, 0.0)], 4) == pytest.approx(
        np.sqrt(9 / 3 / 4) * 3.182 / 1.96, rel=1e-3
    )


def test_masses_of_free_motion_that_exceed_their_errors_widen_them_and_others_do_not_narrow_them():
    assert widening_factor([MassEstimate(0.03, 0.01), MassEstimate(0.03, 0.01)], 0.0) == pytest.approx(3.0)
    assert widening_factor([MassEstimate(0.03, 0.01)], 0.02) == pytest.approx(3.0 / np.sqrt(5.0))
    assert widening_factor([MassEstimate(0.001, 0.01)], 0.0) == 1.0
    assert widening_factor([], 0.01) == 1.0


def test_the_column_that_made_the_effort_explains_it_better():
    rng = np.random.default_rng(1)
    x, other = np.sin(6 * np.arange(600) / 100), np.cos(6 * np.arange(600) / 100)
    y = x + 0.1 * rng.normal(size=600)
    assert better([rows(x, y)], [rows(other, y)]) > 4
    assert better([rows(other, y)], [rows(x, y)]) < -4
    assert better([rows(x * (1 + 1e-7 * x), y)], [rows(x, y)]) == 0.0  # the same column but for rounding


# The path that a tare shares


def test_a_period_is_found_wherever_the_other_recording_began():
    phase = np.arange(500) / 500
    q = np.stack([np.sin(2 * np.pi * phase), np.cos(4 * np.pi * phase + 0.3)], axis=1)
    other = roll(q, -123.4)
    samples, apart = circular(q, other)
    assert samples % 500 == pytest.approx(123.4, abs=0.05)
    assert_allclose(roll(other, samples), q, atol=1e-3)
    assert apart.max() < 1e-3


@pytest.mark.parametrize("lag", [-70, 0, 70])
def test_a_motion_that_does_not_repeat_is_found_in_another_recording(lag):
    long = np.cumsum(np.random.default_rng(2).normal(size=(900, 2)), axis=0)
    q, other = long[100:800], long[100 - lag : 800 - lag]
    samples, apart = straight(q, other)
    assert samples == lag
    assert_allclose(apart, 0.0, atol=1e-9)


def test_another_path_is_far_apart_at_best():
    phase = 2 * np.pi * np.arange(500)[:, None] / 500
    assert circular(np.sin(phase), np.sin(2 * phase))[1].max() > 1


# The stages, on a simulated arm whose model errs along its path


def motion(path=0.0, t=T):
    """Position, velocity and acceleration (N, 3) of a path."""
    w = 2 * np.pi / PERIOD
    size, k = np.array([0.5, 0.4, 0.04]), np.array([1, 2, 3])
    angle = np.multiply.outer(w * t, k) + path
    return size * np.sin(angle), size * w * k * np.cos(angle), -size * (w * k) ** 2 * np.sin(angle)


def left_by_the_model(t, seed):
    """What a model errs by (N, 3), which repeats with the path, of the size of a real one; and noise."""
    rng = np.random.default_rng(seed)
    a, b = rng.normal(size=(2, 12, 3))
    slow = sum(a[k] * np.cos((k + 1) * 2 * np.pi / PERIOD * t[:, None] + 3 * b[k]) for k in range(12)) / np.sqrt(6)
    return np.array([0.05, 0.1, 0.1]) * slow + 0.05 * np.random.default_rng(len(t)).normal(size=slow.shape)


def log(name, role, seed, hung=None, path=0.0, day=0.0, t=T, false=0.0, drift=0.0):
    """Models and motions of one log; `hung` says what truly hangs, `false` the mass that roll alone shows more.

    `drift` is the size of noise that is correlated over a quarter of the period.
    """
    q, dq, ddq = motion(path, t)
    tau = left_by_the_model(t, seed) + day
    if drift:
        width = round(0.25 * PERIOD * RATE)
        white = np.random.default_rng([seed, *name.encode()]).normal(size=(len(t) + width - 1, 3)) / np.sqrt(width)
        tau += drift * np.stack([np.convolve(x, np.ones(width), mode="valid") for x in white.T], axis=1)
    tau[:, 0] += false * unit_load(ROBOT.chain, "end_link", HUNG.position, q, dq, ddq)[:, 0]
    if hung is not None:
        tau = tau + MASS * unit_load(ROBOT.chain, "end_link", hung, q, dq, ddq)
    segment = np.zeros(len(t), int)
    motions = [
        arm.motion(Signal(name, joint, role, RATE, "as recorded", "logged", 0, 0, t=t, q=q[:, i], dq=dq[:, i],
                          tau=tau[:, i], segment=segment, filled=segment)) for i, joint in enumerate(JOINTS)
    ]  # fmt: skip
    return [described(one) for one in motions], motions


def described(one):
    """A model that predicts no effort, refits or not."""
    scalars = dict.fromkeys(JointModel.scalars(), 0.0) | {"model": "m", "estimator": "e", "scheme": "s", "path": "p"}
    columns = dict.fromkeys(JointModel.columns(), np.zeros(len(one)))
    names = (*Motion.scalars(), *Motion.columns())
    kept = {name: getattr(one, name) for name in names if name in scalars or name in columns}
    return JointModel(**(scalars | columns | kept))


def analysed(logs, weighing, robot=ROBOT):
    """What both stages make of logs: by kind."""
    made, texts = weighed(logs, weighing, robot)
    weights = [record for record in made if isinstance(record, Weight)]
    free = {record.log: record for record in made if isinstance(record, FreeWeight)}
    return (weights[0] if weights else None), free, texts


def weighed(logs, weighing, robot=ROBOT, channels=()):
    """All records that both stages make of logs, and the texts of their diagnostics."""
    about = Weighings((weighing,))
    loads, said = [], []
    for models, motions in logs:
        first, weight = motions[0], weighing.weight if motions[0].log == weighing.log else None
        its = entry(name=first.log, role=first.role, weight=weight, channels=channels)
        for record in weigh.run(models, motions, its, robot, about, lowpass=17.0):
            (loads if isinstance(record, Load) else said).append(record)
    made = list(weigh.gather(loads, robot, about))
    return made, [text for d in (*said, *made) if isinstance(d, Diagnostic) for text in d.text]


@cache
def study(seed, tare="", position=HUNG.position, tare_path=0.0):
    """A fit's log, a free log on another path, a weight log, and a run without the mass."""
    logs = [
        log("fitted", "identification", 100 + seed),
        log("other", "validation", 200 + seed, path=0.8),
        log("empty", "validation", 300 + seed, path=tare_path, t=T[: len(T) - 137] + 1.37),
        log("heavy", "weight", 300 + seed, HUNG.position),
    ]
    return analysed(logs, Weighing("heavy", replace(HUNG, position=position), tare))


@pytest.mark.slow
def test_a_hung_mass_is_found_within_its_interval():
    off = []
    for seed in range(30):
        weight, _, _ = study(seed)
        off.append((weight.mass - MASS) / weight.mass_std)
        assert list(weight.loaded) == ["hand_roll", "hand_pitch"]  # the slide carries none of it
        assert weight.mass_scale == pytest.approx(weight.mass / MASS)
    assert np.mean(np.abs(off) < 1.96) >= 0.85  # 30 draws of 95 % fall below 25 once in thousands
    assert np.std(off) > 0.4  # nor are intervals so wide that nothing could miss them


@pytest.mark.slow
def test_an_interval_holds_a_mass_whose_noise_is_slower_than_a_part_of_the_path():
    off = []
    for seed in range(30):
        logs = [
            log("fitted", "identification", 100 + seed, drift=0.2),
            log("other", "validation", 200 + seed, path=0.8, drift=0.2),
            log("empty", "validation", 300 + seed, drift=0.2),
            log("heavy", "weight", 300 + seed, HUNG.position, drift=0.2),
        ]
        weight, _, _ = analysed(logs, Weighing("heavy", HUNG, "empty"))
        off.append((weight.mass - MASS) / weight.mass_std)
    assert np.mean(np.abs(off) < 1.96) >= 0.85
    assert 0.4 < np.std(off) < 1.4


def test_friction_at_standstill_is_not_weighed():
    models, motions = log("heavy", "weight", 300, HUNG.position)
    held = (models[1].t > 5.0) & (models[1].t < 6.0)
    free = log("fitted", "identification", 100), log("other", "validation", 200, path=0.8)
    weights = []
    for friction in (0.0, 3.0):
        pitch = replace(models[1], tau=models[1].tau + friction * held, unscored=held.astype(int))
        logs = [*free, ([models[0], pitch, models[2]], motions)]
        weights.append(analysed(logs, Weighing("heavy", HUNG, ""))[0])
    assert weights[1].mass == pytest.approx(weights[0].mass, abs=0.2 * weights[0].mass_std)
    assert weights[1].mass_std < 1.2 * weights[0].mass_std


# Joints that agree, and joints that do not


def at_another_speed(seed, free):
    """A weight log at a speed at which roll loses half of the mass; with free motion at that speed or not."""
    logs = [
        log("fitted", "identification", 100 + seed),
        *([log("slow", "validation", 200 + seed, path=0.8, false=-0.5 * MASS)] if free else []),
        log("heavy", "weight", 300 + seed, HUNG.position, path=0.4, false=-0.5 * MASS),
    ]
    weight, _, said = analysed(logs, Weighing("heavy", HUNG, ""))
    return weight, " ".join(said)


def test_joints_that_tell_different_masses_are_named_and_widen_the_interval():
    for seed in range(20):
        weight, said = at_another_speed(seed, free=False)
        (roll, roll_std), (pitch, pitch_std) = zip(weight.mass_alone, weight.mass_alone_std, strict=True)
        assert weight.agreement < MIN_AGREEMENT
        assert weight.birge_ratio == pytest.approx(abs(roll - pitch) / np.hypot(roll_std, pitch_std))
        narrow = weight.widening * np.hypot(weight.run_std, weight.fit_std)
        assert weight.mass_std >= weight.birge_ratio * narrow * (1 - 1e-9)
        assert abs(weight.mass - MASS) < 1.96 * weight.mass_std
        assert abs(weight.mass - MASS) > 3 * narrow  # which it would have been sure of
        assert weight.differing in JOINTS
        assert f"tell different masses (hand_roll {roll:.3g} ± {roll_std:.2g} kg, hand_pitch" in said


def test_free_motion_at_another_speed_is_part_of_the_error_of_each_joint():
    for seed in range(8):
        alone, free = (at_another_speed(seed, free)[0] for free in (False, True))
        assert free.false_mass[0] == pytest.approx(0.5 * MASS / np.sqrt(2), rel=0.2)  # in one of two logs
        assert free.mass_alone_std[0] > free.false_mass[0] > 4 * alone.false_mass[0]
        assert (free.agreement > MIN_AGREEMENT, free.differing, free.birge_ratio) == (True, "", 1.0)
        assert abs(free.mass - MASS) < 1.96 * free.mass_std
        assert abs(free.mass - MASS) < 0.6 * abs(alone.mass - MASS)  # a joint counts less where it shows false masses


@pytest.mark.slow
def test_joints_with_the_same_errors_as_in_free_motion_do_not_contradict_each_other():
    weights = [study(seed)[0] for seed in range(40)]
    assert sum(weight.differing != "" for weight in weights) <= 2  # 1 % of 40, and a jackknife over six parts
    assert {weight.birge_ratio for weight in weights if not weight.differing} == {1.0}


def test_a_tare_takes_the_false_masses_away_that_repeat_along_its_path():
    assert_allclose(study(3, tare="empty")[0].false_mass, 0.0)


def test_masses_that_agree_have_a_fair_probability():
    rng = np.random.default_rng(5)
    std = np.array([0.01, 0.02, 0.05])
    draws = [agreement([MassEstimate(0.1 + s * rng.normal(), s) for s in std]) for _ in range(4000)]
    p = np.array([draw.probability for draw in draws])
    assert np.mean(p < 0.5) == pytest.approx(0.5, abs=0.03)
    assert np.mean(p < MIN_AGREEMENT) == pytest.approx(MIN_AGREEMENT, abs=0.006)
    assert {draw.ratio for draw in draws if draw.probability >= MIN_AGREEMENT} == {1.0}
    worst = agreement([MassEstimate(0.105, 0.007), MassEstimate(0.058, 0.007), MassEstimate(0.11, 0.01)])
    assert (worst.differing, worst.probability < 1e-4, worst.ratio > 2.0) == (1, True, True)
    assert agreement([MassEstimate(0.1, 0.01)]) == (1.0, 1.0, 0)  # one joint contradicts nobody


@pytest.mark.slow
def test_a_run_of_free_motion_weighs_nothing_within_its_interval():
    free = [study(seed)[1] for seed in range(15)]
    off = [f.free_mass / f.free_mass_std for each in free for f in each.values()]
    assert np.mean(np.abs(off) < 1.96) >= 0.9
    assert {f.role for f in free[0].values()} == {"identification", "validation"}


def test_a_tare_takes_away_what_repeats_along_the_path_wherever_it_began():
    plain, tared = study(3)[0], study(3, tare="empty")[0]
    assert abs(tared.mass - MASS) < 0.2 * abs(plain.mass - MASS)
    assert abs(tared.mass - MASS) < 1.96 * tared.mass_std
    assert tared.mass_std < 0.5 * plain.mass_std
    assert tared.tare_mass == pytest.approx(plain.mass - tared.mass, abs=0.1 * plain.mass_std)
    assert (tared.tare, plain.tare, np.isnan(plain.tare_mass)) == ("empty", "", True)


def test_a_tare_of_another_path_is_not_subtracted_and_that_is_said():
    weight, _, said = study(3, tare="empty", tare_path=0.8)
    without_line, _, silent = study(3, tare_path=0.8)
    assert (weight.mass, weight.mass_std) == (without_line.mass, without_line.mass_std)
    assert not any("tare" in text for text in silent)
    assert any("record the tare along the same path, or delete that line" in text for text in said)
    assert weight.tare == ""
    assert np.isnan(weight.tare_mass)
    assert any("heavy: its tare empty is not on the same path: at best it is off by" in text for text in said)


def test_a_tare_that_is_not_subtracted_adds_no_error():
    logs = [
        log("fitted", "identification", 100, drift=0.2),
        log("empty", "validation", 300, path=0.8, drift=0.2),
        log("heavy", "weight", 300, HUNG.position, drift=0.2),
    ]
    refused, plain = (analysed(logs, Weighing("heavy", HUNG, tare))[0] for tare in ("empty", ""))
    assert refused.tare == ""
    assert refused.mass_std == plain.mass_std


def test_the_side_that_the_mass_does_not_hang_on_tells():
    """0.1 m to the side of a point half a metre up is seen; the mass of the other side is another one."""
    right, wrong = study(5), study(5, position=(0.0, 0.1, 0.5))
    assert right[0].side == "as stated"
    assert wrong[0].side == "the other one"
    assert wrong[0].mass_mirrored == pytest.approx(right[0].mass)
    assert right[0].mass_mirrored == pytest.approx(wrong[0].mass)


def test_a_side_that_no_effort_tells_is_called_so_in_the_words_that_the_report_knows():
    sides = ("as stated", "the other one")
    assert weigh.side_of(0.0, 1.0) not in sides
    assert weigh.side_of(-9.0, -0.06) not in sides  # no mass is negative
    assert (weigh.side_of(9.0, 1.0), weigh.side_of(-9.0, 1.0)) == sides


def test_an_offset_of_the_day_costs_no_mass():
    logs = [log("fitted", "identification", 1), log("heavy", "weight", 2, HUNG.position, day=0.3)]
    off, _, _ = analysed(logs, Weighing("heavy", HUNG, ""))
    logs[1] = log("heavy", "weight", 2, HUNG.position)
    still, _, _ = analysed(logs, Weighing("heavy", HUNG, ""))
    assert off.mass == pytest.approx(still.mass, abs=1e-9)
    assert_allclose(off.joint_offset - still.joint_offset, 0.3)


def test_a_mass_that_nobody_states_is_found_and_has_no_scale():
    logs = [log("fitted", "identification", 1), log("heavy", "weight", 2, HUNG.position)]
    weight, _, _ = analysed(logs, Weighing("heavy", replace(HUNG, mass=None), ""))
    assert weight.mass == pytest.approx(MASS, abs=3 * weight.mass_std)
    assert np.isnan(weight.mass_scale)


def test_what_the_joints_that_move_do_not_carry_is_said_and_not_weighed():
    logs = [tuple(part[2:] for part in log("heavy", "weight", 2, HUNG.position))]  # the slide alone
    weight, _, said = analysed(logs, Weighing("heavy", HUNG, ""))
    assert weight is None
    assert any("heavy: no moving joint carries the mass on hand_pitch" in text for text in said)


def in_current(*names):
    """The robot, with joints of whose effort only the current is known."""
    return replace(ROBOT, joints=tuple(replace(j, effort="A") if j.name in names else j for j in ROBOT.joints))


def test_a_joint_whose_effort_is_a_current_weighs_nothing_and_the_others_do():
    logs = [log("fitted", "identification", 1), log("heavy", "weight", 2, HUNG.position)]
    both, _, _ = analysed(logs, Weighing("heavy", HUNG, ""))
    weight, _, said = analysed(logs, Weighing("heavy", HUNG, ""), in_current("hand_roll"))
    assert (list(both.loaded), list(weight.loaded)) == (["hand_roll", "hand_pitch"], ["hand_pitch"])
    assert weight.mass == pytest.approx(both.mass_alone[1], rel=1e-9)
    assert [text for text in said if "heavy: the effort of hand_roll is a current, not a force" in text]


def test_where_all_efforts_are_currents_nothing_is_weighed_and_the_remedy_is_said():
    logs = [log("heavy", "weight", 2, HUNG.position)]
    unknown = Weighing("heavy", replace(HUNG, mass=None), "")
    weight, _, said = analysed(logs, unknown, in_current(*JOINTS))
    assert weight is None
    assert any("the mass are currents; no mass is estimated: state their torque_constant" in text for text in said)
    records, said = weighed(logs, Weighing("heavy", HUNG, ""), in_current(*JOINTS))
    roll, pitch = (f"{x.torque_constant:.4g} for {x.joint}" for x in records if isinstance(x, TorqueConstant))
    told = f"this known mass gives torque_constant = {roll} and torque_constant = {pitch}; write each"
    assert any(told in text for text in said)


def test_a_robot_without_geometry_weighs_nothing_and_says_why():
    logs = [log("heavy", "weight", 2, HUNG.position)]
    weight, _, said = analysed(logs, Weighing("heavy", HUNG, ""), ARM)
    assert weight is None
    assert "heavy: arm has no chain, so the joint effort of a mass is not known; no mass is estimated" in said


def test_joints_count_by_how_well_their_models_do_in_free_motion():
    """Ten times the noise on one of them hardly moves the mass, which the other then tells."""
    weight, _, _ = study(7)
    roll, pitch = weight.mass_alone
    share = (weight.mass - pitch) / (roll - pitch)
    power = [np.var(unit_load(ROBOT.chain, "end_link", HUNG.position, *motion())[:, i]) for i in range(2)]
    want = power[0] / weight.free_error[0] ** 2 / sum(p / e**2 for p, e in zip(power, weight.free_error, strict=True))
    assert share == pytest.approx(want, abs=0.02)
    assert weight.free_error[1] > 1.5 * weight.free_error[0]


def test_a_tare_of_a_motion_that_does_not_repeat_is_subtracted_too(monkeypatch):
    monkeypatch.setattr(loads, "repetition", lambda signals: None)
    t = T[: len(T) - 300]
    logs = [
        log("fitted", "identification", 103),
        log("empty", "validation", 303),
        log("heavy", "weight", 303, HUNG.position, t=t + 2.0),
    ]
    for tare, closer in (("", False), ("empty", True)):
        weight, _, _ = analysed(logs, Weighing("heavy", HUNG, tare))
        assert (weight.tare == tare, weight.left_rms.max() < 0.06) == (True, closer)  # of it 0.04 is noise


def test_a_model_without_any_error_tells_the_mass_exactly(monkeypatch):
    monkeypatch.setattr("tests.test_weighing.left_by_the_model", lambda t, seed: np.zeros((len(t), 3)))
    weight, free, _ = study.__wrapped__(0)
    # Central differences err by (w T_s)^2 / 6, 2e-4 of what the fastest acceleration asks for.
    assert weight.mass == pytest.approx(MASS, rel=2e-4)
    assert max(abs(f.free_mass) for f in free.values()) < 1e-12


# The torque constant that a known mass gives

CONSTANTS, GEAR = {"hand_roll": 0.0438, "hand_pitch": 0.05, "instrument_slide": 0.05}, 200.0
CURRENTS = tuple(Source(f"{joint}.i", joint, "current") for joint in JOINTS)


@cache
def by_current(seed=0, stated=0.04, tare="", channels=CURRENTS, mass=MASS):
    """The constants of a weight log whose currents were measured, by joint, and the diagnostics.

    The study states a constant of all motors, or None: then the efforts are currents.
    """
    driven = {"effort": "A"} if stated is None else {"torque_constant": stated}
    robot = replace(ROBOT, joints=tuple(replace(joint, gear_ratio=GEAR, **driven) for joint in ROBOT.joints))
    logs = [
        log("fitted", "identification", 100 + seed),
        log("other", "validation", 200 + seed, path=0.8),
        log("empty", "validation", 300 + seed, t=T[: len(T) - 137] + 1.37),
        log("heavy", "weight", 300 + seed, HUNG.position),
    ]
    currents = [
        (
            [
                replace(m, tau=m.tau / (GEAR * CONSTANTS[m.joint]) * (1.0 if stated is None else GEAR * stated))
                for m in ms
            ],
            x,
        )
        for ms, x in logs
    ]
    made, texts = weighed(currents, Weighing("heavy", replace(HUNG, mass=mass), tare), robot, channels)
    return {record.joint: record for record in made if isinstance(record, TorqueConstant)}, texts


@pytest.mark.medium
def test_intervals_of_torque_constants_hold_the_true_ones_at_the_stated_rate():
    found = [constant for seed in range(24) for constant in by_current(seed)[0].values()]
    assert {constant.joint for constant in found} == {"hand_roll", "hand_pitch"}  # the slide carries none of it
    off = np.array([(of.torque_constant - CONSTANTS[of.joint]) / of.torque_constant_std for of in found])
    assert len(off) == 48
    assert np.mean(np.abs(off) < 1.96) > 0.86  # 48 draws of 95 % fall below 42 once in hundreds
    assert 0.7 < np.std(off) < 1.3


@pytest.mark.parametrize("stated", [None, 0.02, 0.0438])
def test_the_proposed_constant_does_not_depend_on_the_one_in_use_and_is_not_applied(stated):
    reference, found = by_current(2)[0]["hand_roll"], by_current(2, stated)[0]["hand_roll"]
    assert found.torque_constant == pytest.approx(reference.torque_constant, rel=1e-9)
    assert found.torque_constant_std == pytest.approx(reference.torque_constant_std, rel=1e-9)
    assert (found.torque_constant_used, found.stated_mass) == (pytest.approx(stated or np.nan, nan_ok=True), MASS)


def test_the_diagnostic_says_the_constant_its_error_and_that_it_is_not_applied():
    for stated, words in ((None, 'in place of effort = "A"'), (0.0438, "which agrees"), (0.02, "which differs")):
        constants, said = by_current(2, stated)
        of = constants["hand_roll"]
        [text] = [text for text in said if "heavy/hand_roll: the known mass" in text]
        assert 0.001 < of.torque_constant_std < 0.0099  # so the last printed digit is the fourth decimal
        value = f"torque_constant = {of.torque_constant:.4f} ± {of.torque_constant_std:.4f} N m/A with gear_ratio = 200"
        assert [part for part in (value, words, "not applied") if part not in text] == []


@pytest.mark.parametrize(
    ("name", "gear_ratio", "unit"),
    [("instrument_slide", 1.0, "N/A"), ("instrument_slide", GEAR, "N m/A"), ("hand_roll", 1.0, "N m/A")],
)
def test_a_torque_constant_at_a_joint_that_slides_is_a_force_per_ampere_wherever_it_is_stated(
    tmp_path, name, gear_ratio, unit
):
    joints = tuple(replace(joint, gear_ratio=gear_ratio) for joint in ROBOT.joints)
    joint = next(joint for joint in joints if joint.name == name)
    proposed = TorqueConstant("heavy", name, 0.4, 40.0, 48.0, 0.5)
    assert f"48.00 ± 0.50 {unit} with gear_ratio = {gear_ratio:g}; 40 is used" in weigh.proposal(proposed, joint)
    for used, agrees in ((47.6, True), (47.0, False)):  # within 1 % of the proposal, whatever its error
        near = replace(proposed, torque_constant_used=used, torque_constant_std=0.05)
        assert ("which agrees" in weigh.proposal(near, joint)) == agrees
        shown = weight_section.torque_constants(Context(Catalogue(lambda kind: []), None, {}, None), [near])
        assert shown.rows[0][-1] == ("keep" if agrees else "check")
    task = Task("weigh", "heavy", Fingerprint({}, {}, {}, {}, {}, ""), joints={j.name: j.for_units for j in joints})
    with execution.record_writer(Folders(tmp_path, tmp_path, tmp_path), task) as writer:
        place = writer.write(proposed)
    catalogue = Catalogue(lambda kind: [store.read(kind, tmp_path, place)] if kind is TorqueConstant else [])
    context = Context(catalogue, None, collect(catalogue), None)
    assert context.results[f"weight.heavy.{name}.torque_constant"].unit == unit
    [row] = weight_section.torque_constants(context, catalogue.records(TorqueConstant)).rows
    assert [str(cell) for cell in row[3:5]] == [f"40.00 {unit}", f"48.00 ± 0.50 {unit}"]


def test_a_tare_leaves_the_noise_as_the_error_of_a_constant():
    plain, tared = (by_current(3, tare=tare)[0]["hand_pitch"] for tare in ("", "empty"))
    assert tared.torque_constant_std < 0.2 * plain.torque_constant_std
    assert abs(tared.torque_constant - CONSTANTS["hand_pitch"]) < 1.96 * tared.torque_constant_std


@pytest.mark.parametrize("change", [{"channels": ()}, {"mass": None}], ids=["efforts", "unknown mass"])
def test_without_currents_or_a_known_mass_no_constant_is_proposed(change):
    assert by_current(0, **change)[0] == {}


def test_a_constant_that_the_mass_hardly_shows_is_not_proposed(monkeypatch):
    monkeypatch.setattr(weigh, "MAX_RELATIVE_ERROR", 0.06)
    precise = {joint: c.torque_constant_std / c.torque_constant for joint, c in by_current.__wrapped__(0)[0].items()}
    assert set(precise) == {"hand_roll"}
    assert precise["hand_roll"] <= 0.06


def test_a_known_mass_that_appears_negative_gives_no_constant():
    channels = tuple(replace(source, sign=-1) for source in CURRENTS)
    driven = replace(ROBOT, joints=tuple(replace(joint, gear_ratio=-GEAR, effort="A") for joint in ROBOT.joints))
    logs = [log("fitted", "identification", 100), log("heavy", "weight", 300, HUNG.position)]
    made, said = weighed(logs, Weighing("heavy", HUNG, ""), driven, channels)
    assert [record for record in made if isinstance(record, TorqueConstant)] == []
    assert sum("the known mass appears negative" in text for text in said) == 2


def test_the_error_of_a_mass_pools_the_run_with_free_motion_and_widens_by_what_that_shows():
    """Against Student's table: 2.571 for 5 degrees of freedom, 2.131 for 15."""
    run = MassEstimate(0.2, 0.01)
    assert pooled_std(run, []) == pytest.approx(0.01 * 2.571 / 1.96, rel=1e-3)
    small = [MassEstimate(0.012, 0.01), MassEstimate(-0.008, 0.02)]
    pooled = np.sqrt((0.01**2 + 0.01**2 + 0.02**2) / 3)
    assert pooled_std(run, small) == pytest.approx(pooled * 2.131 / 1.96, rel=1e-3)
    large = [MassEstimate(0.1, 0.01), MassEstimate(-0.1, 0.02)]
    assert pooled_std(run, large) == pytest.approx(0.1 * 2.131 / 1.96, rel=1e-3)


def test_a_constant_with_which_the_mass_is_twice_the_known_one_is_twice_too_large():
    assert scaled_constant(0.08, 0.2, MassEstimate(0.4, 0.04)) == pytest.approx((0.04, 0.004))


@pytest.mark.parametrize(("probability", "widens"), [(0.02, False), (0.009, True)])
def test_masses_contradict_each_other_below_a_probability_of_one_percent(probability, widens):
    apart = float(chdtri(1, probability)) ** 0.5  # of two masses of equal errors, in errors of their difference
    [low, high] = [MassEstimate(0.1, 0.01), MassEstimate(0.1 + apart * 0.01 * 2**0.5, 0.01)]
    found = agreement([low, high])
    assert found.probability == pytest.approx(probability, rel=1e-9)
    assert found.ratio == pytest.approx(apart if widens else 1.0)


def test_the_error_of_a_mass_is_the_jackknife_over_sixths_of_the_path():
    rng, block = np.random.default_rng(2), np.repeat(np.arange(PARTS), 20)
    x, y = rng.normal(size=(2, 120))
    without = np.array([np.polyfit(x[block != b], y[block != b], 1)[0] for b in range(6)])
    expected = np.sqrt(5 / 6 * np.sum((without - without.mean()) ** 2))
    assert fit_mass([Rows(x, y, block)]).std == pytest.approx(expected, rel=1e-9)
