"""Models: of joints by themselves and of a coupled arm, with friction that remembers and without."""

import re
from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose

from davinci_forces.filters import FILTERS, sample, tracker
from davinci_forces.filters.problem import FilterInput, NoiseModel
from davinci_forces.identification.observations import observe
from davinci_forces.maths.mechanics.bodies import PARAMETERS
from davinci_forces.maths.mechanics.rigid_body import inverse_dynamics, mass_matrix
from davinci_forces.maths.models import terms
from davinci_forces.maths.models.coupled import CoupledArm
from davinci_forces.maths.models.independent import IndependentJoint
from davinci_forces.maths.models.memory import deflection, efforts, friction_state, pieces
from davinci_forces.maths.models.model import ArmMotion
from davinci_forces.records import Motion
from davinci_forces.robots.davinci import BODIES, CHAIN

DAHL = terms.presliding_friction(0.01)
T_S = 0.005


UNITS = {"inertia": "kg m^2", "effort": "N m", "position": "rad", "gain": ""}
FRICTION = ((terms.viscous, terms.coulomb, terms.presliding_friction(0.02)), (terms.viscous, terms.coulomb))


def coupled(rows=(0, 1), group="arm"):
    """The first two joints of an arm that friction holds back, which remembers in the first of them."""
    friction, units = tuple(FRICTION[row] for row in rows), (UNITS,) * len(rows)
    return CoupledArm(group, ("one", "two"), rows, CHAIN, friction, units)


def wandering(N, seed=0, segments=1, periodic=False):
    """A smooth motion of two joints with its exact derivatives."""
    t, rng = np.arange(N) * T_S, np.random.default_rng(seed)
    w = 2 * np.pi / (N * T_S) * np.arange(3, 9)
    a, phase = rng.normal(size=(2, 6)) * 0.1, rng.uniform(0, 6, (2, 6))
    angle = w * t[:, None, None] + phase
    q, dq, ddq = (np.sum(a * f, axis=2) for f in (np.sin(angle), w * np.cos(angle), -(w**2) * np.sin(angle)))
    return ArmMotion(q, dq, ddq, T_S, np.arange(N) * segments // N, periodic)


def test_only_friction_that_depends_on_a_displacement_or_a_velocity_has_a_scale():
    """A chosen model is read from its fit by names and scales, so a scale of other columns would name another term."""
    scales = {parameter.name: parameter.scale for parameter in coupled().parameters}
    assert {name for name, scale in scales.items() if scale} == {"presliding friction 1 of one"}
    assert scales["presliding friction 1 of one"] == 0.02


ROTOR, SPRING, OFFSET = np.array([0.3, 0.2]), np.array([1.5, 0.0]), np.array([0.0, -0.4])
OF_FRICTION = np.array([1.0, 0.5, 0.5, 0.8, 0.3])  # all friction of joint one builds up over a displacement


def truth(model):
    """The parameters of the arm: those of its links and drives, combined, and of its friction."""
    added = np.concatenate([BODIES.parameters(2), ROTOR, SPRING, OFFSET])
    return np.concatenate([model.base.combination @ added, OF_FRICTION])


def true_effort(motion):
    tau = inverse_dynamics(CHAIN, BODIES, motion.q, motion.dq, motion.ddq) + ROTOR * motion.ddq
    tau += SPRING * motion.q + OFFSET + motion.dq * [1.0, 0.8]
    tau[:, 0] += 0.5 * deflection(motion, 0, 0.02)[0]
    tau[:, 1] += 0.3 * np.sign(motion.dq[:, 1])
    return tau


def test_a_parameter_says_of_which_others_it_is_the_sum_and_what_known_bodies_make_of_it():
    model, b = coupled(), len(coupled().base.columns)
    L, of_bodies = 10 * len(CHAIN.links), model.of_bodies(BODIES)
    names = [f"{name} of {link}" for link in CHAIN.links for name in PARAMETERS]
    values = dict(zip(names, BODIES.parameters(2), strict=True))
    sums = 0
    for parameter, value, column in zip(model.parameters[:b], of_bodies, model.base.columns, strict=False):
        sum_of = re.findall(r"([+-][\d.e-]+) (.*?)(?= [+-]\d|$)", parameter.combination) or [("1", parameter.name)]
        assert parameter.name in [name for _, name in sum_of]
        if column >= L:  # of a drive or a cable, of which bodies say nothing
            assert np.isnan(value)
            continue
        sums += len(sum_of) > 1
        parts = np.array([float(factor) * values.get(name, 0.0) for factor, name in sum_of])
        assert_allclose(value, parts.sum(), atol=1e-3 * np.abs(parts).sum() + 1e-9)  # factors have four digits
    assert sums > 3
    assert np.isnan(of_bodies[b:]).all()
    motion = wandering(500)
    known = np.where(np.isnan(of_bodies), 0.0, of_bodies)
    tau = inverse_dynamics(CHAIN, BODIES, motion.q, motion.dq, motion.ddq)
    assert_allclose(model.regressor(motion).Phi @ known, tau, rtol=1e-6, atol=1e-6 * np.abs(tau).max())


def test_the_effort_of_a_coupled_arm_is_that_of_its_links_drives_and_friction():
    model, motion = coupled(), wandering(4000)
    Phi, known = model.regressor(motion)
    theta = truth(model)
    assert Phi.shape == (4000, 2, len(model.parameters)) == (4000, 2, len(theta))
    assert_allclose(Phi @ theta, true_effort(motion), rtol=1e-9, atol=1e-9)
    M = model.inertia(theta, motion.q)
    assert_allclose(M, mass_matrix(CHAIN, BODIES, motion.q) + np.diag(ROTOR), rtol=1e-9, atol=1e-10)
    assert_allclose(M, M.swapaxes(1, 2), atol=1e-10)
    unaccelerated = efforts(model, theta, motion._replace(ddq=np.zeros_like(motion.ddq)))
    whole = unaccelerated + np.einsum("nij,nj->ni", M, motion.ddq)
    assert_allclose(whole, true_effort(motion), rtol=1e-9, atol=1e-9)
    assert 0 < np.flatnonzero(known)[0] < 400


@pytest.mark.parametrize("model", [coupled(), IndependentJoint("one", (terms.inertia, DAHL, terms.coulomb), ("",) * 3)])
def test_a_long_motion_piece_by_piece_is_the_whole_of_it(model, monkeypatch):
    """With friction that remembers, and gaps, at each of which it starts anew."""
    motion = wandering(2000, segments=3)
    Phi, known = model.regressor(motion)
    theta = np.random.default_rng(1).normal(size=(2, len(model.parameters)))
    which = np.arange(2000) % 2
    monkeypatch.setattr("davinci_forces.maths.models.memory.PIECE_SAMPLES", 300)
    every = list(pieces(model, motion, 7))
    assert [len(piece.motion.q) for piece in every] == [307, *[314] * 5, 207]
    for piece in every:
        found = model.regressor(piece.motion)
        assert_allclose(found.Phi[piece.inside], Phi[piece.place], rtol=1e-12, atol=1e-14)
        assert found.known[piece.inside].tolist() == known[piece.place].tolist()
    assert_allclose(efforts(model, theta[0], motion), Phi @ theta[0], rtol=1e-9, atol=1e-12)
    assert_allclose(
        efforts(model, theta, motion, which), np.einsum("nmp,np->nm", Phi, theta[which]), rtol=1e-9, atol=1e-12
    )


def test_rows_for_a_fit_are_low_passed_piece_by_piece_as_they_would_be_at_once(monkeypatch):
    motion, tau = wandering(3000, segments=2), np.random.default_rng(2).normal(size=(3000, 2))
    t, still = np.arange(3000) * T_S, np.zeros(3000, np.int64)
    columns = zip(("one", "two"), motion.q.T, motion.dq.T, motion.ddq.T, tau.T, strict=True)
    about = ("identification", 1 / T_S, "logged", 4.0, 0.0, 0)
    records = [
        Motion("log", name, *about, t, q, dq, ddq, q, dq, own, motion.segment, still, 0.0, 0.0, 0.0, still)
        for name, q, dq, ddq, own in columns
    ]
    log = observe(records, (), 4.0, 0)
    at_once = log.rows(coupled())
    assert np.diff(at_once[2]).min() == int(1 / T_S / (3 * 4.0))  # three samples a period of the cutoff
    monkeypatch.setattr("davinci_forces.maths.models.memory.PIECE_SAMPLES", 700)
    for piecewise, whole in zip(log.rows(coupled()), at_once, strict=True):
        assert_allclose(piecewise, whole, rtol=1e-9, atol=1e-12)


def test_the_columns_of_a_coupled_arm_are_independent_and_no_fewer_than_its_links_need():
    """Of a motion that the base parameters were not told by."""
    model = coupled()
    Phi, _ = model.regressor(wandering(2000, seed=3))
    scaled = Phi.reshape(-1, Phi.shape[2]) / np.linalg.norm(Phi, axis=(0, 1))
    assert np.linalg.svd(scaled, compute_uv=False)[-1] > 1e-4
    names = [parameter.name for parameter in model.parameters]
    assert len(set(names)) == len(names)
    assert {"viscous friction of one", "presliding friction 1 of one", "Coulomb friction of two"} < set(names)


def test_a_joint_of_a_coupled_arm_has_the_same_effort_by_parameters_of_its_own():
    """Fitted alone, it finds what the whole arm says of it, though it needs fewer parameters."""
    alone, motion = coupled((1,), "two"), wandering(3000)
    assert alone.efforts == ("two",)
    assert len(alone.parameters) < len(coupled().parameters)
    Phi = alone.regressor(motion).Phi[:, 0]
    tau = true_effort(motion)[:, 1]
    scale = np.linalg.norm(Phi, axis=0)
    theta = np.linalg.lstsq(Phi / scale, tau, rcond=None)[0] / scale
    assert_allclose(Phi @ theta, tau, atol=1e-8)
    M = mass_matrix(CHAIN, BODIES, motion.q)[:, 1, 1] + ROTOR[1]
    assert_allclose(alone.inertia(theta, motion.q)[:, 0, 0], M, rtol=1e-4)


def test_what_a_filter_is_told_of_a_coupled_arm_is_its_effort():
    model, motion = coupled(), wandering(3000)
    theta = truth(model)
    for i, told in enumerate(model.joint_dynamics(theta, motion)):
        own = terms.bias(told.coefficients, motion.q[:, i], motion.dq[:, i], 0.0)[0]
        tau = told.inertia * motion.ddq[:, i] + own + told.known
        assert_allclose(tau, true_effort(motion)[:, i], rtol=1e-9, atol=1e-9)
        assert told.coefficients[4] == [1.0, 0.8][i]


@pytest.mark.parametrize("name", FILTERS)
def test_a_filter_tracks_each_joint_of_a_coupled_arm_with_what_the_model_says_of_it(name):
    model, motion = coupled(), wandering(4000)
    theta, tau, t = truth(model), true_effort(motion), np.arange(4000) * T_S
    noise, rng = NoiseModel(1e-5, 1e-4, 1e-5, 2e-4, 0.02), np.random.default_rng(1)
    for i, joint in enumerate(model.joint_dynamics(theta, motion)):
        push = np.where((t > 8) & (t < 12), 1.0, 0.0)
        y = (motion.q[:, i] + 1e-5 * rng.normal(size=4000), motion.dq[:, i] + 1e-4 * rng.normal(size=4000))
        made, untold = (
            tracker(name)(FilterInput(told, *y, motion.ddq[:, i], tau[:, i] + push, T_S, 1.0), noise)
            for told in (joint, joint._replace(known=np.zeros(4000)))
        )
        inside, outside = (t > 9) & (t < 12), (t > 1) & (t < 8)
        # One that knows nothing of gravity, the other joint and the deflection is off by what they make of tau.
        assert np.abs(made.tau_ext[outside]).mean() < 0.15
        assert np.abs(made.tau_ext[outside]).mean() < 0.6 * np.abs(untold.tau_ext[outside]).mean()
        assert made.tau_ext[inside].mean() == pytest.approx(1.0, abs=0.05)


def joint(*own):
    return IndependentJoint("one", own, ("1",) * len(own))


def column(motion):
    return motion._replace(q=motion.q[:, :1], dq=motion.dq[:, :1], ddq=motion.ddq[:, :1])


def test_the_effort_of_an_independent_joint_is_what_its_filter_is_told():
    """M ddq + b(c; q, dq) + known, sample by sample in the compiled kernel, is Phi theta."""
    model = joint(terms.inertia, terms.gravity_sin, terms.gravity_cos, terms.viscous, terms.coulomb, terms.offset, DAHL)
    theta, motion = np.array([0.5, 0.1, -0.2, 0.7, 0.3, 0.05, 0.4]), column(wandering(3000))
    [told] = model.joint_dynamics(theta, motion)
    scalar = [
        sample.bias(told.coefficients, q, dq, 0.0)[0] for q, dq in zip(motion.q[:, 0], motion.dq[:, 0], strict=True)
    ]
    tau = told.inertia * motion.ddq[:, 0] + np.array(scalar) + told.known
    assert_allclose(tau, (model.regressor(motion).Phi @ theta)[:, 0], rtol=1e-12, atol=1e-13)
    assert_allclose(told.known, 0.4 * deflection(motion, 0, DAHL.displacement)[0], atol=1e-15)


def test_a_deflection_is_that_of_the_differential_equation():
    """x_0 dz/dt = dq (1 - z sign dq) [Dahl 1968], which at constant velocity has a closed form."""
    N, v, x_0 = 200, 0.03, 0.01
    motion = ArmMotion(np.zeros((N, 1)), np.full((N, 1), -v), np.zeros((N, 1)), T_S, np.zeros(N, int))
    z, _ = deflection(motion, 0, x_0)
    assert_allclose(z, -(1 - np.exp(-v * np.arange(N) * T_S / x_0)), rtol=1e-12, atol=1e-15)


def test_a_deflection_starts_anew_after_a_gap_and_is_known_after_a_few_displacements_of_travel():
    motion, x_0 = column(wandering(4000, segments=4)), 0.02
    z, known = deflection(motion, 0, x_0)
    for start in range(0, 4000, 1000):
        part = slice(start, start + 1000)
        alone, _ = deflection(ArmMotion(*(x[part] for x in motion[:3]), T_S, motion.segment[part]), 0, x_0)
        assert_allclose(z[part], alone, atol=0)
        first = int(np.flatnonzero(known[part])[0])
        # Whatever the deflection was at the start, it is forgotten where it counts as known.
        other = [1.0]
        for dq in motion.dq[part, 0][:first]:
            other.append(float(terms.deflect(other[-1], dq, T_S, x_0)))
        assert abs(other[-1] - z[start + first]) < 1.5 * np.exp(-3.0)


def test_a_deflection_of_a_period_ends_where_it_starts():
    motion = column(wandering(2000, periodic=True))
    z, known = deflection(motion, 0, 0.02)
    assert known.all()
    after = terms.deflect(z[-1], motion.dq[-1, 0], T_S, 0.02)
    assert after == pytest.approx(z[0], abs=1e-12)


def test_a_term_of_an_unknown_function_or_without_its_displacement_is_refused():
    with pytest.raises(ValueError, match="no functions \\['sin dq'\\]"):
        terms.Term("odd", "x", "1", b={"sin dq": 1.0})
    with pytest.raises(ValueError, match="one displacement"):
        replace(DAHL, displacement=0.0)
    with pytest.raises(ValueError, match="one displacement"):
        replace(DAHL, width=0.1)


@pytest.mark.parametrize("term", [terms.presliding_friction(1e-4), terms.smooth_sign(1e-3)], ids=lambda term: term.name)
def test_friction_that_reverses_gradually_has_no_effort_at_speed_so_coulomb_friction_is_all_there(term):
    motion, model = column(wandering(2000)), IndependentJoint("one", (terms.coulomb, term), ("N m", "N m"))
    dq, theta, known = motion.dq[:, 0], np.array([0.8, 0.5]), model.regressor(motion).known
    fast = known & (np.abs(dq) > 5e-3)
    steady = (
        np.abs(np.convolve(fast * np.sign(dq), np.ones(100))[: len(fast)]) == 100
    )  # a travel of 5 displacements or more
    assert steady.sum() > 300
    assert_allclose(model.regressor(motion).Phi[steady, 0] @ theta, 0.8 * np.sign(dq[steady]), atol=5e-3)
    dynamics = model.joint_dynamics(theta, motion)[0]
    assert dynamics.coefficients[terms.COULOMB] == pytest.approx(0.3)  # that reverses at once
    effort = 0.3 * np.sign(dq) + dynamics.known
    assert_allclose(effort, model.regressor(motion).Phi[:, 0] @ theta, atol=1e-12)


def test_a_smooth_sign_and_stribeck_s_peak_are_the_sign_far_from_and_near_standstill():
    motion = column(wandering(2000))
    dq = motion.dq[:, 0]
    smooth, _ = friction_state(motion, 0, terms.smooth_sign(1e-3))
    peak, _ = friction_state(motion, 0, terms.stribeck(1e-3))
    fast = np.abs(dq) > 5e-3
    assert_allclose(smooth[fast], np.sign(dq[fast]), atol=1e-4)  # 1 - tanh(5)
    assert_allclose(peak[fast], 0.0, atol=1e-10)  # exp(-25)
    assert_allclose(friction_state(motion, 0, terms.smooth_sign(1e3))[0], dq / 1e3, rtol=1e-5)
    assert_allclose(friction_state(motion, 0, terms.stribeck(1e3))[0], np.sign(dq), rtol=1e-5)
