"""The compiled kernels, against the same dynamics in numpy."""

import os
import subprocess
import sys

import numpy as np
import pytest
from numba import njit
from scipy.integrate import solve_ivp

from davinci_forces.maths.constants import GRAVITY
from davinci_forces.maths.mechanics import kernels, rigid_body
from davinci_forces.robots.davinci import BODIES, CHAIN
from tests.robot import lagrangian

N = 3 * kernels.LANES + 1  # three full rows of samples, and one more
SIZES = pytest.mark.parametrize("n", [3, 6, 7])


def motions(n: int, scale: float = 1.5) -> np.ndarray:
    return np.random.default_rng(n).uniform(-scale, scale, (3, N, n))


@pytest.fixture
def compiled(monkeypatch):
    """Calls a function twice: as for few samples, and as for many."""

    def both(f):
        few = f()
        monkeypatch.setattr(rigid_body, "COMPILE_FROM", 1)
        return few, f()

    return both


@SIZES
def test_many_samples_have_the_efforts_that_few_have(n, compiled):
    q, dq, ddq = motions(n)
    few, many = compiled(lambda: rigid_body.inverse_dynamics(CHAIN, BODIES, q, dq, ddq))
    np.testing.assert_allclose(many, few, rtol=0, atol=1e-12)


@SIZES
def test_many_samples_have_the_mass_matrices_that_few_have(n, compiled):
    q, _, _ = motions(n)
    few, many = compiled(lambda: rigid_body.mass_matrix(CHAIN, BODIES, q))
    np.testing.assert_allclose(many, few, rtol=0, atol=1e-13)


@pytest.mark.parametrize("n", [3, 6, 7])
@pytest.mark.parametrize("samples", [1, 2, kernels.LANES - 1, kernels.LANES, kernels.LANES + 1, N])
def test_the_kernels_give_the_regressors_of_few_samples_and_of_many(samples, n):
    motion = motions(n)[:, :samples]
    expected = rigid_body.regressor(CHAIN, *motion)
    np.testing.assert_allclose(rigid_body.compiled_regressor(CHAIN, *motion), expected, rtol=0, atol=1e-12)


@pytest.mark.parametrize(("rows", "L"), [((0,), 5), ((1, 2), 9), ((2, 0), 2), ((1,), 0)])
def test_some_efforts_of_the_first_links_are_those_of_the_whole_regressor(rows, L):
    whole = rigid_body.regressor(CHAIN, *motions(3))
    part = rigid_body.regressor(CHAIN, *motions(3), rows, L)
    np.testing.assert_array_equal(part, whole[:, list(rows), : 10 * L])


def test_many_samples_have_the_coriolis_efforts_and_gravity_that_few_have(compiled):
    q, dq, _ = motions(6)
    both = compiled(lambda: [rigid_body.coriolis(CHAIN, BODIES, q, dq), rigid_body.gravity(CHAIN, BODIES, q)])
    np.testing.assert_allclose(both[1], both[0], rtol=0, atol=1e-12)


def test_samples_may_have_any_leading_axes_and_any_order_in_memory(compiled):
    q, dq, ddq = np.asfortranarray(motions(6)[:, :36]).reshape(3, 4, 9, 6)
    few, many = compiled(lambda: rigid_body.inverse_dynamics(CHAIN, BODIES, q[:, ::2], dq[:, ::2], ddq[:, ::2]))
    np.testing.assert_allclose(many, few, rtol=0, atol=1e-12)


def test_one_sample_is_no_exception(compiled):
    q, dq, ddq = motions(3)[:, 0]
    few, many = compiled(lambda: rigid_body.inverse_dynamics(CHAIN, BODIES, q, dq, ddq))
    np.testing.assert_allclose(many, few, rtol=0, atol=1e-12)


@SIZES
def test_one_sample_s_mass_matrix_and_bias_come_out_of_compiled_code(n):
    arm = rigid_body.moving_tree(CHAIN, BODIES, n)
    mass_and_bias = kernels.mass_and_bias

    @njit
    def step(arm, q, dq, M, bias):
        mass_and_bias(arm, GRAVITY, q, dq, M, bias)

    M, bias = np.empty((n, n)), np.empty(n)
    for q, dq in motions(n)[:2].swapaxes(0, 1)[:5]:
        step(arm, q, dq, M, bias)
        np.testing.assert_allclose(M, rigid_body.mass_matrix(CHAIN, BODIES, q), rtol=0, atol=1e-13)
        still = rigid_body.inverse_dynamics(CHAIN, BODIES, q, dq, 0 * q)
        np.testing.assert_allclose(bias, still, rtol=0, atol=1e-12)


@pytest.mark.parametrize(("n", "least"), [(3, 1.0), (6, 0.1)])
def test_an_arm_that_falls_freely_keeps_its_energy(n, least):
    arm, M, bias = rigid_body.moving_tree(CHAIN, BODIES, n), np.empty((n, n)), np.empty(n)

    def rates(_, x):
        kernels.mass_and_bias(arm, GRAVITY, x[:n].copy(), x[n:].copy(), M, bias)
        return np.concatenate([x[n:], np.linalg.solve(M, -bias)])

    start = np.concatenate(motions(n, 0.5)[:2, 0])
    run = solve_ivp(rates, (0, 1), start, method="DOP853", rtol=1e-11, atol=1e-12)
    q, dq = run.y[:n].T, run.y[n:].T
    kinetic = lagrangian.kinetic(CHAIN, BODIES, q, dq)
    total = kinetic + lagrangian.potential(CHAIN, BODIES, q)
    assert np.abs(total - total[0]).max() < 1e-9
    assert np.ptp(kinetic) > least  # it did fall


BYTES = """
import hashlib, numpy as np
from davinci_forces.maths.mechanics import kernels, rigid_body
from davinci_forces.robots.davinci import BODIES, CHAIN
rigid_body.COMPILE_FROM = 1
q, dq, ddq = np.random.default_rng(0).uniform(-3, 3, (3, 1001, 6))
M, bias, J, arm = np.empty((6, 6)), np.empty(6), np.empty((3, 6)), rigid_body.moving_tree(CHAIN, BODIES, 6)
kernels.mass_and_bias(arm, 9.81, q[0], dq[0], M, bias)
kernels.place_and_jacobian(arm, 8, (0.1, 0.2, 0.3), q[0], J)
results = (
    rigid_body.inverse_dynamics(CHAIN, BODIES, q, dq, ddq), rigid_body.mass_matrix(CHAIN, BODIES, q),
    rigid_body.compiled_regressor(CHAIN, q, dq, ddq), M, bias, J,
)
print(hashlib.sha256(b"".join(x.tobytes() for x in results)).hexdigest())
"""


@pytest.mark.slow
def test_every_processor_computes_the_same_bytes(tmp_path):
    """No multiplication is fused with an addition, and sine and cosine are the library's."""

    def sha256(**processor):
        host = {name: value for name, value in os.environ.items() if not name.startswith("NUMBA_CPU")}
        code, environment = [sys.executable, "-c", BYTES], host | processor
        return subprocess.run(code, env=environment, capture_output=True, text=True, check=True).stdout

    generic = {"NUMBA_CPU_NAME": "generic", "NUMBA_CPU_FEATURES": "", "NUMBA_CACHE_DIR": str(tmp_path)}
    assert sha256(**generic) == sha256()


def test_links_that_nothing_moves_become_part_of_those_that_carry_them():
    for n, links in ((3, 5), (6, 8), (7, 9)):
        assert len(rigid_body.moving_tree(CHAIN, BODIES, n).parent) == links
    total = rigid_body.moving_tree(CHAIN, BODIES, 3).rows[:, 12].sum()
    assert total == pytest.approx(BODIES.with_coordinates(3).masses.sum())


def test_a_sample_that_is_not_a_number_spoils_no_other(compiled):
    q, dq, ddq = motions(6)
    q[0] = dq[20] = np.nan
    good = np.setdiff1d(np.arange(N), [0, 20])
    of_both = compiled(lambda: rigid_body.inverse_dynamics(CHAIN, BODIES, q, dq, ddq))
    regressors = [f(CHAIN, q, dq, ddq) for f in (rigid_body.regressor, rigid_body.compiled_regressor)]
    for found in (*of_both, *regressors):
        assert np.isfinite(found[good]).all()
        assert np.isnan(found[0]).any()
