"""Test whether residuals and innovations are white noise, and find out why innovations are not white."""

from collections.abc import Collection, Iterable, Iterator, Sequence

import numpy as np

from davinci_forces.filters.innovations.innovations import Innovations, correct_times, delays, innovations
from davinci_forces.filters.innovations.search import CLOCK, CONTACT, MAX_SAMPLES_SEARCH, CauseSearch, Subject, search
from davinci_forces.filters.problem import FilterInput, Recording, filter_inputs
from davinci_forces.filters.response import noise_model
from davinci_forces.identification.joint_models import Identified, LogModels, refit_effort
from davinci_forces.maths.arrays import Array, Booleans
from davinci_forces.maths.signals import whiteness
from davinci_forces.maths.signals.standstill import is_far_from_reversals
from davinci_forces.maths.signals.whiteness import TWO_SIDED_95, TWO_SIDED_99, cross_correlation, mean_square_band
from davinci_forces.maths.signals.windows import is_outside, is_past_transient, longest_run, spans
from davinci_forces.maths.uncertainty.bootstrap import error_of_pooled_mean
from davinci_forces.records.forces import FilterNoise, Track
from davinci_forces.records.model import Fit, Residual
from davinci_forces.records.prediction import JointModel
from davinci_forces.records.record import Column
from davinci_forces.records.recordings import Motion, PeriodResidual
from davinci_forces.records.whiteness import Explanation, Innovation, Whiteness
from davinci_forces.robots.robot import Robot
from davinci_forces.study import LogEntry

LAGS = 100  # lags of the correlations in the report
TESTED_LAGS = 20  # lags of the Ljung-Box statistic
MIN_PROBABILITY = 0.01  # p-value of a test, above which a signal is called white
OUTSIDE_MOTION = "rests and transients"  # what is left out where no contact is known
UNKNOWN_CONTACT = "; the study states no contact windows, so contact could not be left out"
THIS_LOG = "parameters of this log itself"
PROBABILITIES = ("ljung_box_p_q", "ljung_box_p_dq", "periodogram_p_q", "periodogram_p_dq")


def run(subject: PeriodResidual | Residual | Track) -> Iterator[Whiteness]:
    """Test the residuals of averaging, the residual effort of a fit, or the innovations of a filter."""
    if isinstance(subject, PeriodResidual):
        signals = {name: getattr(subject, name) for name in ("q_noise", "dq_noise", "tau_noise")}
    elif isinstance(subject, Residual):
        signals = {f"tau.{subject.model}.{subject.estimator}": subject.tau - subject.tau_hat}
    else:
        # Correlations across a gap mean nothing, and after a gap the filter restarts.  Standstill is not judged.
        moving = subject.unscored == 0
        if not moving.any():
            return
        part = longest_run(subject.t[moving], subject.rate)
        converged = is_past_transient(subject.t[moving][part])
        signals = {name: getattr(subject, name)[moving][part][converged] for name in ("innovation_q", "innovation_dq")}
    results = {name: statistics(x) for name, x in signals.items()}
    all_white = int(all(r["white"] and float(r["periodogram_p"]) > MIN_PROBABILITY for r in results.values()))  # type: ignore[arg-type]
    for name, result in results.items():
        yield Whiteness.like(subject, signal=name, all_white=all_white, **result)


def statistics(x: Column) -> dict[str, object]:
    """Autocorrelation, Ljung-Box, cumulative periodogram and Jarque-Bera of one signal.

    A signal without variance cannot be tested, and counts as not white.
    """
    N = len(x)
    lags, tested_lags = min(LAGS, N // 4), min(TESTED_LAGS, N // 5)
    cycles = 0.5 * np.arange(lags + 1) / max(lags, 1)
    correlation, straight = np.eye(1, lags + 1)[0], 2.0 * cycles
    box, wave = whiteness.LjungBox(0.0, 0.0), whiteness.Cumulative(cycles, straight, 0.0, 0.0)
    skewness = kurtosis = normal = 0.0
    if whiteness.MIN_SAMPLES_WHITENESS <= N and np.ptp(x) > 0:
        level = whiteness.centre_pieces([x])
        correlation = whiteness.autocorrelation(level, lags)
        box = whiteness.ljung_box(level, correlation, tested_lags)
        wave = whiteness.cumulative_periodogram(level)
    if np.ptp(x) > 0:
        skewness, kurtosis, normal = whiteness.shape(x)
    acf1 = float(correlation[1]) if lags else 0.0
    band, ordinates = 1.0 / np.sqrt(N), (N - 1) // 2
    return {
        "tested": N,
        "band": float(whiteness.TWO_SIDED_95 * band),
        "band_99": float(whiteness.TWO_SIDED_99 * band),
        "acf1": acf1,
        "acf1_std": whiteness.acf1_std(acf1, N),
        "outside": float(np.mean(np.abs(correlation[1:]) > whiteness.TWO_SIDED_95 * band)) if lags else 0.0,
        "ljung_box": box.statistic,
        "ljung_box_lags": tested_lags,
        "ljung_box_p": box.probability,
        "periodogram_d": wave.distance,
        "periodogram_p": wave.probability,
        "periodogram_band": whiteness.distance_of(0.05, ordinates),
        "periodogram_band_99": whiteness.distance_of(0.01, ordinates),
        "jarque_bera_p": normal if N >= whiteness.MIN_SAMPLES_WHITENESS else 0.0,
        "skewness": skewness,
        "skewness_std": whiteness.moment_std(3, acf1, N),
        "kurtosis": kurtosis,
        "kurtosis_std": whiteness.moment_std(4, acf1, N),
        "white": int(box.probability > MIN_PROBABILITY),
        "lag": np.arange(lags + 1),
        "acf": correlation,
        "cycles": cycles,
        "cumulated": np.interp(cycles, wave.frequency, wave.share, left=0.0),
    }


def apply(
    models: Sequence[JointModel],
    motions: Collection[Motion],
    fits: Iterable[Fit],
    noises: Iterable[FilterNoise],
    entry: LogEntry,
    robot: Robot,
    *,
    q_tau: float,
) -> Iterator[Innovation | Explanation]:
    """Compute the innovations of each moving joint over the longest run, and explain why they are not white.

    A cause is named only if the innovations pass every test once the cause is removed.  Section 7.4
    """
    noise_of, modelled = {noise.joint: noise for noise in noises}, {model.joint for model in models}
    along = LogModels(Identified(robot, fits), [*models, *(m for m in motions if m.joint not in modelled)])
    models = [model for model in models if not model.at_rest and model.joint in noise_of]
    filter_noises = [noise_model(noise_of[m.joint], robot.joint(m.joint), 1.0 / m.rate, q_tau) for m in models]
    results = [innovations(longest_part(m), noise) for m, noise in zip(models, filter_noises, strict=True)]
    clock_delays = delays([velocities(m)[0] for m in models], [result.q for result in results])
    for model, noise, delay in zip(models, filter_noises, clock_delays, strict=True):
        part = longest_run(model.t, model.rate)
        free = is_outside(model.t, [*entry.possible_contact, *spans(model.t, model.unscored > 0)])
        yield from innovation_records(model, results.pop(0))
        first = slice(MAX_SAMPLES_SEARCH)
        moving = is_far_from_reversals(velocities(model)[0], 1.0 / model.rate)[first]
        trials = dict(alternatives(model, along, free))
        if delay.any():
            dq, ddq = (x[first] for x in velocities(model))
            trials[CLOCK] = correct_times(tried_part(model), dq, ddq, delay[first])
        subject = Subject(trials, noise, free[part][first], moving)
        yield explanation(model, search(subject), entry, float(np.std(delay)))


def velocities(model: JointModel) -> tuple[Array, Array]:
    """Low-passed velocity and acceleration over the longest run."""
    part = longest_run(model.t, model.rate)
    return model.dq[part], model.ddq[part]


def longest_part(model: JointModel, tau_hat: Array | None = None) -> Recording:
    """The longest run of a joint's recording; `tau_hat` (N,) is the effort by another fit."""
    return max(filter_inputs(model, tau_hat), key=lambda part: part.samples)


def tried_part(model: JointModel, tau_hat: Array | None = None) -> FilterInput:
    """The samples of the longest run in which causes are searched for."""
    longest = longest_part(model, tau_hat)
    return longest.part(slice(0, min(longest.samples, MAX_SAMPLES_SEARCH)))


def alternatives(model: JointModel, along: LogModels, free: Booleans) -> Iterator[tuple[str, FilterInput]]:
    """The joint under the model in use, with parameters fitted to this log, and under another structure."""
    identified, joint = along.identified, model.joint
    fit = identified.fit_of(joint, f"{model.model}.{model.estimator}")
    yield "", tried_part(model)
    if fit is not None:
        yield THIS_LOG, tried_part(model, refit_effort(model, fit, along, free))
    structures = [f for f in identified.fits if f.group == joint and f.model != model.model]
    possible = [f for f in structures if set(along.joints) >= set(identified.model(f).joints)]
    for alternative in possible[:1]:  # of the models whose joints the log contains
        under = along.with_fit(model, alternative)
        if under.inertia.min() > 0:
            yield alternative.model, tried_part(under)


def innovation_records(model: JointModel, result: Innovations) -> Iterator[Innovation]:
    """The normalised square of both innovations, and the correlation of the innovations with earlier motion."""
    moving = model.unscored[longest_run(model.t, model.rate)] == 0
    converged = is_past_transient(np.arange(len(result.q)) / model.rate) & moving
    by_name = {
        "innovation_q": (result.q / result.q_std)[converged],
        "innovation_dq": (result.dq / result.dq_std)[converged],
    }
    del result  # of a long log, before its motion is read
    dq, ddq = (x[converged] for x in velocities(model))
    N = int(converged.sum())
    lags = min(LAGS, N // 4)
    low, high = mean_square_band(N)
    for name, normalised in by_name.items():
        with_dq, with_ddq, with_sign = (cross_correlation(normalised, u, lags) for u in (dq, ddq, np.sign(dq)))
        yield Innovation(
            log=model.log, joint=model.joint, signal=name, tested=N, band=TWO_SIDED_95 / N**0.5,
            band_99=TWO_SIDED_99 / N**0.5, nis_own=float(np.mean(normalised**2)),
            nis_own_std=error_of_pooled_mean(normalised**2), nis_low=low, nis_high=high,
            lag=np.arange(lags + 1), with_dq=with_dq, with_ddq=with_ddq, with_sign=with_sign,
        )  # fmt: skip


def explanation(model: JointModel, causes: CauseSearch, entry: LogEntry, clock_std: float) -> Explanation:
    """The result of a search for the causes of innovations that are not white, trial by trial."""
    trials, touched = causes.trials, entry.role in ("contact", "tissue") and not entry.possible_contact
    caveat = UNKNOWN_CONTACT if touched and not (trials[0].white or causes.explaining) else ""
    omitted = CONTACT if entry.possible_contact else OUTSIDE_MOTION
    return Explanation.like(
        model,
        finding=causes.outcome,
        verdict=causes.verdict.replace(CONTACT, omitted) + caveat,
        clock_std=clock_std,
        without=np.array([" + ".join(t.without).replace(CONTACT, omitted) or "nothing" for t in trials], object),
        explains=np.array([t in causes.explaining for t in trials], np.int64),
        left=np.array([t.tested for t in trials]),
        **dict(zip(PROBABILITIES, np.array([(*t.ljung_box, *t.periodogram) for t in trials]).T, strict=True)),
        walk=np.array([t.walk for t in trials]),
    )
