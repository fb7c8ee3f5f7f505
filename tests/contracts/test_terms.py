"""Every term of a joint's model: its parts are those of one expression, and its unit is that of what it multiplies."""

import re

import numpy as np
import pytest
from numpy.testing import assert_allclose

from davinci_forces.exports import c as exported
from davinci_forces.exports import identified
from davinci_forces.filters import online, stepping
from davinci_forces.maths.models import terms
from davinci_forces.maths.models.independent import bias_coefficients, inertia_of, regressor
from davinci_forces.maths.models.memory import friction_state
from davinci_forces.maths.models.model import ArmMotion
from davinci_forces.maths.models.terms import OF_MOTION, TERMS, Z_OF_MOTION, Term
from davinci_forces.maths.models.terms import bias as bias_of
from davinci_forces.report.writers.typesetting import Formula, draw_formulas
from davinci_forces.robots.robot import Kind
from tests.conftest import ROOT
from tests.contracts.dimensions import has_a_dimension, is_effort

TERM = pytest.mark.parametrize("term", TERMS.values(), ids=TERMS)
random = np.random.default_rng(0)
Q = random.uniform(-1.0, 1.0, 200)
DQ = random.uniform(0.05, 1.2, 200) * random.choice([-1.0, 1.0], 200)  # away from the jump at standstill


def bias(term, q, dq) -> np.ndarray:
    """b, b_q and b_dq (3, N), as the filter's loop has them."""
    c = bias_coefficients((term,), np.ones(1))
    return np.array([stepping.bias(c, *x, 0.0) for x in zip(q.tolist(), dq.tolist(), strict=True)]).T


def test_a_function_of_the_motion_stands_wherever_a_program_needs_it():
    """In the analysis, in the stream, which stands alone, and in C, by their order; static ones hold a resting arm."""
    names = list(Z_OF_MOTION)
    assert list(online.Z_OF_MOTION) == names, "add the function to filters/online.py, too"
    for name, function in Z_OF_MOTION.items():
        for q, dq in ((0.3, -0.7), (-1.2, 0.4)):
            assert online.Z_OF_MOTION[name](q, dq) == pytest.approx(float(function(q, dq)), rel=1e-12), name
        at_rest = any(function(np.array(q), np.array(0.0)) != 0.0 for q in (0.3, 1.1))
        assert (name in identified.STATIC) == at_rest, f"correct STATIC of exports/identified.py for {name}"
    code = (ROOT / "pipeline/davinci_forces/exports/model.c").read_text().partition("of[] = {")[2].partition("};")[0]
    in_c = [part for part in re.sub(r"\([^()]*\)", "", re.sub(r"\([^()]*\)", "", code)).split(",") if part.strip()]
    assert len(in_c) == len(exported.KINDS), "add the function to `state` in exports/model.c, in the same place"


def test_every_term_is_listed_under_its_name():
    written = [value for value in vars(terms).values() if isinstance(value, Term)]
    assert {term.name: term for term in written} == TERMS
    assert len(TERMS) == len(written)


@TERM
def test_derivatives_are_those_of_finite_differences(term):
    _, b_q, b_dq = bias(term, Q, DQ)
    h = 1e-6
    by_q = (bias(term, Q + h, DQ)[0] - bias(term, Q - h, DQ)[0]) / (2 * h)
    by_dq = (bias(term, Q, DQ + h)[0] - bias(term, Q, DQ - h)[0]) / (2 * h)
    # Truncation is h^2/6 times the third derivative, below 1e4 for what bends within a hundredth of a radian or metre;
    # rounding is 1e-16 |b| / h.
    assert_allclose(b_q, by_q, rtol=0, atol=1e-8)
    assert_allclose(b_dq, by_dq, rtol=0, atol=1e-8)


@TERM
def test_arrays_and_scalars_give_the_same(term):
    """At standstill and at zero, too; numpy and math differ in the last bits of a sine."""
    q, dq = (np.append(x, [0.0, 0.0, 0.3]) for x in (Q, DQ))
    dq[-3:] = 0.0, 0.4, 0.0
    phi = regressor((term,), q, dq, np.zeros_like(q))[:, 0]
    assert phi.shape == q.shape
    assert_allclose(bias(term, q, dq)[0], phi, rtol=1e-14, atol=1e-15)


def test_all_terms_together_are_one_model_in_the_regressor_and_in_the_loop():
    model, theta = tuple(TERMS.values()), random.uniform(0.5, 2.0, len(TERMS))
    c = bias_coefficients(model, theta)
    for q, dq in [(0.3, -0.2), (-0.4, 0.7), (0.1, 0.0)]:
        [phi] = regressor(model, np.array([q]), np.array([dq]), np.zeros(1))
        assert stepping.bias(c, q, dq, 0.0)[0] == pytest.approx(phi @ theta, rel=1e-14)
        assert_allclose(stepping.bias(c, q, dq, 0.0), bias_of(c, q, dq, 0.0), rtol=1e-14)


@TERM
def test_a_term_is_linear_in_acceleration_with_its_slope_a(term):
    ddq = random.uniform(-3.0, 3.0, len(Q))
    still, one, two = (regressor((term,), Q, DQ, k * ddq)[:, 0] for k in (0, 1, 2))
    assert_allclose(one - still, term.a * ddq, rtol=0, atol=1e-14)  # g and ddq round at 1e-15
    assert_allclose(two - still, 2 * term.a * ddq, rtol=0, atol=1e-14)
    assert inertia_of((term,), np.array([2.0])) == 2.0 * term.a


@TERM
def test_some_motion_excites_a_term(term):
    phi = regressor((term,), Q, DQ, random.uniform(-3.0, 3.0, len(Q)))
    assert np.abs(phi).max() > 0.01
    assert np.isfinite(phi).all()


@pytest.mark.parametrize("term", OF_MOTION.values(), ids=OF_MOTION)
def test_a_term_of_the_motion_is_its_function(term):
    q, dq = np.array([[0.3], [-0.2]]), np.array([[0.4], [-0.5]])
    z, known = friction_state(ArmMotion(q, dq, dq, 0.01, np.zeros(2, np.int64)), 0, term)
    names = {"abs": np.abs, "sign": np.sign, "sin": np.sin, "cos": np.cos, "q": q[:, 0], "v": dq[:, 0]}
    phi = term.typst.replace("dot(q)", "v").replace('op("sign")', "sign").replace("^", "**")
    phi = re.sub(r"(?<=[\w)]) (?=\w)", " * ", phi)
    assert_allclose(z, eval(phi, names), rtol=1e-14)
    assert known.all()


@pytest.mark.parametrize("term", [*TERMS.values(), *OF_MOTION.values()], ids=[*TERMS, *OF_MOTION])
def test_the_unit_is_that_of_an_effort_over_the_term(term):
    """For every kind of joint that the term is for: gravity's sine is for those that turn, a lifted mass for slides."""
    kinds = [kind for kind in Kind if has_a_dimension(term, kind)]
    assert kinds
    assert [kind for kind in kinds if not is_effort(term, kind)] == []
    assert [kind for kind in kinds if not is_effort(term, kind, "A")] == []


def test_every_term_can_be_typeset():
    formulas = [Formula(term.typst, True) for term in (*TERMS.values(), *OF_MOTION.values())]
    assert set(draw_formulas(formulas)[0]) == set(formulas)
