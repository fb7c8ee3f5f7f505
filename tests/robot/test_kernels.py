"""The compiled kernels, against the same dynamics in numpy."""

import os

import numpy as np
import pytest
from numba import njit
from scipy.integrate import solve_ivp

from pipeline.maths.constants import GRAVITY
from pipeline.maths.mechanics import lanes, link, rigid_body, sample, samples
from pipeline.robots.davinci_chain import BODIES, CHAIN

N = 2 * lanes.LANES + 5  # two full blocks and one that is not
SIZES = pytest.mark.parametrize("n", [3, 6, 7])


def motions(n: int, scale: float = 1.5) -> np.ndarray:
    return np.random.default_rng(n).uniform(-scale, scale, (3, N, n))


@pytest.fixture
def compiled(monkeypatch):
    """Calls a function twice: as for few samples, and as for many."""

    def both(f):
        few = f()
        monkeypatch.setattr(samples, "COMPILE_FROM", 1)
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


@SIZES
def test_many_samples_have_the_regressors_that_few_have(n, compiled):
    few, many = compiled(lambda: rigid_body.regressor(CHAIN, *motions(n)))
    np.testing.assert_allclose(many, few, rtol=0, atol=1e-12)


def test_many_samples_have_the_coriolis_efforts_and_gravity_that_few_have(compiled):
    q, dq, _ = motions(6)
    both = compiled(lambda: [rigid_body.coriolis(CHAIN, BODIES, q, dq), rigid_body.gravity(CHAIN, BODIES, q)])
    np.testing.assert_allclose(both[1], both[0], rtol=0, atol=1e-12)


def test_samples_may_have_any_leading_axes_and_any_order_in_memory(compiled):
    q, dq, ddq = np.asfortranarray(motions(6)[:, :36]).reshape(3, 4, 9, 6)
    few, many = compiled(lambda: rigid_body.inverse_dynamics(CHAIN, BODIES, q[:, ::2], dq[:, ::2], ddq[:, ::2]))
    np.testing.assert_allclose(many, few, rtol=0, atol=1e-12)


@SIZES
def test_one_sample_s_mass_matrix_and_bias_come_out_of_compiled_code(n):
    arm = lanes.pack(CHAIN, BODIES, n)
    mass_and_bias = sample.mass_and_bias

    @njit
    def step(arm, q, dq, M, bias, work):
        mass_and_bias(arm, GRAVITY, q, dq, M, bias, work)

    M, bias, work = np.empty((n, n)), np.empty(n), sample.work(arm)
    for q, dq in motions(n)[:2].swapaxes(0, 1)[:5]:
        step(arm, q, dq, M, bias, work)
        np.testing.assert_allclose(M, rigid_body.mass_matrix(CHAIN, BODIES, q), rtol=0, atol=1e-13)
        still = rigid_body.inverse_dynamics(CHAIN, BODIES, q, dq, 0 * q)
        np.testing.assert_allclose(bias, still, rtol=0, atol=1e-12)


def test_an_arm_of_six_joints_that_falls_freely_keeps_its_energy():
    arm, M, bias = lanes.pack(CHAIN, BODIES, 6), np.empty((6, 6)), np.empty(6)
    work = sample.work(arm)

    def rates(_, x):
        sample.mass_and_bias(arm, GRAVITY, x[:6].copy(), x[6:].copy(), M, bias, work)
        return np.concatenate([x[6:], np.linalg.solve(M, -bias)])

    start = np.concatenate(motions(6, 0.5)[:2, 0])
    run = solve_ivp(rates, (0, 1), start, method="DOP853", rtol=1e-11, atol=1e-12)
    total = sum(rigid_body.energy(CHAIN, BODIES, run.y[:6].T, run.y[6:].T))
    assert np.abs(total - total[0]).max() < 1e-9


def test_cosine_and_sine_are_those_of_the_library_in_every_quadrant():
    @njit
    def both(x):
        c, s = np.empty(len(x)), np.empty(len(x))
        for i in range(len(x)):
            c[i], s[i] = link.cosine_sine(x[i])
        return c, s

    near = np.arange(-9, 10) * np.pi / 4  # where quadrants meet
    x = np.concatenate([near, near + 1e-9, near - 1e-9, np.linspace(-30, 30, 2001), [0.0, 1e5, -1e5]])
    c, s = both(x)
    np.testing.assert_allclose(c, np.cos(x), rtol=0, atol=1e-15)
    np.testing.assert_allclose(s, np.sin(x), rtol=0, atol=1e-15)


def test_links_that_are_held_for_good_become_part_of_those_that_carry_them():
    for n, links in ((3, 6), (6, 9), (7, 10)):
        assert len(lanes.pack(CHAIN, BODIES, n).parent) == links
    assert len(lanes.pack(CHAIN, BODIES, 3, fold=False).parent) == 10
    total = lanes.pack(CHAIN, BODIES, 3).links[:, 6].sum()
    assert total == pytest.approx(BODIES.counted(3).masses.sum())


def test_compiled_code_that_is_older_than_the_physics_it_holds_is_dropped(tmp_path):
    class Kernel:
        class stats:  # noqa: N801
            cache_path = str(tmp_path)

        py_func = lanes.forget_older

    newest = max(os.path.getmtime(m.__file__) for m in (link, lanes))
    stale, current, other = (
        tmp_path / f"m.{name}-1.py311.nbi" for name in (Kernel.py_func.__name__, f"{Kernel.py_func.__name__}", "other")
    )
    current = current.with_name(current.name.replace("-1.", "-2."))
    for file, age in ((stale, -10), (current, 10), (other, -10)):
        file.touch()
        os.utime(file, (newest + age, newest + age))
    lanes.forget_older(Kernel)
    assert not stale.exists()
    assert current.exists()
    assert other.exists()
