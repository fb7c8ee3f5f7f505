"""A hand against tissue without delay: the Lyapunov function, the worst switching, and the switching there is."""

import time

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.integrate import solve_ivp
from scipy.optimize import brentq
from scipy.sparse import csc_array

from davinci_forces.haptics.maths import bimodal, lmi
from davinci_forces.haptics.maths.bimodal import (
    Hand,
    cqlf_limit,
    energy,
    log_growth,
    mode,
    simulate_switching,
    switching_limit,
    worst,
)
from davinci_forces.maths.estimation import conic

HANDS = (Hand(1.0, 1.0, 100.0), Hand(1.0, 30.0, 100.0), Hand(0.2, 0.05, 2000.0), Hand(1.0, 20.0, 100.0))


def hands(n: int, seed: int):
    """Hands from far below to far above critical damping."""
    rng = np.random.default_rng(seed)
    for m, b, k in 10 ** rng.uniform([-1.0, -1.0, 0.0], [1.0, 1.5, 4.0], (n, 3)):
        yield Hand(float(m), float(b), float(k)), rng


def test_the_inequality_and_the_closed_form_agree_up_to_a_hundredth_of_the_border():
    sides = []
    for hand, rng in hands(250, 0):
        share = 1.0 + rng.choice([-1.0, 1.0]) * rng.uniform(0.01, 0.5)
        found = lmi.cqlf_exists(hand, share * cqlf_limit(hand))
        assert found == (share < 1.0), (hand, share)
        sides.append(found)
    assert 90 < sum(sides) < 160


@pytest.mark.parametrize("hand", HANDS)
def test_the_closed_form_is_where_the_product_of_both_modes_begins_to_have_a_negative_eigenvalue(hand):
    def negative(k_t):
        found = np.linalg.eigvals(mode(hand, k_t) @ mode(hand, 0.0))
        return bool(np.any((np.abs(found.imag) < 1e-9 * np.abs(found)) & (found.real < 0.0)))

    assert [negative(share * cqlf_limit(hand)) for share in (0.5, 0.99, 1.01)] == [False, False, True]


def test_a_map_takes_little_longer_than_its_bare_solves():
    import clarabel

    hand, k_t = HANDS[0], np.linspace(1.0, 60.0, 900)
    A, bound = lmi.inequality(hand, 20.0)
    settings, cones, nothing = conic.settings(lmi.TOLERANCE), [clarabel.PSDTriangleConeT(2)] * 3, csc_array((3, 3))

    def bare():
        for _ in k_t:
            clarabel.DefaultSolver(nothing, np.array([0.0, 0.0, -1.0]), A, bound, cones, settings).solve()

    assert least_time(lambda: [lmi.cqlf_exists(hand, k) for k in k_t.tolist()]) < 5.0 * least_time(bare)


def least_time(work) -> float:
    """The least of three, which what else the machine does lengthens least."""
    taken = []
    for _ in range(3):
        start = time.perf_counter()
        work()
        taken.append(time.perf_counter() - start)
    return min(taken)


@pytest.mark.parametrize("hand", HANDS)
def test_the_worst_switching_grows_beyond_its_limit_and_dies_out_below(hand):
    limit = switching_limit(hand)
    assert limit > cqlf_limit(hand)
    for share in (0.97, 1.03):
        run = simulate_switching(
            hand, share * limit, (0.0, 1.0), 12.0 / hand.frequency * (1.0 + hand.damping_ratio()), worst
        )
        speeds = [at_the_axis(hand, share * limit, run, i) for i in np.flatnonzero(np.diff(np.sign(run.x[1:]))) + 1]
        assert len(speeds) > 2
        assert (speeds[-1] > speeds[0]) == (share > 1.0)
        grown = np.log(speeds[-1] / speeds[0]) / (len(speeds) - 1)
        assert_allclose(grown, log_growth(hand, share * limit), rtol=1e-6, atol=1e-12)


def at_the_axis(hand, k_t, run, i):
    """The speed at which a run comes back to x = 0 after sample i."""
    t = brentq(lambda t: bimodal.flow(hand, k_t, (run.x[i], run.dx[i]), t)[0], 0.0, run.t[1])
    return abs(bimodal.flow(hand, k_t, (run.x[i], run.dx[i]), t)[1])


@pytest.mark.parametrize("share", [0.9, 0.97])
def test_no_switching_at_random_grows_below_the_limit(share):
    """Of many laws that switch on lines through the origin, none does worse than the worst."""
    rng = np.random.default_rng(1)
    hand = HANDS[0]
    k_t = share * switching_limit(hand)
    for angle in rng.uniform(0.0, np.pi, (30, 2)):
        (a, b), (c, d) = np.cos(angle), np.sin(angle)
        law = lambda x, dx, a=a, b=b, c=c, d=d: (a * x + c * dx / hand.frequency) * (b * x + d * dx / hand.frequency)
        run = simulate_switching(hand, k_t, (0.01, 0.0), 12.0, law)
        first, last = (np.hypot(run.x[part], run.dx[part] / 10.0).max() for part in (slice(0, 100), slice(-100, None)))
        assert last < first


def test_the_energy_never_rises_where_the_tissue_acts_on_one_side_of_its_surface_only():
    """100 runs beyond every limit of arbitrary switching."""
    for hand, rng in hands(100, 2):
        k_t = cqlf_limit(hand) * 10 ** rng.uniform(0.0, 2.0)
        x, dx = rng.normal(size=2) * [0.01, 0.01 * hand.frequency]
        run = simulate_switching(hand, k_t, (float(x), float(dx)), 10.0 / hand.frequency)
        V = energy(hand, k_t, run.x, run.dx)
        assert np.diff(V).max() <= 1e-13 * V[0]
        assert_allclose(V[0] - V[-1], hand.b * np.trapezoid(run.dx**2, run.t), rtol=1e-2)


def test_a_run_is_that_of_a_solver_of_differential_equations():
    hand, k_t = HANDS[0], 457.24
    run = simulate_switching(hand, k_t, (-0.01, 0.5), 3.0)

    def rate(t, state):
        return state[1], -(hand.k * state[0] + hand.b * state[1] + k_t * max(state[0], 0.0)) / hand.m

    solved = solve_ivp(rate, (0.0, run.t[-1]), (-0.01, 0.5), t_eval=run.t, rtol=1e-10, atol=1e-13, max_step=1e-3)
    assert_allclose(run.x, solved.y[0], atol=1e-8)
    assert_allclose(run.dx, solved.y[1], atol=1e-7)


def test_a_mode_flows_as_its_matrix_says():
    from scipy.linalg import expm

    for hand in (*HANDS, Hand(1.0, 20.0, 100.0)):
        for k_t in (0.0, 300.0):
            expected = expm(mode(hand, k_t) * 0.07) @ [0.3, -2.0]
            assert_allclose(bimodal.flow(hand, k_t, (0.3, -2.0), 0.07), expected, rtol=1e-10)
