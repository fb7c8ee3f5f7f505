"""The protocol of a model, tried on the joints that there are and on a coupled arm with friction that remembers."""

from dataclasses import dataclass, replace

import numpy as np
import pytest
from numpy.testing import assert_allclose

from pipeline.filters import FILTERS, tracker
from pipeline.filters.problem import NoiseModel
from pipeline.maths.mechanics.rigid_body import inverse_dynamics, mass_matrix
from pipeline.maths.mechanics.rigid_body import regressor as rigid_body_regressor
from pipeline.maths.models import bias as derivation
from pipeline.maths.models import kernels, terms
from pipeline.maths.models.independent import IndependentJoint
from pipeline.maths.models.memory import deflection
from pipeline.maths.models.model import JointDynamics, Motion, Parameter, Regressor
from pipeline.robots.davinci_chain import BODIES, CHAIN

DAHL = terms.Term("presliding friction", "z", "{effort}", b={"z": 1.0}, displacement=0.01)
T_S = 0.005


@dataclass(frozen=True)
class CoupledArm:
    """Two joints of an arm: its links' inertial parameters, viscous friction, and a Dahl state in the first joint."""

    x_0: float
    name: str = "coupled+dahl"
    group: str = "arm"
    joints: tuple[str, ...] = ("one", "two")

    @property
    def parameters(self):
        names = [f"pi {i}" for i in range(10 * len(CHAIN.parent))] + ["viscous one", "viscous two", "dahl one"]
        return tuple(Parameter(name, "x", "1", False) for name in names)

    def regressor(self, motion):
        z, known = deflection(motion, 0, self.x_0)
        Y = rigid_body_regressor(CHAIN, motion.q, motion.dq, motion.ddq)
        friction = motion.dq[:, :, None] * np.eye(2)
        presliding = np.stack([z, 0.0 * z], axis=1)[:, :, None]
        return Regressor(np.concatenate([Y, friction, presliding], axis=2), known)

    def inertia(self, theta, q):
        still, L = np.zeros_like(q), 10 * len(CHAIN.parent)
        gravity = rigid_body_regressor(CHAIN, q, still, still) @ theta[:L]
        pushed = [rigid_body_regressor(CHAIN, q, still, still + e) @ theta[:L] - gravity for e in np.eye(2)]
        return np.stack(pushed, axis=2)

    def bias(self, theta, motion):
        return self.regressor(motion._replace(ddq=0.0 * motion.ddq)).Phi @ theta

    def joint_dynamics(self, theta, motion):
        M, tau = self.inertia(theta, motion.q), self.regressor(motion).Phi @ theta
        views = []
        for i, v in enumerate(theta[-3:-1]):
            known = tau[:, i] - M[:, i, i] * motion.ddq[:, i] - v * motion.dq[:, i]
            views.append(JointDynamics(M[:, i, i], (0.0, 0.0, 0.0, 0.0, float(v), 0.0, 0.0), known))
        return tuple(views)


def wandering(N, seed=0, segments=1, periodic=False):
    """A smooth motion of two joints with its exact derivatives."""
    t, rng = np.arange(N) * T_S, np.random.default_rng(seed)
    w = 2 * np.pi / (N * T_S) * np.arange(3, 9)
    a, phase = rng.normal(size=(2, 6)) * 0.1, rng.uniform(0, 6, (2, 6))
    angle = w * t[:, None, None] + phase
    q, dq, ddq = (np.sum(a * f, axis=2) for f in (np.sin(angle), w * np.cos(angle), -(w**2) * np.sin(angle)))
    return Motion(q, dq, ddq, T_S, np.arange(N) * segments // N, periodic)


def truth():
    return np.concatenate([BODIES.parameters(2), [1.0, 0.8, 0.5]])


def test_the_protocol_describes_a_coupled_arm_whose_friction_remembers():
    model, motion, theta = CoupledArm(0.02), wandering(4000), truth()
    Phi, known = model.regressor(motion)
    assert Phi.shape == (4000, 2, len(model.parameters))
    tau = inverse_dynamics(CHAIN, BODIES, motion.q, motion.dq, motion.ddq) + motion.dq * theta[-3:-1]
    tau[:, 0] += theta[-1] * deflection(motion, 0, 0.02)[0]
    assert_allclose(Phi @ theta, tau, rtol=1e-11, atol=1e-11)
    assert_allclose(model.inertia(theta, motion.q), mass_matrix(CHAIN, BODIES, motion.q), rtol=1e-10, atol=1e-12)
    M_ddq = np.einsum("nij,nj->ni", model.inertia(theta, motion.q), motion.ddq)
    assert_allclose(model.bias(theta, motion) + M_ddq, tau, rtol=1e-10, atol=1e-10)
    assert 0 < np.flatnonzero(known)[0] < 400


@pytest.mark.parametrize("name", FILTERS)
def test_a_filter_tracks_each_joint_of_a_coupled_arm_with_what_the_model_says_of_it(name):
    model, motion, theta = CoupledArm(0.02), wandering(4000), truth()
    tau, t = model.regressor(motion).Phi @ theta, np.arange(4000) * T_S
    noise, rng = NoiseModel(1e-5, 1e-4, 1e-5, 2e-4, 0.02), np.random.default_rng(1)
    for i, joint in enumerate(model.joint_dynamics(theta, motion)):
        push = np.where((t > 8) & (t < 12), 1.0, 0.0)
        y = (motion.q[:, i] + 1e-5 * rng.normal(size=4000), motion.dq[:, i] + 1e-4 * rng.normal(size=4000))
        made = tracker(name)(joint, *y, tau[:, i] + push, T_S, noise, 1.0)
        inside, outside = (t > 9) & (t < 12), (t > 1) & (t < 8)
        # A filter that knew nothing of the other joint and of the deflection would be off by what they make of tau.
        assert np.abs(made.tau_ext[outside]).mean() < 0.15 < 0.3 * np.abs(joint.known).max()
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
        kernels.bias(told.coefficients, q, dq, 0.0)[0] for q, dq in zip(motion.q[:, 0], motion.dq[:, 0], strict=True)
    ]
    tau = told.inertia * motion.ddq[:, 0] + np.array(scalar) + told.known
    assert_allclose(tau, (model.regressor(motion).Phi @ theta)[:, 0], rtol=1e-12, atol=1e-13)
    assert_allclose(told.known, 0.4 * deflection(motion, 0, DAHL.displacement)[0], atol=1e-15)


def test_a_deflection_is_that_of_the_differential_equation():
    """x_0 dz/dt = dq (1 - z sign dq) [Dahl 1968], which at constant velocity has a closed form."""
    N, v, x_0 = 200, 0.03, 0.01
    motion = Motion(np.zeros((N, 1)), np.full((N, 1), -v), np.zeros((N, 1)), T_S, np.zeros(N, int))
    z, _ = deflection(motion, 0, x_0)
    assert_allclose(z, -(1 - np.exp(-v * np.arange(N) * T_S / x_0)), rtol=1e-12, atol=1e-15)


def test_a_deflection_starts_anew_after_a_gap_and_is_known_after_a_few_displacements_of_travel():
    motion, x_0 = column(wandering(4000, segments=4)), 0.02
    z, known = deflection(motion, 0, x_0)
    for start in range(0, 4000, 1000):
        part = slice(start, start + 1000)
        alone, _ = deflection(Motion(*(x[part] for x in motion[:3]), T_S, motion.segment[part]), 0, x_0)
        assert_allclose(z[part], alone, atol=0)
        first = int(np.flatnonzero(known[part])[0])
        # Whatever the deflection was at the start, it is forgotten where it counts as known.
        other = [1.0]
        for dq in motion.dq[part, 0][:first]:
            other.append(float(derivation.deflect(other[-1], dq, T_S, x_0)))
        assert abs(other[-1] - z[start + first]) < 1.5 * np.exp(-3.0)


def test_a_deflection_of_a_period_ends_where_it_starts():
    motion = column(wandering(2000, periodic=True))
    z, known = deflection(motion, 0, 0.02)
    assert known.all()
    after = derivation.deflect(z[-1], motion.dq[-1, 0], T_S, 0.02)
    assert after == pytest.approx(z[0], abs=1e-12)


def test_a_term_of_an_unknown_function_or_without_its_displacement_is_refused():
    with pytest.raises(ValueError, match="no functions \\['sin dq'\\]"):
        terms.Term("odd", "x", "1", b={"sin dq": 1.0})
    with pytest.raises(ValueError, match="displacement"):
        replace(DAHL, displacement=0.0)
