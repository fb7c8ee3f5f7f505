"""Test whether what averaging, fit and filter leave is white noise, and explain why innovations are not."""

from collections.abc import Collection, Iterable, Iterator, Sequence

import numpy as np

from davinci_forces.filters.innovations.innovations import Innovations, delays, innovations, mended
from davinci_forces.filters.innovations.search import CauseSearch, finding, search, verdict
from davinci_forces.filters.innovations.trials import CLOCK, Subject
from davinci_forces.filters.problem import Driven, driven
from davinci_forces.filters.response import assumed
from davinci_forces.identification.joint_models import Along, refitted
from davinci_forces.identification.used import Identified
from davinci_forces.maths.arrays import Array, Booleans
from davinci_forces.maths.signals import whiteness
from davinci_forces.maths.signals.standstill import moving
from davinci_forces.maths.signals.whiteness import NORMAL_95, NORMAL_99, cross_correlation, mean_square_band
from davinci_forces.maths.signals.windows import longest_run, outside, settled
from davinci_forces.records import (
    Column,
    Explanation,
    FilterNoise,
    Fit,
    Innovation,
    JointModel,
    Motion,
    PeriodResidual,
    Residual,
    Track,
    Whiteness,
)
from davinci_forces.robots.robot import Robot
from davinci_forces.study import LogEntry

LAGS = 100  # of the correlations that are shown
TESTED_LAGS = 20  # of the Ljung-Box statistic
LEVEL = 0.01  # below this probability a signal is called not white
UNSTATED = "; when it is touched is not stated, so contact could not be left out"
THIS_LOG = "parameters of this log itself"


def run(subject: PeriodResidual | Residual | Track) -> Iterator[Whiteness]:
    """What averaging removed, the effort that a fit leaves of a period, and a filter's innovations over its run."""
    if isinstance(subject, PeriodResidual):
        signals = {name: getattr(subject, name) for name in ("q_noise", "dq_noise", "tau_noise")}
    elif isinstance(subject, Residual):
        signals = {f"tau.{subject.model}.{subject.estimator}": subject.tau - subject.tau_hat}
    else:
        # Correlations across a gap mean nothing, and after one the filter starts anew.
        run_ = longest_run(subject.t, subject.rate)
        kept = settled(subject.t[run_])
        signals = {name: getattr(subject, name)[run_][kept] for name in ("innovation_q", "innovation_dq")}
    found = {name: statistics(x) for name, x in signals.items()}
    together = int(all(result["white"] and float(result["periodogram_p"]) > LEVEL for result in found.values()))  # type: ignore[arg-type]
    for name, result in found.items():
        yield Whiteness(log=subject.log, joint=subject.joint, signal=name, all_white=together, **result)  # type: ignore[arg-type]


def statistics(x: Column) -> dict[str, object]:
    """Autocorrelation, Ljung-Box, cumulative periodogram and Jarque-Bera of one signal.

    A signal without variance has nothing to test and is not called white.
    """
    N = len(x)
    lags, tested_lags = min(LAGS, N // 4), min(TESTED_LAGS, N // 5)
    cycles = 0.5 * np.arange(lags + 1) / max(lags, 1)
    correlation, straight = np.eye(1, lags + 1)[0], 2.0 * cycles
    box, wave = whiteness.LjungBox(0.0, 0.0), whiteness.Cumulative(cycles, straight, 0.0, 0.0)
    skewness = kurtosis = normal = 0.0
    if whiteness.FEWEST <= N and np.ptp(x) > 0:
        level = whiteness.centred([x])
        correlation = whiteness.autocorrelation(level, lags)
        box = whiteness.ljung_box(level, correlation, tested_lags)
        wave = whiteness.cumulative_periodogram(level)
    if np.ptp(x) > 0:
        skewness, kurtosis, normal = whiteness.shape(x)
    band, ordinates = 1.0 / np.sqrt(N), (N - 1) // 2
    return {
        "tested": N,
        "band": float(whiteness.NORMAL_95 * band),
        "band_99": float(whiteness.NORMAL_99 * band),
        "acf1": float(correlation[1]) if lags else 0.0,
        "outside": float(np.mean(np.abs(correlation[1:]) > whiteness.NORMAL_95 * band)) if lags else 0.0,
        "ljung_box": box.statistic,
        "ljung_box_lags": tested_lags,
        "ljung_box_p": box.probability,
        "periodogram_d": wave.distance,
        "periodogram_p": wave.probability,
        "periodogram_band": whiteness.distance_of(0.05, ordinates),
        "periodogram_band_99": whiteness.distance_of(0.01, ordinates),
        "jarque_bera_p": normal if N >= whiteness.FEWEST else 0.0,
        "skewness": skewness,
        "kurtosis": kurtosis,
        "white": int(box.probability > LEVEL),
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
    """Of each joint that is tracked and moves: its innovations over the longest run, and why they are not white.

    A cause is named only where the innovations pass every test without it.  Section 7.4
    """
    assumes, modelled = {noise.joint: noise for noise in noises}, {model.joint for model in models}
    along = Along(Identified(robot, fits), [*models, *(m for m in motions if m.joint not in modelled)])
    moving_models = [model for model in models if not model.at_rest and model.joint in assumes]
    every_noise = [
        assumed(assumes[model.joint], robot.joint(model.joint), 1.0 / model.rate, q_tau) for model in moving_models
    ]
    every_innovation = [
        innovations(longest(model), noise) for model, noise in zip(moving_models, every_noise, strict=True)
    ]
    late = delays([motion_of(model)[0] for model in moving_models], [made.q for made in every_innovation])
    for model, noise, made, delay in zip(moving_models, every_noise, every_innovation, late, strict=True):
        part = longest_run(model.t, model.rate)
        motion, free = motion_of(model), outside(model.t, entry.contact)
        yield from described(model, made, motion)
        trials = dict(others(model, along, free))
        if delay.any():
            trials[CLOCK] = mended(longest(model), *motion, delay)
        subject = Subject(trials, noise, free[part], moving(motion[0], 1.0 / model.rate))
        yield explanation(model, search(subject), entry, float(np.std(delay)))


def motion_of(model: JointModel) -> tuple[Array, Array]:
    """Velocity and acceleration over the longest run, without noise."""
    part = longest_run(model.t, model.rate)
    return model.dq[part], model.ddq[part]


def longest(model: JointModel, tau_hat: Array | None = None) -> Driven:
    """The longest run of a joint's recording; `tau_hat` (N,) by another fit, where that is taken off."""
    return max(driven(model, tau_hat), key=lambda part: len(part.q))


def others(model: JointModel, along: Along, free: Booleans) -> Iterator[tuple[str, Driven]]:
    """The joint under the model in use; with parameters of this log itself; and under another structure of its own."""
    identified, joint = along.identified, model.joint
    fit = identified.used(joint, f"{model.model}.{model.estimator}")
    yield "", longest(model)
    if fit is not None:
        yield THIS_LOG, longest(model, refitted(model, fit, along, free))
    structures = [other for other in identified.fits if other.group == joint and other.model != model.model]
    possible = [other for other in structures if set(along.joints) >= set(identified.model(other).joints)]
    for other in possible[:1]:  # of those whose joints the log holds
        under = along.under(model, other)
        if under.inertia.min() > 0:
            yield other.model, longest(under)


def described(model: JointModel, made: Innovations, motion: tuple[Array, Array]) -> Iterator[Innovation]:
    """The size of both innovations, and their correlation with the motion before."""
    kept = settled(np.arange(len(made.q)) / model.rate)
    dq, ddq = (x[kept] for x in motion)
    N = int(kept.sum())
    lags = min(LAGS, N // 4)
    low, high = mean_square_band(N)
    for name, x, std in (("innovation_q", made.q, made.q_std), ("innovation_dq", made.dq, made.dq_std)):
        normalised = (x / std)[kept]
        with_dq, with_ddq, with_sign = (cross_correlation(normalised, u, lags) for u in (dq, ddq, np.sign(dq)))
        yield Innovation(
            log=model.log, joint=model.joint, signal=name, tested=N, band=NORMAL_95 / N**0.5,
            band_99=NORMAL_99 / N**0.5, nis_own=float(np.mean(normalised**2)), nis_low=low, nis_high=high,
            lag=np.arange(lags + 1), with_dq=with_dq, with_ddq=with_ddq, with_sign=with_sign,
        )  # fmt: skip


def explanation(model: JointModel, found: CauseSearch, entry: LogEntry, clock_std: float) -> Explanation:
    """What a search found, trial by trial."""
    trials, touched = found.trials, entry.role in ("contact", "tissue") and not entry.contact
    unstated = UNSTATED if touched and not (trials[0].white or found.explaining) else ""
    return Explanation(
        log=model.log,
        joint=model.joint,
        finding=finding(found),
        verdict=verdict(found) + unstated,
        clock_std=clock_std,
        without=np.array([" + ".join(t.without) or "nothing" for t in trials], object),
        explains=np.array([t in found.explaining for t in trials], np.int64),
        left=np.array([t.tested for t in trials]),
        ljung_box_p_q=np.array([t.ljung_box[0] for t in trials]),
        ljung_box_p_dq=np.array([t.ljung_box[1] for t in trials]),
        periodogram_p_q=np.array([t.periodogram[0] for t in trials]),
        periodogram_p_dq=np.array([t.periodogram[1] for t in trials]),
        walk=np.array([t.walk for t in trials]),
    )
