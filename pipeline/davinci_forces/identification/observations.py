"""The joints of one identification log on one clock, ready for normal equations of any model."""

from collections.abc import Iterable, Sequence
from typing import NamedTuple

import numpy as np

from davinci_forces.estimators.problem import NO_PRIOR, Prior, Regression
from davinci_forces.identification.regression import joined_motion, recorded_motion
from davinci_forces.maths.arrays import Array, Booleans, Integers
from davinci_forces.maths.models.memory import pieces
from davinci_forces.maths.models.model import ArmMotion, Model
from davinci_forces.maths.selection import (
    MAX_GROUPS,
    PATH_BLOCKS,
    Equations,
    path_blocks,
    repetitions,
    side_by_side,
    sum_equations,
)
from davinci_forces.maths.signals.smoothing import lowpass_segments, reach
from davinci_forces.records import Average, Motion, Trajectory

SAMPLES_PER_CUTOFF = 3  # samples per period of the low-pass's cutoff: more samples add no information


class Observed(NamedTuple):
    """The joints of one log on one clock."""

    records: tuple[Motion, ...]  # of n joints
    motion: ArmMotion
    tau: Array  # (N, n) low-passed effort; NaN while a joint stands still and its friction is undetermined
    block: Integers  # (N,) of the path
    period: Integers  # (N,) number of the repetition of the path; -1 if it does not repeat
    lowpass: float  # [Hz]
    number: int  # of the log, from 0
    white: dict[str, float]  # standard deviation of each joint's effort noise, if periods repeat

    @property
    def is_moving(self) -> Booleans:
        """Whether each of its joints moves (n,)."""
        return np.array([not record.at_rest for record in self.records])

    def single_joint(self, joint: int) -> "Observed":
        """Return the log of one joint alone."""
        column = slice(joint, joint + 1)
        motion = self.motion._replace(**{name: getattr(self.motion, name)[:, column] for name in ("q", "dq", "ddq")})
        return self._replace(records=self.records[column], motion=motion, tau=self.tau[:, column])

    def rows(self, model: Model) -> tuple[Array, Array, Integers]:
        """Return low-passed Phi (K, m, p) and tau (K, m) of a model of these joints, and their samples (K,).

        Samples at which none of the model's joints moves are omitted.
        """
        names, rate = [record.joint for record in self.records], self.records[0].rate
        tau = self.tau[:, [names.index(effort) for effort in model.efforts]]
        step = max(1, int(rate / (SAMPLES_PER_CUTOFF * self.lowpass)))
        wanted = (np.arange(len(tau)) % step == 0) & ~np.isnan(tau).all(axis=1)
        rows, indices = [], []
        for piece in pieces(model, self.motion, reach(rate, self.lowpass)):
            Phi, is_known = model.regressor(piece.motion)
            taken = np.flatnonzero(is_known[piece.inside] & wanted[piece.place])
            smooth = np.zeros((len(taken), *Phi.shape[1:]))
            present = Phi.any(axis=0)  # most columns belong to one effort only
            passed = lowpass_segments(Phi[:, present], piece.motion.segment, rate, self.lowpass)
            smooth[:, present] = passed[piece.inside][taken]
            rows.append(smooth)
            indices.append(taken + piece.place.start)
        samples = np.concatenate(indices)
        return np.concatenate(rows), tau[samples], samples


def observe(records: Sequence[Motion], averages: Iterable[Average], lowpass: float, number: int) -> Observed:
    """Return the joints of one log, in their order; the joints share a clock."""
    first = records[0]
    by_joint = {a.joint: a for a in averages if a.log == first.log}
    average = next(iter(by_joint.values()), None)
    tau = np.stack([smooth_effort(r, lowpass) for r in records], axis=1)
    motion = joined_motion([recorded_motion(record) for record in records])
    moving = np.asarray(~np.isnan(tau).all(axis=1))
    white = {joint: a.sigma_tau_white for joint, a in by_joint.items()}
    block = path_blocks(first.t, average.period if average else 0.0, moving)
    period = np.full(len(first), -1)
    if average is not None:
        inside = averaged_samples(first.t, average)
        groups = min(average.periods, MAX_GROUPS)  # of whole periods
        period[inside] = repetitions(first.t[inside], average.period) * groups // average.periods
    return Observed(tuple(records), motion, tau, block, period, lowpass, number, white)


def smooth_effort(record: Motion, lowpass: float) -> Array:
    """Low-pass the effort (N,) of a joint; NaN while it stands still, and throughout if it is at rest."""
    if record.at_rest:
        return np.full(len(record), np.nan)
    return np.where(record.standing > 0, np.nan, lowpass_segments(record.tau, record.segment, record.rate, lowpass))


def averaged_samples(t: Array, average: Average | Trajectory) -> Booleans:
    """Return which samples (N,), at these times [s], belong to the averaged periods."""
    since = t - average.t_start
    return np.asarray((since >= 0.0) & (since < average.periods * average.period - 0.5 / average.rate))


def pose_samples(
    model: Model, log: Observed, which: Booleans | None = None, known: Prior = NO_PRIOR
) -> tuple[Regression, Integers]:
    """Return the least squares problem of a joint of a log that does not repeat, and its samples (K,).

    `which` (N,) selects samples; without it all are taken.  The weight of each sample is that of one period.
    """
    Phi, tau, samples = log.rows(model)
    if which is not None:
        Phi, tau, samples = Phi[which[samples]], tau[which[samples]], samples[which[samples]]
    names, ones = tuple(parameter.name for parameter in model.parameters), np.ones(len(samples), np.int64)
    return Regression(Phi[:, 0], tau[:, 0], np.zeros(len(samples)), ones, (0,), names, known), samples


def equations(model: Model, logs: Sequence[Observed], count: int) -> tuple[Integers, Equations, Equations]:
    """Return the normal equations of all `count` logs in cells of the path (6 a log) and of the periods (20 a log).

    The first result is the number of samples (m,) of each effort in the equations.
    """
    samples, by_block, by_period = np.zeros(len(model.efforts), np.int64), [], []
    for log in logs:
        Phi, tau, rows = log.rows(model)
        samples += (~np.isnan(tau)).sum(axis=0)
        by_block.append(sum_equations(Phi, tau, log.block[rows], PATH_BLOCKS))
        by_period.append(sum_equations(Phi, tau, log.period[rows], MAX_GROUPS))
    numbers = [log.number for log in logs]
    return samples, side_by_side(by_block, numbers, count), side_by_side(by_period, numbers, count)
