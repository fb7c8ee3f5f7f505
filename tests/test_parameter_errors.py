"""Intervals of 95 % hold the true parameters of simulated arms, whether the model has their friction or not."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.optimize import lsq_linear
from scipy.special import stdtrit

from davinci_forces.identification import chosen, model_error
from davinci_forces.identification.candidates import Candidate, CandidatePart, CellEquations, Library
from davinci_forces.maths import selection
from davinci_forces.maths.models import terms
from davinci_forces.maths.models.independent import IndependentJoint
from davinci_forces.maths.models.model import ArmMotion
from davinci_forces.maths.selection import PATH_BLOCKS, Ridge, solve, sum_all, sum_equations
from davinci_forces.records import Average, Fit, Motion, Recording, Signal, Trajectory
from davinci_forces.simulation.motion import simulate_log, theta
from davinci_forces.simulation.scenario.reading import load
from davinci_forces.simulation.study_folder import record_channels
from davinci_forces.stages.model import fit
from davinci_forces.stages.recordings import average, differentiate, resample
from tests.conftest import TWO_FRICTIONS
from tests.test_averaging import entry

SEEDS = range(20)  # chosen before the first run
LOWPASS = 17.0


def recordings(scenario, log, run):
    """The joints of a log, as they are read from its files."""
    channels = {channel.quantity: channel.samples for channel in record_channels(scenario, log, run)}
    recorded = run.t >= log.skip
    for name in log.joints:
        joint = scenario.robot.joint(name)
        unit = 1e-3 if log.current_unit == "mA" else 1.0
        q, dq = channels[f"{name}.theta_m"] / joint.gear_ratio, channels[f"{name}.dtheta_m"] / joint.gear_ratio
        tau = channels[f"{name}.i"] * unit * joint.gear_ratio * joint.torque_constant
        columns = {"t": run.t, "q": q, "dq": dq, "tau": tau, "filled": np.zeros(len(run.t), int)}
        columns = {symbol: x[recorded] for symbol, x in columns.items()}
        yield Recording(log.name, name, "identification", scenario.rate, "logged", **columns)


def fitted(scenario, runs) -> list[Fit]:
    """The fits of the joints to the identification logs, with the noise of the scenario's seed."""
    trajectories, motions = [], []
    for log, run in runs:
        made = [
            record
            for recording in recordings(scenario, log, run)
            for record in resample.run(recording, scenario.robot.joint(recording.joint), lowpass=LOWPASS)
        ]
        motions += [record for record in made if isinstance(record, Motion)]
        about = entry(name=log.name, period=next(iter(log.moves.values())).period)
        signals = [record for record in made if isinstance(record, Signal)]
        for record in average.run(signals, about, scenario.robot, harmonics=0, lowpass=LOWPASS):
            if isinstance(record, Average):
                trajectories += differentiate.run(record, scenario.robot.joint(record.joint), harmonics=0)
    trajectories = [record for record in trajectories if isinstance(record, Trajectory)]
    return [r for r in fit.run(trajectories, motions, scenario.robot, lowpass=LOWPASS) if isinstance(r, Fit)]


@pytest.fixture(scope="module", params=[TWO_FRICTIONS, "davinci-thesis"], ids=["two-frictions", "davinci-thesis"])
def errors(request) -> dict[str, np.ndarray]:
    """Errors of the parameters over their standard errors, (seeds, parameters) of each estimator."""
    scenario = load(request.param)
    truth = theta(scenario, "matched")
    runs = [(log, simulate_log(scenario, log)) for log in scenario.logs if log.role == "identification"]
    scores = {name: [] for name in ("lse", "wlse")}
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(fit, "ESTIMATORS", tuple(scores))  # the others are not judged
        every = [fitted(replace(scenario, seed=seed), runs) for seed in SEEDS]
    for of_seed in every:
        records = {(r.group, r.estimator): r for r in of_seed}
        for name, of_estimator in scores.items():
            each = [(records[joint, name].theta - x) / records[joint, name].theta_std for joint, x in truth.items()]
            of_estimator.append(np.concatenate(each))
    return {name: np.array(of_estimator) for name, of_estimator in scores.items()}


@pytest.mark.slow
@pytest.mark.parametrize("name", ["lse", "wlse"])
def test_intervals_of_95_percent_hold_the_truth_in_90_to_98_percent_of_20_seeds(errors, name):
    """The interval of the share is stated, by seed: parameters of one seed have one noise."""
    shares = (np.abs(errors[name]) < 1.96).mean(axis=1)
    half = stdtrit(len(SEEDS) - 1, 0.975) * shares.std(ddof=1) / np.sqrt(len(SEEDS))
    assert 0.90 <= shares.mean() <= 0.98, f"{shares.mean():.3f} +- {half:.3f} of {errors[name].size} intervals"


@pytest.mark.parametrize(("periods", "group"), [(4, "period"), (1, "block")])
def test_noise_of_parameters_is_that_of_refits_without_each_period_or_without_each_block_if_there_is_one(
    periods, group
):
    """By the jackknife: the variance of P refits, times P - 1; in two logs, a period of both is left out."""
    rng, k = np.random.default_rng(0), np.arange(1200)
    number = {"period": k % 600 * periods // 600, "block": k % (600 // periods) * 6 * periods // 600}
    Phi, log = rng.normal(size=(1200, 1, 2)), k // 600
    tau = Phi @ [1.0, 2.0] + rng.normal(size=(1200, 1))
    by_block = sum_equations(Phi, tau, 6 * log + number["block"], 12)
    by_period = sum_equations(Phi, tau, 20 * log + number["period"], 40)
    part = SimpleNamespace(by_block=by_block, by_period=by_period, ridge=Ridge(0.0, np.ones(1), np.empty((0, 0))))
    groups = [number[group] == n for n in np.unique(number[group])]
    thetas = np.array([np.linalg.lstsq(Phi[~out, 0], tau[~out, 0])[0] for out in groups])
    expected = np.sqrt((len(groups) - 1) * thetas.var(axis=0))
    np.testing.assert_allclose(model_error.std_over_periods(part, 2), expected, rtol=1e-9)


def test_no_log_is_left_out_as_a_whole_for_the_noise_of_parameters_that_it_alone_excites():
    """The first of two logs repeats four times, the second, which alone excites one parameter, does not."""
    rng, k = np.random.default_rng(0), np.arange(1200)
    log, period, block = k // 600, np.where(k < 600, k // 150, 0), k % 600 // 100
    Phi = rng.normal(size=(1200, 1, 2)) * np.where(log[:, None, None], 1.0, [1.0, 1e-9])
    tau = Phi @ [1.0, 2.0] + rng.normal(size=(1200, 1))
    by_block, by_period = (sum_equations(Phi, tau, n * log + of, 2 * n) for n, of in ((6, block), (20, period)))
    part = SimpleNamespace(by_block=by_block, by_period=by_period, ridge=Ridge(0.0, np.ones(1), np.empty((0, 0))))
    groups = [np.where(log == 0, period, block) == n for n in range(6)]
    thetas = np.array([np.linalg.lstsq(Phi[~out, 0], tau[~out, 0])[0] for out in groups])
    found = model_error.std_over_periods(part, 2)
    np.testing.assert_allclose(found, np.sqrt(5 * thetas.var(axis=0)), rtol=1e-9)
    assert found[1] < 0.2
    numbers = model_error.numbers_of_periods(by_period.squares, 2)
    assert numbers[:4].tolist() == [0, 1, 2, 3]
    assert (numbers[20:] == -1).all()


@pytest.mark.parametrize(("variance", "explained"), [(4.0, 0.03), (1.0, 0.0), (0.5, 0.0)])
def test_a_change_of_a_parameter_is_squared_less_the_variance_that_noise_adds_in_the_other_model(
    monkeypatch, variance, explained
):
    """Of nested models, noise adds the difference of the variances (Hausman, 1978).

    A parameter may be lacking: a slope is then 0, and of a spring nothing is known.
    """
    mass, *lacking = (("mass", 1.0), ("spring of roll", 1.0), ("stiffness, slope of roll", 1.0))
    here = SimpleNamespace(names=[mass, *lacking], variance=np.ones(3), by_block=None, ridge=None)
    there = SimpleNamespace(names=[mass], variance=np.array([variance]), by_block=None, ridge=None)
    monkeypatch.setattr(model_error, "identities", lambda part: part.names)
    monkeypatch.setattr(model_error, "unit_variance", lambda part: part.variance)
    monkeypatch.setattr(selection, "sum_all", lambda cells: cells)
    monkeypatch.setattr(selection, "solve", lambda cells, ridge: np.array([2.5]))
    changes = model_error.squared_changes(here, np.array([2.0, 7.0, 3.0]), np.full(3, 0.1), there)
    np.testing.assert_allclose(changes, [0.25 - explained, np.nan, 9.0])


# The parameters of a joint whose friction builds up over a displacement that is none of those of its models.
JOINT = {"inertia": 0.4, "viscous friction": 0.5, "Coulomb friction": 0.8}
TERMS = (terms.inertia, terms.viscous, terms.coulomb, terms.presliding_friction(0.08))


def friction_candidates(strength: float) -> list[Candidate]:
    """A plain model and one with presliding friction, with equations of one simulated log and a ridge."""
    K, T_s, rng = 3000, 0.01, np.random.default_rng(4)
    t, k = np.arange(K) * T_s, np.arange(1, 6)
    angle, a = 2 * np.pi * k * t[:, None] / 30.0 + rng.uniform(0, 6, 5), rng.uniform(0.1, 0.4, 5)
    w = 2 * np.pi * k / 30.0
    q, dq, ddq = ((a * f).sum(axis=1)[:, None] for f in (np.sin(angle), w * np.cos(angle), -(w**2) * np.sin(angle)))
    motion = ArmMotion(q, dq, ddq, T_s, np.zeros(K, int), True)
    true = IndependentJoint("one", (*TERMS[:3], terms.presliding_friction(0.01)), ("",) * 4)
    tau = true.regressor(motion).Phi @ [*JOINT.values(), 0.8] + rng.normal(0.0, 1e-3, (K, 1))
    model = IndependentJoint("one", TERMS, ("",) * 4)
    equations = sum_equations(model.regressor(motion).Phi, tau, np.arange(K) * PATH_BLOCKS // K, PATH_BLOCKS)
    library = Library(model, (), CellEquations(np.array([K]), np.zeros(1), equations, equations, equations))
    made = []
    for added, columns in (("", [0, 1, 2]), ("dahl", [0, 1, 2, 3])):
        own = IndependentJoint("one", tuple(TERMS[i] for i in columns), ("",) * len(columns))
        part = CandidatePart(own, library, columns, Ridge(strength, np.ones(1), np.empty((0, 0))))
        made.append(Candidate(added or "plain", added, added, (part,)))
    return made


@pytest.mark.parametrize("strength", [0.0, 0.1])
def test_friction_that_predicts_better_and_a_ridge_widen_the_error_of_the_parameters_that_they_move(strength):
    candidates = friction_candidates(strength)
    part = candidates[1].parts[0]
    theta, noise = solve(sum_all(part.by_block), part.ridge), np.full(4, 1e-4)
    error = np.abs(theta[:3] - list(JOINT.values()))
    std = model_error.model_std(part, theta, noise, candidates, 1)[:3]
    assert (error > 20 * noise[:3]).all()
    assert (error < 2.0 * std).all()
    assert (std < 10.0 * error).all()


def test_a_parameter_is_compared_with_the_best_plain_model_and_with_models_that_predict_as_well_but_not_itself(
    monkeypatch,
):
    monkeypatch.setattr(model_error, "identities", lambda part: part.names)
    monkeypatch.setattr(selection, "standard_error", lambda errors, best: 0.1)
    rows = (  # name, ridge, added friction, score
        ("plain", 0.0, "", 1.5), ("plain, offset", 0.0, "", 1.4), ("plain, more ridge", 0.2, "", 1.3),
        ("itself", 0.1, "dahl", 1.0), ("as well", 0.0, "smooth", 1.19), ("worse", 0.0, "stribeck", 1.21),
    )  # fmt: skip
    parts = {
        name: SimpleNamespace(names=[name], ridge=Ridge(strength, np.ones(1), np.empty((0, 0))))
        for name, strength, *_ in rows
    }
    models = [(parts[name], not added, SimpleNamespace(score=score)) for name, _, added, score in rows]
    compared = model_error.models_to_compare(parts["itself"], models)
    assert [name for part in compared for name in part.names] == ["plain, offset", "as well"]
    assert model_error.models_to_compare(parts["itself"], []) == []


def test_parameters_that_no_data_separate_have_errors_that_a_ridge_does_not_hide():
    """Two of three columns are alike but for rounding, as those of links beyond a joint that stands still."""
    rng = np.random.default_rng(3)
    Phi = rng.normal(size=(600, 1, 3))
    Phi[:, 0, 2] = Phi[:, 0, 1] * (1.0 + 1e-7 * rng.normal(size=600))
    tau = Phi @ [1.0, 2.0, 0.0] + rng.normal(0.0, 0.1, (600, 1))
    equations = sum_equations(Phi, tau, np.arange(600) * PATH_BLOCKS // 600, PATH_BLOCKS)
    model = IndependentJoint("one", (terms.inertia, terms.viscous, terms.stiffness), ("",) * 3)
    library = Library(model, (), CellEquations(np.array([600]), np.zeros(1), equations, equations, equations))
    part = CandidatePart(model, library, [0, 1, 2], Ridge(1e-3, np.ones(1), np.empty((0, 0))))
    theta, noise = solve(sum_all(equations), part.ridge), np.full(3, 0.004)
    std = np.sqrt(model_error.squares_of_ridge(part, theta, noise))
    assert abs(theta[1] - 1.0) < 0.1  # the ridge divides it
    assert std[0] < 0.02
    assert (std[1:] > 1.0).all()
    assert (model_error.squares_of_ridge(part.with_ridge(0.0), theta, noise) == 0.0).all()


def test_parameters_with_the_least_inertia_are_the_best_of_all_with_at_least_that_one():
    """An inertia that the data make negative; its column is a hundred times as long as the others."""
    rng = np.random.default_rng(5)
    q = rng.normal(size=600)
    Phi = np.column_stack([100.0 * (rng.normal(size=600) + q), rng.normal(size=600), q])
    tau = Phi @ [-0.02, 1.0, 0.5] + rng.normal(0.0, 0.1, 600)
    equations = sum_equations(Phi[:, None], tau[:, None], np.arange(600) * PATH_BLOCKS // 600, PATH_BLOCKS)
    model = IndependentJoint("one", (terms.inertia, terms.viscous, terms.stiffness), ("",) * 3)
    log = SimpleNamespace(block=np.zeros(600), records=[SimpleNamespace(q=q)])
    library = Library(model, (log,), CellEquations(np.array([600]), np.zeros(1), equations, equations, equations))  # type: ignore[arg-type]
    part = CandidatePart(model, library, [0, 1, 2], Ridge(0.0, np.ones(1), np.empty((0, 0))))
    theta = solve(sum_all(equations), part.ridge)
    free = chosen.BlockEstimate(theta, *np.zeros((4, 3)), samples=600, condition=1.0, **chosen.scores(part, theta))
    estimate, rmse, rmse_free, excess = chosen.fit_consistent(part, free)
    least = 1e-3 * np.linalg.norm(tau) / np.linalg.norm(Phi[:, 0])
    best = lsq_linear(Phi, tau, bounds=([least, 0.0, -np.inf], np.inf), tol=1e-12)
    assert_allclose(estimate.theta, best.x, rtol=1e-6)
    squares = [np.sum((tau - Phi @ theta) ** 2) for theta in (best.x, free.theta)]
    assert_allclose(excess, (squares[0] - squares[1]) / (tau @ tau), rtol=1e-6)
    assert_allclose([rmse, rmse_free], np.sqrt(np.array(squares)[:, None] / 600), rtol=1e-6)
