"""Calibrate the band: what the filter makes of free motion by a fit that has not seen it."""

from collections.abc import Iterator

import numpy as np

from davinci_forces.filters import DEFAULT, diverges, through
from davinci_forces.filters.assumed import assumed
from davinci_forces.filters.lag import lag
from davinci_forces.filters.problem import driven
from davinci_forces.maths.signals.windows import free_space
from davinci_forces.maths.uncertainty.error_band import cells
from davinci_forces.records import FilterNoise, FreeMotion, JointModel
from davinci_forces.robots.robot import Joint
from davinci_forces.study import LogEntry

FEWEST = 100  # samples of free motion, below which nothing is said of its error


def run(
    model: JointModel, noise: FilterNoise | None, entry: LogEntry, joint: Joint, *, q_tau: float
) -> Iterator[FreeMotion]:
    """The FreeMotion of a joint that moves, outside of contacts; of an identification log, by refits that left out what
    they predict.
    """
    if not entry.tells_free_space or model.at_rest or noise is None or not model.scheme:
        return
    free = free_space(model.t, entry.contact, model.rate)
    if int(free.sum()) < FEWEST:
        return
    parts = driven(model, np.where(np.isnan(model.tau_hat_unseen), model.tau_hat, model.tau_hat_unseen))
    assumes = assumed(noise, joint, 1.0 / model.rate, q_tau)
    made = through(DEFAULT, parts, assumes)
    if diverges(made):
        return
    _, block, speed_bin, count, mean_square, filter_square, _ = cells(
        made.tau_ext[free],
        (made.tau_ext_std**2 + lag(parts, assumes)[1] ** 2)[free],
        model.dq_measured[free],
        noise.speed,
    )
    yield FreeMotion(
        log=model.log, joint=model.joint, path=model.path_unseen, scheme=model.scheme, tested=int(free.sum()),
        free_mean=float(made.tau_ext[free].mean()), block=block, speed_bin=speed_bin, count=count,
        mean_square=mean_square, filter_square=filter_square,
    )  # fmt: skip
