"""How fast the dynamics of many samples are, beside Pinocchio called once a sample from Python."""

import time
from collections.abc import Callable

import numpy as np
import pytest

from davinci_forces.maths.mechanics import rigid_body
from davinci_forces.robots.davinci_chain import BODIES, CHAIN
from tests.robot.pinocchio_arm import tree

pin = pytest.importorskip("pinocchio", reason="Pinocchio, the rival, is not installed: `make bench` installs it")

n = 6
ROUNDS, OURS = 5, 8


def seconds(ours: Callable[[], object], theirs: Callable[[], object]) -> tuple[float, float]:
    """The shortest of some runs of each, by turns: what else the machine does can only add, and it comes and goes.

    Ours are run more often because they are shorter, and so have the same chance of an undisturbed one.
    """
    best = [np.inf, np.inf]
    for _ in range(ROUNDS):
        for which, f in [(0, ours)] * OURS + [(1, theirs)]:
            start = time.perf_counter()
            f()
            best[which] = min(best[which], time.perf_counter() - start)
    return best[0], best[1]


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
    motions = np.random.default_rng(0).uniform(-1, 1, (3, N, n))
    in_tree = np.ascontiguousarray(motions @ arm.E.T)
    ours(*motions)  # compiles
    took, rival = seconds(
        lambda: ours(*motions), lambda: [theirs(arm, *motion) for motion in zip(*in_tree, strict=True)]
    )
    with capsys.disabled():
        print(
            f"\n{name}: {N} samples in {took:.4f} s ({took / N * 1e6:.2f} us each), Pinocchio {rival:.3f} s "
            f"({rival / N * 1e6:.2f} us): {rival / took:.1f} times faster",
            end="",
        )
    assert rival / took >= (times if full else times / 2)
