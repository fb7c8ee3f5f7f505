"""The usual recordings of an arm: each joint moves alone, and all move together in one log."""

from dataclasses import replace

import numpy as np
import pytest

from davinci_forces.identification.candidates import Candidate
from davinci_forces.maths.models.model import ArmMotion
from davinci_forces.maths.models.terms import smooth_sign
from davinci_forces.records import Choice, Diagnostic, Fit, ModelSearch, Motion
from davinci_forces.robots.dvrk_psm import ROBOT
from davinci_forces.robots.models import coupled_arm
from davinci_forces.stages.model import choose
from tests.arm import searched_coarsely

JOINTS = [joint.name for joint in ROBOT.joints]
RATE, PERIOD, SAMPLES = 50.0, 12.0, 1800
SIZE = np.array([0.3, 0.3, 0.05])


def recorded(log: str, moving: list[int], seed: int) -> list[Motion]:
    """The joints of a log in which some move; an arm with smooth friction whose width is not known."""
    random, t = np.random.default_rng(seed), np.arange(SAMPLES) / RATE
    a, phase = random.normal(size=(5, 3)), random.uniform(0, 6, (5, 3))
    a *= np.isin(np.arange(3), moving) * SIZE / np.abs(a).sum(axis=0)
    w = 2 * np.pi / PERIOD * np.arange(1, 6)[:, None]
    x = w * t[:, None, None] + phase
    q, dq, ddq = (a * np.sin(x)).sum(1), (a * w * np.cos(x)).sum(1), (-a * w**2 * np.sin(x)).sum(1)
    zero = np.zeros(SAMPLES, int)
    model = coupled_arm(ROBOT, [0, 1, 2], [(smooth_sign(0.015),), (smooth_sign(0.015),), (smooth_sign(0.002),)])
    theta = np.random.default_rng(7).normal(size=len(model.parameters)) * 0.2
    theta[[p.positive for p in model.parameters]] = 0.5
    theta[[p.name.startswith("smooth friction") for p in model.parameters]] = 0.5
    tau = model.regressor(ArmMotion(q, dq, ddq, 1 / RATE, zero)).Phi @ theta
    tau += 0.005 * np.random.default_rng(seed + 100).normal(size=tau.shape)
    about = ("identification", RATE, "logged", 17.0, 0.0)
    records = []
    for i, joint in enumerate(JOINTS):
        columns = {"t": t, "q": q[:, i], "dq": dq[:, i], "ddq": ddq[:, i], "tau": tau[:, i], "segment": zero}
        columns |= {"q_measured": q[:, i], "dq_measured": dq[:, i], "filled": zero, "standing": zero}
        columns |= dict.fromkeys(("sigma_q", "sigma_dq", "sigma_tau"), 0.0)
        records.append(Motion(log, joint, *about, int(i not in moving), **columns))
    return records


@pytest.fixture(scope="module")
def made():
    logs = [recorded("all", [0, 1, 2], 1), *(recorded(name, [i], 2 + i) for i, name in enumerate(JOINTS))]
    with searched_coarsely():
        return list(choose.run([m for log in logs for m in log], [], ROBOT, fit="chosen", lowpass=17.0))


def test_coupling_that_one_log_shows_is_part_of_the_search(made):
    searches = {(r.joint, r.structure): r for r in made if isinstance(r, ModelSearch)}
    for joint in JOINTS:
        coupled, alone = (searches[joint, structure].score.min() for structure in ("coupled", "independent"))
        assert coupled < 0.5 * alone


def test_the_searched_model_of_coupled_joints_is_chosen(made):
    choice = next(r for r in made if isinstance(r, Choice))
    assert choice.chosen.startswith("searched, links shared")
    scores = dict(zip(choice.candidate, choice.score, strict=True))
    fixed = min(score for name, score in scores.items() if not name.startswith("searched"))
    assert scores[choice.chosen] < 0.7 * fixed


def test_the_consistent_inertia_of_a_joint_by_itself_is_one_that_a_filter_can_divide_by():
    [record] = (m for m in recorded(JOINTS[0], [0], 2) if m.joint == JOINTS[0])
    backward = replace(record, tau=record.tau - 1.0 * record.ddq)
    made = choose.run([backward], [], replace(ROBOT, chain=None, bodies=None), fit="chosen", lowpass=17.0)
    fits = {f.estimator: f for f in made if isinstance(f, Fit) and f.model == "chosen"}
    free, held = (dict(zip(f.parameter, f.theta, strict=True)) for f in (fits["ridge"], fits["consistent"]))
    inertias = [sum(theta for name, theta in x.items() if name in ("inertia", "lifted mass")) for x in (free, held)]
    assert inertias[0] < 0
    share = inertias[1] * np.sqrt(np.mean(backward.ddq**2) / np.mean(backward.tau**2))
    assert share == pytest.approx(1e-3, rel=1e-3)


@pytest.mark.parametrize(("added", "estimator"), [(0.31, "consistent"), (-0.2, "ridge")])
def test_where_no_inertia_is_positive_it_is_warned_of_unless_another_is_used(added, estimator, monkeypatch):
    monkeypatch.setattr(Candidate, "is_physical", property(lambda self: False))
    [record] = (m for m in recorded(JOINTS[0], [0], 2) if m.joint == JOINTS[0])
    other = replace(record, tau=record.tau + added * record.ddq)
    made = list(choose.run([other], [], replace(ROBOT, chain=None, bodies=None), fit="chosen", lowpass=17.0))
    assert [r.estimator for r in made if isinstance(r, Choice)] == [estimator]
    warned = any("no candidate has a positive" in text for r in made if isinstance(r, Diagnostic) for text in r.text)
    assert warned == (estimator == "ridge")
