"""Choosing a model: refits without parts of the path against refits from scratch, ridges, and which candidate wins."""

from dataclasses import replace
from types import SimpleNamespace
from typing import NamedTuple

import numpy as np
import pytest
from numpy.testing import assert_allclose

from davinci_forces.identification import unseen
from davinci_forces.identification.candidates import Candidate, CandidatePart, Library, share_parameters, weights_of
from davinci_forces.identification.chosen import LAST_DIGIT, Selection, better, reason, scores
from davinci_forces.identification.observations import CellEquations, Observed
from davinci_forces.identification.unseen import RefitModel
from davinci_forces.maths.selection import (
    MAX_GROUPS,
    PATH_BLOCKS,
    CrossValidation,
    LeftOut,
    Ridge,
    choose_candidate,
    combine_efforts,
    covariance,
    path_blocks,
    penalty,
    schemes_of,
    side_by_side,
    solve,
    standard_error,
    sum_equations,
)
from davinci_forces.records import Choice, Diagnostic
from davinci_forces.records.prediction import CHOSEN
from davinci_forces.robots import davinci
from davinci_forces.robots.models import independent
from davinci_forces.stages.model import choose

RNG = np.random.default_rng(3)
N, P, CELLS = 600, 4, 6
PHI = RNG.normal(size=(N, 1, P))
TAU = PHI @ np.array([1.0, -2.0, 0.5, 3.0]) + 0.1 * RNG.normal(size=(N, 1))
CELL = RNG.integers(0, CELLS, N)
PLAIN = Ridge(0.0, np.ones(1), np.zeros((0, 0)))


def test_leaving_cells_out_is_least_squares_on_the_other_rows():
    equations = sum_equations(PHI, TAU, CELL, CELLS)
    out = np.arange(CELLS) < 2
    kept = ~out[CELL]
    theta, *_ = np.linalg.lstsq(PHI[kept, 0], TAU[kept, 0])
    assert_allclose(solve(equations.sum_groups([~out]), PLAIN), theta, rtol=1e-10)
    error = TAU[~kept, 0] - PHI[~kept, 0] @ theta
    assert equations.sum_groups([out]).errors(theta)[0, 0] == pytest.approx(error @ error, rel=1e-9)


def test_logs_side_by_side_are_those_gathered_together_and_one_that_is_not_there_counts_nothing():
    log = np.arange(N) * 3 // N
    parts = [sum_equations(PHI[log == i], TAU[log == i], CELL[log == i], CELLS) for i in (0, 2)]
    there = log != 1
    together = sum_equations(PHI[there], TAU[there], (CELL + CELLS * log)[there], 4 * CELLS)
    for whole, placed in zip(together, side_by_side(parts, (0, 2), 4), strict=True):
        assert_allclose(placed, whole, rtol=0, atol=0)


def test_refits_that_several_logs_ask_for_are_made_once(monkeypatch):
    """Or of a thousand logs each would sum the equations of all again."""
    model = independent(davinci.ROBOT.joint("hand_roll"))
    p = len(model.parameters)
    Phi = RNG.normal(size=(N, 1, p))
    cells = sum_equations(Phi, Phi @ np.ones(p), CELL, CELLS)
    library = Library(model, (), CellEquations(np.array([N]), np.zeros(1), cells, cells, cells))
    made = RefitModel(CandidatePart(model, library, list(range(p)), PLAIN), 1)
    solved = []
    monkeypatch.setattr(unseen, "solve", lambda *given: solved.append(given) or solve(*given))
    for out in (*np.eye(CELLS, dtype=bool), *np.eye(CELLS, dtype=bool)):
        assert_allclose(made.theta(cells, out), 1.0, rtol=1e-9)
    assert len(solved) == CELLS


def test_r2_is_the_share_of_the_effort_s_variance_whatever_its_mean():
    """A mean that a model holds, as of gravity, is no merit of its: of two efforts, each has its own."""
    theta = RNG.normal(size=PHI.shape[2])
    tau = PHI @ theta + RNG.normal(size=PHI.shape[:2]) + 50.0 * np.arange(1, PHI.shape[1] + 1)
    cells = sum_equations(PHI, tau, CELL, CELLS)
    library = SimpleNamespace(cells=CellEquations(np.full(PHI.shape[1], N), tau.sum(axis=0), cells, cells, cells))
    error = tau - PHI @ theta
    given = scores(SimpleNamespace(by_block=cells, library=library), theta)
    assert given["r2"] == pytest.approx(1.0 - (error**2).sum() / ((tau - tau.mean(axis=0)) ** 2).sum(), rel=1e-9)
    assert given["mse"] == pytest.approx((error**2).mean(axis=0).sum(), rel=1e-9)


@pytest.mark.parametrize(("period", "refit"), [([0, 0, 0, -1], [0, 0, 0, -1]), ([-1] * 4, [0] * 4)])
def test_a_log_that_is_left_out_is_predicted_in_its_periods_or_whole_if_it_has_none(period, refit):
    log = Observed((), (), np.empty((4, 0)), np.zeros(4, int), np.array(period), 17.0, 0, {})
    two = SimpleNamespace(logs={0: log, 1: log}, total=2, by_block=None)
    scheme = unseen.scheme_of_own_fits(two, log)
    assert scheme.refit.tolist() == refit
    assert scheme.out.tolist() == [[True] * PATH_BLOCKS + [False] * PATH_BLOCKS]


def test_what_is_predicted_has_not_been_seen():
    """Effort that only one cell holds is predicted from the others, which know nothing of it."""
    tau = TAU + 100.0 * (CELL == 0)[:, None] * PHI[:, :, 0]
    schemes = [np.eye(CELLS, dtype=bool)]
    by_itself = LeftOut(sum_equations(PHI, tau, CELL, CELLS), schemes).cross_validate(PLAIN)
    kept = CELL != 0
    theta, *_ = np.linalg.lstsq(PHI[kept, 0], tau[kept, 0])
    error = tau[~kept, 0] - PHI[~kept, 0] @ theta
    assert by_itself.unseen[0][0, 0] == pytest.approx(error @ error / (tau[:, 0] @ tau[:, 0]), rel=1e-9)


def test_a_ridge_is_least_squares_with_rows_of_scaled_columns():
    equations = sum_equations(PHI, TAU, CELL, 1 + CELL.max()).sum_groups([np.ones(CELLS, bool)])
    size = np.linalg.norm(PHI[:, 0], axis=0)
    rows = np.vstack([PHI[:, 0], np.sqrt(0.3) * np.diag(size)])
    theta, *_ = np.linalg.lstsq(rows, np.append(TAU[:, 0], np.zeros(P)))
    assert_allclose(solve(equations, PLAIN._replace(strength=0.3)), theta, rtol=1e-10)


def test_the_penalty_of_combinations_is_that_of_the_smallest_parts_they_can_have():
    K = RNG.normal(size=(3, 7))
    G = np.cov(RNG.normal(size=(3, 50)))
    beta, D = RNG.normal(size=3), ((G @ K) * K).sum(axis=0)
    smallest, *_ = np.linalg.lstsq(K / np.sqrt(D), beta)  # of least sum D pi^2 among all pi with K pi = beta
    assert beta @ penalty(G[None], K)[0] @ beta == pytest.approx(smallest @ smallest, rel=1e-9)


def test_dependent_columns_are_refused_unless_a_ridge_tells_them_apart():
    twice = np.concatenate([PHI, PHI[:, :, :1]], axis=2)
    equations = sum_equations(twice, TAU, CELL, CELLS).sum_groups([np.ones(CELLS, bool)])
    with pytest.raises(np.linalg.LinAlgError, match="dependent"):
        solve(equations, PLAIN)
    theta = solve(equations, PLAIN._replace(strength=1e-6))
    assert theta[0] == pytest.approx(theta[-1], rel=1e-6)


def test_the_covariance_of_parameters_is_the_textbook_s_without_a_ridge():
    equations = sum_equations(PHI, TAU, CELL, CELLS).sum_groups([np.ones(CELLS, bool)])
    expected = 0.01 * np.linalg.inv(PHI[:, 0].T @ PHI[:, 0])
    assert_allclose(covariance(equations, PLAIN, np.array([0.01])), expected, rtol=1e-9)


def test_blocks_are_sixths_of_the_period_or_of_the_recording():
    t = np.arange(1200) / 100.0
    blocks = path_blocks(t, 3.0)
    assert_allclose(np.bincount(blocks), 200, atol=4)  # a sample on an edge may fall to either side in each period
    assert np.mean(blocks[:300] == blocks[900:]) > 0.99
    assert blocks[150] == 3
    once = path_blocks(t, 0.0)
    assert_allclose(np.bincount(once), 200)
    assert (np.diff(once) >= 0).all()


@pytest.mark.parametrize("logs", [1, 2, 7, 100])
def test_every_scheme_leaves_every_cell_out_once_in_few_groups(logs):
    schemes = schemes_of(np.ones((logs * PATH_BLOCKS, 1)), [3] * logs)
    assert len(schemes) == (2 if logs == 1 else 3)
    for groups in schemes:
        assert_allclose(groups.sum(axis=0), 1)
    assert sum(map(len, schemes)) <= MAX_GROUPS


@pytest.mark.parametrize(("together", "by_log"), [((3, 1, 1), False), ((3, 1, 3), True), ((1, 1, 1), True)])
def test_the_only_log_that_moves_joints_together_is_not_left_out(together, by_log):
    schemes = schemes_of(np.ones((3 * PATH_BLOCKS, 1)), together)
    assert [len(groups) for groups in schemes] == [6, 2] + [3] * by_log


def worth(error: float, spread: float = 0.0, seed: int = 0) -> CrossValidation:
    """A candidate of this relative error, its groups' errors scattered by this share."""
    shares = 1.0 + spread * np.random.default_rng(seed).uniform(-1, 1, (6, 1))
    return CrossValidation(*[(error**2 * shares / shares.sum(),)] * 2)


def test_the_smallest_is_preferred_unless_it_is_clearly_worse():
    doubtful = [worth(0.100, 0.9, 1), worth(0.101, 0.9, 2), worth(0.5)]
    assert standard_error(doubtful[1], doubtful[0]) > 0.001
    assert choose_candidate(doubtful, [20, 10, 5], [True] * 3) == (1, 0)
    of_one_size = [*doubtful[:2], worth(0.1005, 0.9, 1), worth(0.5)]  # the third is surely worse than the first
    assert standard_error(of_one_size[2], of_one_size[0]) < 0.0005
    assert choose_candidate(of_one_size, [20, 10, 10, 5], [True] * 4) == (2, 0)
    certain = [worth(0.100), worth(0.101), worth(0.5)]  # all groups alike: a difference is one
    assert choose_candidate(certain, [20, 10, 5], [True] * 3) == (0, 0)


@pytest.mark.parametrize(("score", "overfits"), [(0.1, False), (0.1 + 1e-13, False), (0.101, False), (0.3, True)])
def test_the_candidate_that_fits_best_overfits_only_if_it_predicts_clearly_worse(score, overfits):
    """0.101 is within the standard error of the difference; equal scores are no overfitting."""
    results = [worth(0.1, 0.9, 1), worth(score, 0.9, 2)._replace(fitted=(np.full((6, 1), 0.01**2 / 6),))]
    assert standard_error(results[1], results[0]) > 0.001
    named = [SimpleNamespace(name="small", size=3), SimpleNamespace(name="large", size=9)]
    said, error = reason(named, results, 0, 0, [True, True]), standard_error(results[1], results[0])
    assert ("overfits" in said) == overfits
    by_how_much = f"(0.3000, more by {score - 0.1:.4f}, with a standard error of {error:.4f}): it overfits"
    assert (by_how_much in said) == overfits


@pytest.mark.parametrize(("difference", "overfits"), [(0.9e-4, False), (1.1e-4, True)])
def test_errors_that_differ_by_less_than_the_last_printed_digit_are_equal(difference, overfits):
    results = [worth(0.1), worth(0.1 + difference)._replace(fitted=(np.full((6, 1), 0.01**2 / 6),))]
    named = [SimpleNamespace(name="small", size=3), SimpleNamespace(name="large", size=9)]
    assert ("overfits" in reason(named, results, 0, 0, [True, True])) == overfits


def test_a_candidate_that_fits_as_well_to_the_last_printed_digit_does_not_overfit():
    results = [worth(0.1), worth(0.2)._replace(fitted=worth(0.1 - 0.9 * LAST_DIGIT).unseen)]
    named = [SimpleNamespace(name="small", size=3), SimpleNamespace(name="large", size=9)]
    assert "overfits" not in reason(named, results, 0, 0, [True, True])


def test_an_inertia_has_to_be_positive_at_fifty_poses_of_each_log_or_at_all_of_a_shorter_one():
    logs = [SimpleNamespace(block=np.zeros(n), records=[SimpleNamespace(q=np.arange(n))]) for n in (100, 40)]
    model = SimpleNamespace(inertia_columns=lambda poses: poses[:, 0])
    assert Library(model, tuple(logs), None).inertias.tolist() == [*range(0, 100, 2), *range(40)]


@pytest.mark.parametrize(("variant", "ranks"), [(CHOSEN, [0, 1, 1]), ("coupled", [4, 2, 4])])
def test_searched_models_of_shared_links_come_first_and_others_by_their_number_of_parameters(variant, ranks):
    shared, alone = (SimpleNamespace(model=SimpleNamespace(efforts=e), columns=[0, 1]) for e in (("a", "b"), ("a",)))
    parts = ((shared, alone), (alone,), (alone, alone))
    assert [Candidate("", variant, "", of_candidate).rank for of_candidate in parts] == ranks


def test_joints_weigh_by_the_variance_that_their_own_models_leave_and_without_any_not_at_all():
    efforts = {"loud": (10.0 * TAU, PHI), "plain": (TAU, PHI), "none": (0.0 * TAU, PHI), "no column": (TAU, 0.0 * PHI)}
    cells = [sum_equations(Phi, tau, CELL, CELLS) for tau, Phi in efforts.values()]
    weights = weights_of([SimpleNamespace(by_block=each, ridge=PLAIN) for each in cells])
    residual = TAU[:, 0] - PHI[:, 0] @ solve(cells[1].sum_groups([np.ones(CELLS, bool)]), PLAIN._replace(strength=1e-3))
    assert_allclose(weights, [0.01 / (residual @ residual), 1.0 / (residual @ residual), 0.0, 0.0], rtol=1e-9)


def test_joints_share_links_if_there_are_several_and_each_has_an_effort():
    plain, current = SimpleNamespace(effort=""), SimpleNamespace(effort="current")
    robot = SimpleNamespace(joints=[plain, plain, current])
    assert [share_parameters(robot, rows) for rows in ([0], [0, 1], [0, 2])] == [False, True, False]


def test_a_candidate_that_physics_forbids_is_not_chosen_however_good():
    assert choose_candidate([worth(0.01), worth(0.1)], [3, 3], [False, True]) == (1, 1)
    with pytest.raises(ValueError, match="empty"):
        choose_candidate([worth(0.1)], [3], [False])


class Named(NamedTuple):
    """As much of a candidate as a selection needs."""

    name: str
    rank: int
    variant: str = "coupled"

    @property
    def size(self) -> int:
        return self.rank


def selection_of(**scores: tuple[int, float, bool]) -> Selection:
    """A selection of candidates with their ranks, errors and whether physics allows them."""
    made = [Named(name, rank) for name, (rank, _, _) in scores.items()]
    results, physical = [worth(x) for _, x, _ in scores.values()], [x for _, _, x in scores.values()]
    chosen, best = choose_candidate(results, [c.rank for c in made], physical if any(physical) else [True] * len(made))
    repeated = ((np.nan, np.nan),) * len(made)
    return Selection(tuple(made), tuple(results), tuple(physical), repeated, made[chosen], made[best], "")


def test_where_physics_forbids_the_searched_model_that_is_chosen_the_others_that_it_forbids_compete():
    searched = selection_of(searched=(9, 0.09, False))
    both = better(selection_of(alone=(3, 0.2, True), smooth=(7, 0.08, False)), searched)
    assert (both.chosen.name, both.best.name, both.chosen.variant) == ("smooth", "smooth", CHOSEN)
    assert "less than any other" in both.why
    assert [result.score for result in both.results] == [0.2, 0.08, 0.09]
    both = better(selection_of(alone=(3, 0.2, True), smooth=(7, 0.1, False)), searched)
    assert both.chosen.name == "searched"


def test_no_model_that_physics_forbids_is_better_than_the_chosen_one_that_it_allows():
    fixed = selection_of(alone=(3, 0.2, True), smooth=(7, 0.08, False))
    both = better(fixed, selection_of(searched=(9, 0.09, True)))
    assert (both.chosen.name, both.best.name) == ("searched", "searched")
    assert better(fixed, None).chosen.name == "alone"
    both = better(fixed, selection_of(searched=(9, 0.3, True)))
    assert both.chosen.name == "alone"


@pytest.mark.parametrize(("variant", "kind"), [(CHOSEN, "share links"), ("coupled", "have 10 parameters")])
def test_a_preferred_model_that_errs_surely_more_than_the_best_is_explained_by_the_one_that_does_not(variant, kind):
    """The third of these models is chosen, as the second, of the same rank, is not clearly worse than the first."""
    results = [worth(0.100, 0.9, 1), worth(0.101, 0.9, 2), worth(0.1005, 0.9, 1), worth(0.1001, 0.9, 2)]
    rank = 0 if variant == CHOSEN else 10
    made = [Named("best", 20, variant), *(Named(name, rank, variant) for name in ("doubtful", "taken", "forbidden"))]
    why = reason(made, results, 2, 0, [True, True, True, False])
    assert f"models that {kind} are preferred unless all are clearly worse, and doubtful is not (0.0010" in why
    assert "it is not clearly better" in reason(made, results, 1, 0, [True] * 4)


def test_the_reason_names_a_better_model_of_the_other_selection():
    doubtful = selection_of(small=(3, 0.11, True), large=(30, 0.10, True))
    fixed = replace(doubtful, chosen=doubtful.candidates[0])  # as if it were not clearly worse than the large one
    both = better(fixed, selection_of(searched=(9, 0.105, True)))
    assert (both.chosen.name, both.best.name) == ("searched", "large")
    assert "the best, large, errs by 0.0050 less" in both.why
    assert "it gave way to a smaller model, which errs more than the chosen one" in both.why
    assert both.why.endswith("The best has 30 parameters, the chosen one 9")


def test_fits_of_different_efforts_make_one_candidate_of_their_mean_error():
    assert combine_efforts([worth(0.1), worth(0.3)]).score == pytest.approx(0.2)


def test_a_refit_that_does_not_excite_a_base_parameter_has_no_score():
    """Two cells; the second of two parameters is excited in the second cell alone, or also in some of the first."""
    ridge = Ridge(1e-4, np.ones(1), np.eye(2))
    for in_first, enough in ((0, False), (20, True)):
        Phi = np.random.default_rng(0).normal(size=(400, 1, 2))
        Phi[: 200 - in_first, 0, 1] *= 1e-12
        cells = sum_equations(Phi, Phi @ [1.0, 1.0], np.repeat([0, 1], 200), 2)
        part = SimpleNamespace(
            model=None, library=SimpleNamespace(logs=()), by_block=cells, by_period=cells, ridge=ridge
        )
        refits = RefitModel(part, 1)
        assert refits.excites_all(cells, np.array([False, True])) == enough
        assert refits.excites_all(cells, np.array([True, False]))


@pytest.mark.parametrize(
    ("least_squares", "consistent", "mse", "used"),
    [
        ([-0.1], [0.1], 1.5, "consistent"),  # a motion that hardly excites the inertia
        ([0.1], [0.2], 1.5, "ridge"),  # an inertia that is positive stays as it is
        ([-0.1], [0.1], 9.0, "ridge"),  # as of a wrong sign: no mechanism has such an effort
        ([-0.1], [0.0], 1.5, "ridge"),
    ],
)
def test_parameters_of_a_mechanism_replace_those_without_a_positive_inertia(
    monkeypatch, least_squares, consistent, mse, used
):
    monkeypatch.setattr(choose, "scores", lambda part, theta: {"mse": 1.0})
    part = SimpleNamespace(model=SimpleNamespace(group="lift"), is_physical=lambda theta: theta[0] > 0.0)
    other = SimpleNamespace(model=SimpleNamespace(group="pan"), is_physical=lambda theta: True)
    chosen = SimpleNamespace(
        parts=(part, other), parameters=lambda: [least_squares, [1.0]], estimator="ridge", name="searched", added="",
        variant="chosen", size=1,
    )  # fmt: skip
    one = {name: np.ones(1) for name in ("score", "score_std", "training", "training_std")}
    over = {name: np.ones(1) for name in ("over_periods", "over_periods_std")}
    selection = SimpleNamespace(
        candidates=(chosen,), chosen=chosen, best=chosen, physical=(False,), why="", scores=one | over
    )
    fitted = [
        SimpleNamespace(group="lift", estimator="ridge", theta=least_squares, mse=1.0),
        SimpleNamespace(group="lift", estimator="consistent", theta=consistent, mse=mse),
    ]
    made = list(choose.choice(selection, [], fitted))
    assert [(r.group, r.estimator) for r in made if isinstance(r, Choice)] == [("lift", used), ("pan", "ridge")]
    remarks = [text for r in made if isinstance(r, Diagnostic) for text in r.text]
    assert len(remarks) == (used == "consistent")
    assert all("lift: the inertia of chosen.ridge is not positive" in text for text in remarks)
