"""Intervals of 95 % hold the true parameters of simulated arms, whether the model has their friction or not."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.special import stdtrit

from davinci_forces.identification import model_error
from davinci_forces.maths.selection import Ridge, sum_equations
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
    monkeypatch.setattr(model_error, "sum_all", lambda cells: cells)
    monkeypatch.setattr(model_error, "solve", lambda cells, ridge: np.array([2.5]))
    changes = model_error.squared_changes(here, np.array([2.0, 7.0, 3.0]), np.full(3, 0.1), there)
    np.testing.assert_allclose(changes, [0.25 - explained, np.nan, 9.0])
