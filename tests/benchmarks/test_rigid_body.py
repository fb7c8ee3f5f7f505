"""How fast the dynamics of many samples are, beside Pinocchio called once a sample from Python."""

import time
from collections.abc import Callable

import numpy as np
import pytest

from davinci_forces.maths.mechanics import rigid_body
from davinci_forces.robots.davinci import BODIES, CHAIN
from tests.robot.pinocchio_arm import Tree, tree

pin = pytest.importorskip("pinocchio", reason="Pinocchio, the rival, is not installed: `make bench` installs it")

n = 6
ROUNDS, OURS = 5, 8


def motions(N: int) -> np.ndarray:
    return np.random.default_rng(0).uniform(-1, 1, (3, N, n))


def in_tree(arm: Tree, motion: np.ndarray) -> np.ndarray:
    return np.ascontiguousarray(motion @ arm.E.T)


def seconds(
    make: Callable[[], np.ndarray], ours: Callable[[np.ndarray], object], theirs: Callable[[np.ndarray], object]
) -> tuple[float, float]:
    """The shortest of some runs of each, by turns, of motions made anew: what else the machine does can only add.

    Ours are run more often because they are shorter, and so have the same chance of an undisturbed one.
    """
    best = [np.inf, np.inf]
    for _ in range(ROUNDS):
        for which, f in [(0, ours)] * OURS + [(1, theirs)]:
            motion = make()
            start = time.perf_counter()
            f(motion)
            best[which] = min(best[which], time.perf_counter() - start)
    return best[0], best[1]


def agree(name: str, arm: Tree, ours: Callable[..., np.ndarray]) -> None:
    """Assert that ours are Pinocchio's, projected on the six coordinates; the regressor, times the parameters."""
    motion = motions(20_000)[:, :100]
    found = ours(*motions(20_000))[:100]
    for k, (q, dq, ddq) in enumerate(in_tree(arm, motion).swapaxes(0, 1)):
        upper = np.triu(pin.crba(arm.model, arm.data, q))
        gravity = pin.computeGeneralizedGravity(arm.model, arm.data, q).copy()
        tau = pin.rnea(arm.model, arm.data, q, dq, ddq).copy()
        expected = {
            "inverse dynamics": tau,
            "M": (upper + np.triu(upper, 1).T) @ arm.E,
            "C dq": pin.nonLinearEffects(arm.model, arm.data, q, dq) - gravity,
            "G": gravity,
            "regressor": tau,
        }[name]
        own = found[k] @ BODIES.parameters(n) if name == "regressor" else found[k]
        np.testing.assert_allclose(own, arm.E.T @ expected, rtol=0, atol=1e-12)


@pytest.fixture(scope="module")
def full(request):
    """Whether the promised size is asked for; else it is a fifth of it, at half the ratio."""
    return bool(request.config.getoption("--full"))


# Name, ours on all samples, Pinocchio's on one, and how many times faster ours must be.  Pinocchio gets the eight
# coordinates of its tree ready-made, and the projection on the six is not counted.
CASES = {
    "inverse dynamics": (
        lambda q, dq, ddq: rigid_body.inverse_dynamics(CHAIN, BODIES, q, dq, ddq),
        lambda arm, q, dq, ddq: pin.rnea(arm.model, arm.data, q, dq, ddq),
        8.0,
    ),
    "M": (
        lambda q, dq, ddq: rigid_body.mass_matrix(CHAIN, BODIES, q),
        lambda arm, q, dq, ddq: pin.crba(arm.model, arm.data, q),
        2.0,
    ),
    "C dq": (
        lambda q, dq, ddq: rigid_body.coriolis(CHAIN, BODIES, q, dq),
        lambda arm, q, dq, ddq: pin.computeCoriolisMatrix(arm.model, arm.data, q, dq) @ dq,
        2.0,
    ),
    "G": (
        lambda q, dq, ddq: rigid_body.gravity(CHAIN, BODIES, q),
        lambda arm, q, dq, ddq: pin.computeGeneralizedGravity(arm.model, arm.data, q),
        2.0,
    ),
    "regressor": (
        lambda q, dq, ddq: rigid_body.regressor(CHAIN, q, dq, ddq),
        lambda arm, q, dq, ddq: pin.computeJointTorqueRegressor(arm.model, arm.data, q, dq, ddq),
        2.0,
    ),
}


@pytest.mark.parametrize("name", CASES)
def test_dynamics_of_many_samples_are_faster_than_pinocchio_sample_by_sample(name, full, capsys):
    ours, theirs, times = CASES[name]
    N = (20_000 if name == "regressor" else 100_000) if full else 20_000  # 20 000 regressors fill 100 MB
    arm = tree(pin, CHAIN, BODIES, n)
    agree(name, arm, ours)  # compiles, too
    took, rival = seconds(
        lambda: motions(N),
        lambda motion: ours(*motion),
        lambda motion: [theirs(arm, *sample) for sample in zip(*in_tree(arm, motion), strict=True)],
    )
    with capsys.disabled():
        print(
            f"\n{name}: {N} samples in {took:.4f} s ({took / N * 1e6:.2f} us each), Pinocchio {rival:.3f} s "
            f"({rival / N * 1e6:.2f} us): {rival / took:.1f} times faster",
            end="",
        )
    assert rival / took >= (times if full else times / 2)
