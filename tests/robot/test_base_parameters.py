"""What motion can tell of the inertial parameters: how many combinations, which, and that they are enough."""

import numpy as np
import pytest

from davinci_forces.maths.mechanics import rigid_body
from davinci_forces.maths.mechanics.bodies import PARAMETERS, base_parameters
from davinci_forces.robots import dvrk_psm
from davinci_forces.robots.davinci import BODIES, CHAIN

PSM = dvrk_psm.PSM_CHAIN
ARMS = pytest.mark.parametrize(("chain", "n"), [(CHAIN, 3), (CHAIN, 6), (CHAIN, 7), (PSM, 3), (PSM, 6)])


def regressor(chain, n: int, seed: int, scale: float = 1.5) -> np.ndarray:
    return rigid_body.regressor(chain, *np.random.default_rng(seed).uniform(-scale, scale, (3, 200, n)))


@ARMS
def test_six_random_samples_have_the_same_base_parameters(chain, n):
    chosen = [base_parameters(regressor(chain, n, seed, scale)) for seed, scale in enumerate((0.7, 1, 1, 1.5, 2, 3))]
    assert len({tuple(base.columns) for base in chosen}) == 1
    # The same combinations, too, up to rounding by the conditioning of the samples.
    for base in chosen[1:]:
        np.testing.assert_allclose(base.combination, chosen[0].combination, rtol=0, atol=1e-8)


@ARMS
def test_they_are_as_many_as_the_regressor_s_rank_and_well_conditioned(chain, n):
    Y = regressor(chain, n, 0)
    base = base_parameters(Y)
    flat = Y.reshape(-1, Y.shape[-1])
    size = np.linalg.norm(flat, axis=0)
    scaled = flat[:, size > 1e-12] / size[size > 1e-12]  # the others are rounding
    assert len(base.columns) == np.linalg.matrix_rank(scaled, rtol=1e-10)
    assert base.condition < 1e4
    np.testing.assert_array_equal(base.combination[:, base.columns], np.eye(len(base.columns)))


@pytest.mark.parametrize("n", [3, 6, 7])
def test_they_give_the_same_effort_on_other_motions(n):
    base = base_parameters(regressor(CHAIN, n, 0))
    other = np.random.default_rng(99).uniform(-2, 2, (3, 50, n))
    beta = base.combination @ BODIES.parameters(n)
    Y = rigid_body.regressor(CHAIN, *other)[..., base.columns]
    np.testing.assert_allclose(Y @ beta, rigid_body.inverse_dynamics(CHAIN, BODIES, *other), rtol=0, atol=1e-11)


@ARMS
def test_every_other_column_depends_on_base_columns_before_it(chain, n):
    """Which is what makes the choice the same whatever the sample."""
    base = base_parameters(regressor(chain, n, 0))
    for column in set(range(base.combination.shape[1])) - set(base.columns):
        used = base.columns[np.abs(base.combination[:, column]) > 1e-8]
        assert (used < column).all()


def test_links_that_move_as_one_are_named_by_the_one_nearest_to_the_base():
    columns = base_parameters(regressor(CHAIN, 3, 0)).columns
    names = [f"{PARAMETERS[c % 10]} of {CHAIN.links[c // 10]}" for c in columns]
    assert "m of 6" in names
    assert not [name for name in names if name.endswith((" 7", " 8", " 9L", " 9R"))]
