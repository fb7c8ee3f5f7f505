"""The stages that resolve external efforts into the force at the tip, on efforts that a known force makes."""

import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from davinci_forces.maths.mechanics import kinematics, tip_force
from davinci_forces.maths.mechanics.tip_force import matrix, shared_correlations
from davinci_forces.records import (
    ArmCorrelation,
    Contact,
    Diagnostic,
    JointCorrelation,
    TipBudget,
    TipContact,
    TipForce,
    Track,
)
from davinci_forces.report import verdicts
from davinci_forces.report.sections import tip
from davinci_forces.robots import load
from davinci_forces.stages.tip import resolve
from tests.test_averaging import entry

RATE = 100.0
T = np.arange(4000) / RATE
LAST = T[-1] - 0.5  # [s] from which levels take no samples
NAMES = ("hand_roll", "hand_pitch", "instrument_slide")
SLIDE = {"davinci": 0.03, "dvrk_psm": 0.15}
STD = np.array([0.05, 0.08, 0.5])
WINDOW = (9.0, 11.0)
PUSH = np.clip(1 - np.abs(T - 10.0), 0, None)[:, None] * [3.0, -4.0, 12.0]


def path(robot: str, slide: float | None = None) -> np.ndarray:
    """A motion of three joints (N, 3)."""
    w = 2 * np.pi / np.array([8.0, 6.5, 5.0])
    middle = SLIDE[robot] if slide is None else slide
    return np.sin(np.outer(T, w)) * [0.15, 0.2, 0.04] + [0.0, 0.1, middle]


def tracks(robot: str, tau, q=None, log="push", role="contact", at_rest=(0, 0, 0)) -> list[Track]:
    """Tracks of three joints with these efforts (N, 3), whose deviations are STD; no sample tells them by itself."""
    q, zero = path(robot) if q is None else q, np.zeros(len(T))
    made, noisy = [], np.random.default_rng(9).normal(size=len(T))
    for i, name in enumerate(NAMES):
        columns = dict.fromkeys(Track.columns(), zero) | {
            "t": T, "q": q[:, i], "tau_ext_smooth": tau[:, i], "tau_ext_smooth_std": zero + STD[i],
            "tau_ext_direct": tau[:, i] + 100.0 * STD[i] * noisy,
        }  # fmt: skip
        scalars = dict.fromkeys(Track.scalars(), 0.0) | {"at_rest": at_rest[i], "rate": RATE, "filter": "ekf"}
        parts = {"smooth_part": 0.6 * STD[i], "model_part": 0.8 * STD[i]}
        about = {"log": log, "joint": name, "role": role, "model": "m", "estimator": "e", "path": "", "band_from": ""}
        made.append(Track(**columns, **scalars | parts | about))
    return made


def efforts(robot: str, f, q=None) -> np.ndarray:
    """What a force (N, 3) at the tip makes of the joints (N, 3).  (7.25)"""
    J, _ = kinematics.jacobian(load(robot, Path()).chain, path(robot) if q is None else q)
    return np.einsum("nij,ni->nj", J, f)


def noise(seed: int, correlation=None) -> np.ndarray:
    """Efforts (N, 3) that scatter as their deviations say."""
    R = np.eye(3) if correlation is None else correlation
    return np.random.default_rng(seed).multivariate_normal(np.zeros(3), tip_force.covariance(STD, R), len(T))


def run(robot: str, of: list[Track], correlations=(), contacts=(), **about) -> dict[type, object]:
    about = {"name": "push", "role": "contact", "contact": (WINDOW,)} | about
    made = list(resolve.apply(of, contacts, correlations, entry(**about), load(robot, Path())))
    assert len({type(record) for record in made}) == len(made)
    return {type(record): record for record in made}


@pytest.mark.parametrize("robot", ["davinci", "dvrk_psm"])
def test_the_force_that_made_the_efforts_comes_out_at_every_instant_and_at_its_peak(robot: str):
    made = run(robot, tracks(robot, efforts(robot, PUSH)))
    force, contact = made[TipForce], made[TipContact]
    found = np.column_stack([force.f_x, force.f_y, force.f_z])
    np.testing.assert_allclose(found, PUSH, rtol=0, atol=1e-11)  # 1e-16 of 13 N, times the condition number
    np.testing.assert_allclose(
        np.column_stack([force.x, force.y, force.z]), kinematics.tip(load(robot, Path()).chain, path(robot))
    )
    assert (contact.t_peak[0], contact.f_peak[0]) == pytest.approx((10.0, 13.0))
    k = 1000
    std = [contact.f_x_std[0], contact.f_y_std[0], contact.f_z_std[0]]
    np.testing.assert_allclose(std, np.sqrt([force.c_xx[k], force.c_yy[k], force.c_zz[k]]))
    assert contact.sigma_3[0] <= contact.f_peak_std[0] <= contact.sigma_1[0]
    keys = {number.key: getattr(contact, number.field)[number.row] for number in contact.published()}
    assert [keys[f"tip.push.1.{name}"] for name in ("f_x", "f_y", "f_z", "peak")] == pytest.approx([3, -4, 12, 13])


def test_the_level_of_a_held_push_is_its_mean_over_the_middle_half():
    """Whatever noise does to single samples: of 40 pushes, mean and error of the deviations from 13 N."""
    held = (np.abs(T - 10.0) <= 1.0)[:, None] * [3.0, -4.0, 12.0]  # in WINDOW
    of_push, z = tracks("davinci", efforts("davinci", held)), []
    for seed in range(40):
        noisy = efforts("davinci", held) + noise(seed)
        of = [replace(x, tau_ext_direct=noisy[:, i], tau_ext_smooth=noisy[:, i]) for i, x in enumerate(of_push)]
        contact = run("davinci", of)[TipContact]
        z.append((contact.f_middle[0] - 13.0) / contact.f_middle_std[0])
        assert contact.f_middle_std[0] < 0.3 * contact.f_peak_std[0]  # a mean of a hundred samples
    assert abs(np.mean(z)) < 4 / np.sqrt(len(z))
    assert 0.6 < np.std(z) < 1.5
    middle = PUSH[np.abs(T - 10.0) < 0.5 + 1e-9]
    rising = [replace(x, tau_ext_direct=x.tau_ext_smooth) for x in tracks("davinci", efforts("davinci", PUSH))]
    assert run("davinci", rising)[TipContact].f_middle[0] == pytest.approx(np.linalg.norm(middle.mean(axis=0)))
    still = [replace(x, static_friction=1.0, standing=1.0 + 0.0 * T) for x in of_push]
    assert run("davinci", still)[TipContact].f_middle_std[0] > run("davinci", of_push)[TipContact].f_middle_std[0]


def test_the_stated_deviation_is_by_how_much_the_force_is_off():
    """Of noise that obeys it: the level of free space is that of the covariance, and the ellipsoid covers it."""
    made = run("davinci", tracks("davinci", efforts("davinci", PUSH) + noise(0)))
    force, contact = made[TipForce], made[TipContact]
    error = np.column_stack([force.f_x, force.f_y, force.f_z]) - PUSH
    variance = np.column_stack([force.c_xx, force.c_yy, force.c_zz])
    z = error / np.sqrt(variance)
    np.testing.assert_allclose(z.std(0), 1.0, atol=4 / np.sqrt(2 * len(T)))
    assert force.force_rms == pytest.approx(np.sqrt(variance.sum(1).mean()), rel=0.05)
    assert force.force_coverage == pytest.approx(0.95, abs=4 * np.sqrt(0.95 * 0.05 / force.tested))
    assert force.force_level < force.force_detection
    found, std = (np.array([getattr(contact, n + end)[0] for n in ("f_x", "f_y", "f_z")]) for end in ("", "_std"))
    assert (np.abs(found - [3.0, -4.0, 12.0]) < 4 * std).all()


def test_the_deviation_of_a_peak_holds_what_the_smoother_rounds_off_it():
    """As of a contact's peak (TIP_REACH): of a triangle under exponential weights of either side, all of it."""
    rise = 0.2  # [s]
    weights = np.exp(-np.abs(np.arange(-200, 201)) / RATE * 2 / rise)
    rounded = np.column_stack([np.convolve(x, weights / weights.sum(), "same") for x in PUSH.T])
    exact, smooth = (
        run("davinci", [replace(track, smooth_rise=rise * k) for track in tracks("davinci", efforts("davinci", f))])
        for k, f in ((0.0, rounded), (1.0, rounded))
    )
    lost = smooth[TipContact].f_peak_std[0] ** 2 - exact[TipContact].f_peak_std[0] ** 2
    assert np.sqrt(lost) == pytest.approx(13.0 - smooth[TipContact].f_peak[0], rel=0.25)
    assert smooth[TipContact].f_z_std[0] > exact[TipContact].f_z_std[0]


def test_the_largest_force_is_that_of_the_measured_efforts_at_its_time_where_these_are_sure():
    """The triangle again, and an effort of the roll alone that goes on beyond the peak: it counts as it is there."""
    rise = 0.2  # [s]
    weights = np.exp(-np.abs(np.arange(-200, 201)) / RATE * 2 / rise)
    rounded = efforts("davinci", np.column_stack([np.convolve(x, weights / weights.sum(), "same") for x in PUSH.T]))
    drift = np.clip(T - 9.5, 0.0, 1.5)[:, None] * [1.0, 0.0, 0.0]
    measured = efforts("davinci", PUSH) + drift
    few = 0.02 * STD * np.random.default_rng(2).normal(size=measured.shape)
    noisy = [replace(track, smooth_rise=rise) for track in tracks("davinci", rounded + drift)]
    sure = [replace(track, tau_ext_direct=(measured + few)[:, i]) for i, track in enumerate(noisy)]
    before, after = (run("davinci", of, contact=((9.5, 10.2),))[TipContact] for of in (noisy, sure))
    k = int(np.argmin(np.abs(T - after.t_peak[0])))
    J, _ = kinematics.jacobian(load("davinci", Path()).chain, path("davinci")[k])
    f, said = np.linalg.solve(J.T, measured[k]), [after.f_x[0], after.f_y[0], after.f_z[0]]
    np.testing.assert_allclose(said, f, atol=0.02 * np.linalg.norm(f))
    assert before.f_peak[0] < 0.98 * np.linalg.norm(f)
    assert after.f_peak_std[0] < before.f_peak_std[0]


def test_the_error_of_the_largest_force_of_a_push_that_is_held_holds_what_noise_adds_to_it():
    """Noise of which each second has one value raises the largest of a push of 4 s; the mean would be right."""
    windows = tuple((float(start), start + 4.0) for start in range(2, 36, 7))
    touched = (T[:, None] - [start for start, _ in windows]) % 1e3 < 4.0
    held = touched.any(1)[:, None] * np.array([3.0, -4.0, 12.0])
    slow = np.random.default_rng(4).normal(size=(41, 3)) * STD
    tau = efforts("davinci", held) + np.repeat(slow, 100, axis=0)[: len(T)]
    contact = run("davinci", tracks("davinci", tau), contact=windows)[TipContact]
    plain = run("davinci", tracks("davinci", efforts("davinci", held)), contact=windows)[TipContact]
    error = contact.f_peak - 13.0
    assert error.mean() > 0.5 * plain.f_peak_std.mean()  # the largest is too large
    assert np.sqrt(np.mean((error / plain.f_peak_std) ** 2)) > 1.3
    assert np.sqrt(np.mean((error / contact.f_peak_std) ** 2)) < 1.1


def test_what_is_rounded_off_each_joint_follows_from_its_own_rise():
    plain = tracks("davinci", efforts("davinci", PUSH * [1.0, 0.0, 0.0]))  # a force of the roll, almost alone
    slow = [replace(track, smooth_rise=0.2 if track.joint != "hand_roll" else 0.0) for track in plain]
    exact, other = (run("davinci", each)[TipContact].f_x_std[0] for each in (plain, slow))
    assert other == pytest.approx(exact, rel=0.02)


def test_what_is_rounded_off_is_counted_once_and_is_as_uncertain_as_the_force():
    rounding = np.exp(-np.abs(T - 10.0))
    plain = [replace(track, smooth_rise=0.2) for track in tracks("davinci", efforts("davinci", PUSH))]
    in_band = [
        replace(track, tau_ext_rounding=rounding, tau_ext_smooth_std=np.hypot(std, rounding))
        for track, std in zip(plain, STD, strict=True)
    ]
    at_rest = run("davinci", [replace(track, smooth_rise=0.0) for track in plain])[TipContact]
    once, again = (run("davinci", each)[TipContact] for each in (plain, in_band))
    np.testing.assert_allclose(again.f_peak_std, once.f_peak_std, rtol=1e-12)
    np.testing.assert_allclose(again.sigma_1_std, once.sigma_1_std, rtol=1e-12)
    assert 0.5 * at_rest.sigma_3[0] < once.sigma_1_std[0] < 1.5 * at_rest.sigma_1[0] < once.sigma_1[0]


def test_joints_whose_errors_go_together_blur_the_force_in_another_direction():
    R = matrix(0.6, -0.3, 0.2)
    rows = {"rho_12": [0.6, 0.6, -0.9], "rho_13": [-0.3, -0.3, 0.9], "rho_23": [0.2, 0.2, 0.9]}
    arm = ArmCorrelation(robot="davinci", source=np.array(["a", "b", "push"], object), **rows)
    force = run("davinci", tracks("davinci", noise(1, R)), [arm])[TipForce]
    assert (force.rho_12, force.rho_13, force.rho_23) == pytest.approx((0.6, -0.3, 0.2))
    assert force.correlation_from == "a, b"  # and not the log itself
    f = np.column_stack([force.f_x, force.f_y, force.f_z])
    errors = 4 * np.sqrt(2 / len(T))
    assert np.mean(f[:, 0] ** 2 / force.c_xx) == pytest.approx(1.0, abs=errors)
    assert np.mean(f[:, 0] * f[:, 2]) == pytest.approx(
        force.c_xz.mean(), abs=errors * np.sqrt(force.c_xx.mean() * force.c_zz.mean())
    )
    alone = run("davinci", tracks("davinci", noise(1, R)))[TipForce]
    assert alone.correlation_from == ""
    assert not np.allclose(alone.c_xx, force.c_xx, rtol=0.05)


def test_what_one_log_says_of_correlations_counts_only_where_others_agree():
    agreed, other = np.array([0.5, -0.2, 0.1]), np.array([-0.5, 0.2, -0.1])
    np.testing.assert_array_equal(shared_correlations(agreed[None]), np.zeros(3))
    np.testing.assert_array_equal(shared_correlations(np.array([agreed, other])), np.zeros(3))
    np.testing.assert_allclose(shared_correlations(np.array([agreed, agreed])), agreed)
    rng = np.random.default_rng(4)
    for _ in range(50):
        logs = [np.corrcoef(rng.normal(size=(3, 5)))[np.triu_indices(3, 1)] for _ in range(3)]
        assert np.linalg.eigvalsh(matrix(*shared_correlations(np.array(logs)))).min() > -1e-12


def test_how_errors_go_together_is_measured_in_free_space_of_joints_that_all_move():
    R, robot = matrix(0.6, -0.3, 0.2), load("davinci", Path())
    about = entry(name="push", role="contact", contact=(WINDOW,))
    pushed = tracks("davinci", noise(2, R) + efforts("davinci", 100.0 * PUSH))
    [found] = resolve.run(pushed, about, robot)
    within = 4 / np.sqrt(found.tested)
    assert (found.rho_12, found.rho_13, found.rho_23) == pytest.approx((0.6, -0.3, 0.2), abs=within)
    assert not list(resolve.run(tracks("davinci", noise(2), at_rest=(0, 1, 0)), about, robot))
    assert not list(resolve.run(pushed[:2], about, robot))
    assert not list(resolve.run(pushed, replace(about, contact=()), robot))
    assert not list(resolve.run(pushed, about, replace(robot, chain=None)))


def test_what_is_kept_of_correlations_does_not_grow_with_the_study():
    robot = load("davinci", Path())
    few = [JointCorrelation(f"log-{i}", 1000, 0.1, 0.2, 0.3) for i in range(3)]
    [arm] = resolve.gather(few, robot)
    assert list(arm.source) == ["log-0", "log-1", "log-2"]
    [arm] = resolve.gather([replace(few[0], log=f"log-{i}") for i in range(100)], robot)
    assert len(arm) == 20
    assert not list(resolve.gather([], robot))


def test_a_joint_at_rest_or_without_a_track_leaves_the_force_unknown_and_that_is_said():
    of = tracks("davinci", noise(3), at_rest=(0, 0, 1))
    made = run("davinci", [of[0], of[2]])
    assert set(made) == {Diagnostic}
    [text] = made[Diagnostic].text
    assert "the external effort of hand_pitch is not known" in text
    assert "instrument_slide is at rest, where friction hides its effort" in text
    assert not run("davinci", of, role="validation", contact=())  # nothing touches it, so nothing is missed
    assert not run("davinci", tracks("davinci", noise(3)), role="weight", contact=())


def test_a_robot_without_a_geometry_has_no_tip():
    robot = replace(load("davinci", Path()), chain=None)
    assert not list(resolve.apply(tracks("davinci", noise(3)), [], [], entry(role="contact"), robot))


def test_a_tip_that_no_pose_determines_is_refused_with_a_remedy():
    robot = load("davinci", Path())
    robot = replace(robot, chain=replace(robot.chain, tip="0"))  # a frame that no joint moves
    [said] = resolve.apply(tracks("davinci", noise(3)), [], [], entry(role="contact"), robot)
    assert "add a fixed link to the tip of the tool" in said.text[0]
    assert not list(resolve.apply(tracks("davinci", noise(3)), [], [], entry(role="validation"), robot))


def test_efforts_in_ampere_are_no_forces_so_the_tip_has_none():
    robot = load("davinci", Path())
    robot = replace(robot, joints=tuple(replace(j, effort="A" * (j.name == "hand_pitch")) for j in robot.joints))
    [said] = resolve.apply(tracks("davinci", efforts("davinci", PUSH)), [], [], entry(role="contact"), robot)
    assert "the effort of hand_pitch is a current, not a force; state torque_constant" in said.text[0]


def test_samples_near_a_singular_pose_are_marked_and_not_judged():
    centre = float(tip_force.singular_slides(load("davinci", Path()).chain, 0.0)[0])
    q = path("davinci", centre + 0.03)
    made = run("davinci", tracks("davinci", noise(5), q), role="validation", contact=())
    force = made[TipForce]
    near = force.condition > tip_force.NEAR_SINGULAR
    assert 0 < near.sum() < len(T) / 2
    np.testing.assert_array_equal(force.near_singular, near)
    assert force.near_share == pytest.approx(near.mean())
    size = np.linalg.norm([force.f_x, force.f_y, force.f_z], axis=0)
    calm = (T >= 1.0) & (T < LAST) & ~near
    assert force.tested == calm.sum()
    assert force.force_rms == pytest.approx(np.sqrt(np.mean(size[calm] ** 2)))


def test_a_sample_at_a_singular_pose_is_not_known_and_is_no_peak():
    q, chain = path("davinci"), load("davinci", Path()).chain
    q[1000, 2] = tip_force.singular_slides(chain, q[1000, 1])[0]
    made = run("davinci", tracks("davinci", efforts("davinci", PUSH, q), q))
    assert np.isnan(made[TipForce].f_x[1000])
    assert np.isfinite(np.delete(made[TipForce].f_x, 1000)).all()
    assert np.isfinite(made[TipContact].f_peak).all()
    assert made[TipContact].t_peak[0] == pytest.approx(10.0, abs=0.011)


def found(joint: str, *windows: tuple[float, float]) -> Contact:
    """Contacts that were found beside the windows of the study."""
    zero = np.zeros(len(windows))
    columns = dict.fromkeys(Contact.columns(), zero) | {"found": zero + 1}
    onset, release = np.array(windows).T
    about = {"log": "push", "joint": joint, "filter": "ekf", "detection_level": 0.1, "alarm_level": 0.1}
    return Contact(**about, level_from="x", **columns | {"onset": onset, "release": release})


def test_contacts_that_were_found_on_any_joint_are_told_once():
    contacts = [
        found("hand_roll", (20.0, 21.0), (30.0, 31.0)),
        found("hand_pitch", (20.5, 22.0), (10.5, 11.5)),
        found("instrument_slide", (21.9, 23.0)),
    ]
    contact = run("davinci", tracks("davinci", efforts("davinci", PUSH) + noise(6)), contacts=contacts)[TipContact]
    assert list(zip(contact.onset, contact.release, contact.stated, strict=True)) == [
        (9.0, 11.0, 1), (20.0, 23.0, 0), (30.0, 31.0, 0)
    ]  # fmt: skip


def test_the_error_of_each_joint_at_the_tip_is_its_deviation_times_its_lever():
    budget = run("davinci", tracks("davinci", noise(7)))[TipBudget]
    free = (T >= 1.0) & (T < LAST) & ((T < 8.0) | (T > 12.0))
    median = np.median(path("davinci")[free], axis=0)
    lever = tip_force.lever(kinematics.jacobian(load("davinci", Path()).chain, median)[0])
    np.testing.assert_allclose(budget.lever, lever)
    np.testing.assert_allclose(budget.filter_force, 0.6 * STD * lever)
    np.testing.assert_allclose(budget.total_force, STD * lever)
    assert {number.key for number in budget.published()} >= {f"tip.push.{joint}.model_part" for joint in NAMES}


def test_a_force_that_is_known_nowhere_is_still_shown():
    """As it is where the whole log is at singular poses, and where it ends before the filter has settled."""
    made = run("davinci", tracks("davinci", efforts("davinci", PUSH)))
    force, contact = made[TipForce], made[TipContact]
    unknown = replace(force, **dict.fromkeys(TipForce.UNKNOWN, np.full(len(T), np.nan)))
    assert np.isnan(tip.component_panel(unknown, "x", []).marks[-1].y).all()
    line = tip.component_panel(force, "z", [contact]).marks[-1]
    assert line.x[0] == pytest.approx(force.t[0] + 1.0)
    assert line.y.max() == pytest.approx(12.0)
    assert verdicts.NEAR_SINGULAR == tip_force.NEAR_SINGULAR


def test_forces_are_drawn_from_where_the_tip_is_and_to_scale():
    made = run("davinci", tracks("davinci", efforts("davinci", PUSH)))
    figure = tip.in_space(made[TipForce], made[TipContact])
    [largest] = [mark for mark in figure.marks if mark.label == "largest force"]
    drawn = np.array([largest.x[1] - largest.x[0], largest.y[1] - largest.y[0], largest.z[1] - largest.z[0]])
    np.testing.assert_allclose(drawn / np.linalg.norm(drawn), np.array([3.0, -4.0, 12.0]) / 13.0, atol=1e-9)
    per_newton = float(re.search(r"1 N is drawn ([\d.]+) mm", figure.caption)[1])
    assert 1e3 * np.linalg.norm(drawn) == pytest.approx(13.0 * per_newton, rel=0.05)  # two digits are printed
    assert largest.x[0] == pytest.approx(made[TipContact].x[0])
