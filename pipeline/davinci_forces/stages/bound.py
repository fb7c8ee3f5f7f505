"""Bring together what the model's error was on free motion that no fit had seen, for the bands of all logs."""

from collections.abc import Iterable, Iterator

import numpy as np

from davinci_forces.maths.arrays import Booleans, evenly
from davinci_forces.maths.uncertainty import bootstrap
from davinci_forces.maths.uncertainty.error_band import BLOCKS, FEWEST
from davinci_forces.records import ErrorBand, FilterNoise, FreeMotion

LOGS = 20  # at most, that a band is made of


def run(motions: Iterable[FreeMotion], noises: Iterable[FilterNoise]) -> Iterator[ErrorBand]:
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
    parts = logs if len(own) >= FEWEST else logs * BLOCKS + columns["block"]
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
