"""Calibrate the band: what the filter makes of free motion by fits that have not seen it, of all logs together."""

from collections.abc import Iterable, Iterator

import numpy as np

from davinci_forces.filters import DEFAULT, diverges, through
from davinci_forces.filters.problem import driven
from davinci_forces.filters.response import assumed, lag
from davinci_forces.maths.arrays import Booleans, evenly
from davinci_forces.maths.signals.windows import free_space
from davinci_forces.maths.uncertainty import bootstrap
from davinci_forces.maths.uncertainty.error_band import BLOCKS, cells
from davinci_forces.maths.uncertainty.error_band import FEWEST as FEWEST_LOGS
from davinci_forces.records import ErrorBand, FilterNoise, FreeMotion, JointModel
from davinci_forces.robots.robot import Joint
from davinci_forces.study import LogEntry

FEWEST_SAMPLES = 100  # of free motion, below which nothing is said of its error
LOGS = 20  # at most, that a band is made of


def run(
    model: JointModel, noise: FilterNoise | None, entry: LogEntry, joint: Joint, *, q_tau: float
) -> Iterator[FreeMotion]:
    """The FreeMotion of a joint that moves, outside of contacts; of an identification log, by refits that left out what
    they predict.
    """
    if not entry.tells_free_space or model.at_rest or noise is None or not model.scheme:
        return
    free = free_space(model.t, entry.contact, model.rate)
    if int(free.sum()) < FEWEST_SAMPLES:
        return
    assumes = assumed(noise, joint, 1.0 / model.rate, q_tau)
    parts = driven(model, np.where(np.isnan(model.tau_hat_unseen), model.tau_hat, model.tau_hat_unseen))
    made = through(DEFAULT, parts, assumes)
    if diverges(made):
        return
    late = lag(parts, assumes)[1]
    _, block, speed_bin, count, mean_square, filter_square, _ = cells(
        made.tau_ext[free], (made.tau_ext_std**2 + late**2)[free], model.dq_measured[free], noise.speed
    )
    yield FreeMotion(
        log=model.log, joint=model.joint, path=model.path_unseen, scheme=model.scheme, tested=int(free.sum()),
        free_mean=float(made.tau_ext[free].mean()), block=block, speed_bin=speed_bin, count=count,
        mean_square=mean_square, filter_square=filter_square,
    )  # fmt: skip


def gather(motions: Iterable[FreeMotion], noises: Iterable[FilterNoise]) -> Iterator[ErrorBand]:
    """One ErrorBand per joint of which there is any such motion."""
    speeds = {noise.joint: noise.speed for noise in noises}
    every: dict[str, list[FreeMotion]] = {}
    for motion in motions:
        every.setdefault(motion.joint, []).append(motion)
    for joint, own in every.items():
        some = [own[i] for i in evenly(len(own), LOGS)]
        yield band(joint, some, speeds[joint])


def band(joint: str, own: list[FreeMotion], speed: float) -> ErrorBand:
    """The rows of all its logs, one after the other."""
    names = ("block", "speed_bin", "count", "mean_square", "filter_square")
    columns = {name: np.concatenate([getattr(motion, name) for motion in own]) for name in names}
    repeated = [len(motion) for motion in own]
    logs = np.repeat(np.arange(len(own)), repeated)
    parts = logs if len(own) >= FEWEST_LOGS else logs * BLOCKS + columns["block"]
    return ErrorBand(
        joint=joint,
        speed=speed,
        band_rms=rms(columns, np.ones(len(logs), np.bool_)),
        band_rms_std=float(bootstrap.jackknife_std(lambda kept: np.array([rms(columns, kept)]), parts)[0]),
        source=np.repeat(np.array([motion.log for motion in own], object), repeated),
        path_of=np.repeat(np.array([motion.path for motion in own], object), repeated),
        log_mean=np.repeat([motion.free_mean for motion in own], repeated),
        **columns,
    )


def rms(columns: dict[str, np.ndarray], kept: Booleans) -> float:
    """The root mean square of the cells that are kept, samples counting alike."""
    return float(np.sqrt(np.average(columns["mean_square"][kept], weights=columns["count"][kept])))
