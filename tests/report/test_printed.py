"""Pictures of what estimators, swarms and friction maps found."""

from dataclasses import fields, replace
from types import SimpleNamespace

import numpy as np
import pytest

from davinci_forces.records import Fit, FrictionMap, Origin, Residual, SwarmSearch
from davinci_forces.records.catalogue import Catalogue
from davinci_forces.report.content.marks import Line
from davinci_forces.report.context import Context
from davinci_forces.report.results import collect
from davinci_forces.report.sections.joints.details import convergence, estimators, friction_maps
from davinci_forces.robots import davinci
from davinci_forces.stages.model import fit
from tests import arm
from tests.test_estimation import trajectory


@pytest.fixture(scope="module")
def records():
    """The fits of a pitch that has the thesis's least squares parameters."""
    return list(fit.run([trajectory(arm.signal("hand_pitch"))], [], davinci.ROBOT, lowpass=17.0))


def context(records) -> Context:
    for record in records:
        object.__setattr__(
            record, "origin", Origin("x.parquet", "", dict.fromkeys((f.name for f in fields(record)), ""))
        )
    catalogue = Catalogue(lambda kind: [record for record in records if isinstance(record, kind)])
    study = SimpleNamespace(robot=davinci.ROBOT)
    return Context(catalogue, study, collect(catalogue), None)


def plain(records) -> Fit:
    return next(r for r in records if isinstance(r, Fit) and r.estimator == "lse")


def test_a_guess_that_rounding_leaves_of_nothing_is_nothing():
    made = fit.run([trajectory(arm.signal("instrument_slide"))], [], davinci.ROBOT, lowpass=17.0)
    results = context(list(made)).results
    assert results["guess.instrument_slide.inertia"].value == 0.0
    prior, lse = (results[f"fit.instrument_slide.independent.{name}.mse"].value for name in ("prior", "lse"))
    assert prior < 1.1 * lse


def test_estimators_are_drawn_over_the_averaged_effort_and_as_differences(records):
    (figure,) = estimators(context(records), plain(records))
    over, less = figure.panels
    assert over.marks[0].label == "measured"
    assert {mark.label for mark in over.marks[1:]} == {"LSE", "WLSE", "PSO"}
    assert {mark.label for mark in less.marks} == {"WLSE", "PSO"}
    by_name = {r.estimator: r for r in records if isinstance(r, Residual)}
    shown = next(mark for mark in less.marks if mark.label == "WLSE")
    np.testing.assert_array_equal(shown.y, by_name["wlse"].tau_hat - by_name["lse"].tau_hat)
    assert figure.caption.endswith("consistent and TLS are the same as least squares.")


def test_an_estimator_that_differs_from_least_squares_is_drawn_and_one_that_does_not_is_named(records):
    other = [
        replace(r, tau_hat=1.1 * r.tau_hat) if isinstance(r, Residual) and r.estimator == "consistent" else r
        for r in records
    ]
    (figure,) = estimators(context(other), plain(other))
    assert "consistent" in {mark.label for mark in figure.panels[1].marks}
    assert figure.caption.endswith("TLS is the same as least squares.")


def test_a_search_is_drawn_as_it_fell_and_said_to_reach_what_it_reached(records):
    (figure,) = convergence(context(records), "hand_pitch")
    searches = {f"{s.walls} walls": s for s in records if isinstance(s, SwarmSearch)}
    assert {mark.label for mark in figure.panels[0].marks} == set(searches)
    for mark in figure.panels[0].marks:
        assert isinstance(mark, Line)
        np.testing.assert_array_equal(mark.y, searches[mark.label].best_mse)
        assert (np.diff(mark.y) <= 0).all()
    assert "with reflecting walls it is reached" in figure.caption
    assert "with clipping walls it is exceeded" in figure.caption
    assert "21 parameters by 24 particles" in figure.caption


def test_a_friction_map_shows_both_branches_and_the_model_in_both_directions():
    dq = np.array([-0.2, -0.2, -0.1, 0.1, 0.2, 0.2])
    gaining = np.array([1, 0, 1, 1, 1, 0])
    friction = np.sign(dq) + dq
    made = FrictionMap(
        "run", "hand_roll", "independent", "lse", "friction", dq, gaining, friction + 0.1, np.ones(6), friction
    )
    (figure,) = friction_maps(context([made]), "hand_roll")
    (panel,) = figure.panels
    points = {mark.label: mark for mark in panel.marks if not isinstance(mark, Line)}
    assert {name: len(mark.x) for name, mark in points.items()} == {"gaining speed": 4, "losing speed": 2}
    lines = [mark for mark in panel.marks if isinstance(mark, Line)]
    assert [sorted(set(np.sign(line.x))) for line in lines] == [[-1.0], [1.0]]
    assert list(friction_maps(context([]), "hand_roll")) == []
