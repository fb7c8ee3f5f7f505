"""What was observed of the joints of one identification log together, ready for normal equations of any model."""

from collections.abc import Iterable, Sequence
from typing import NamedTuple

import numpy as np

from davinci_forces.estimators.problem import NOTHING, Known, Regression
from davinci_forces.identification.regression import joined_motion, recorded_motion
from davinci_forces.maths.arrays import Array, Booleans, Integers
from davinci_forces.maths.models.memory import pieces
from davinci_forces.maths.models.model import ArmMotion, Model
from davinci_forces.maths.selection import BLOCKS, MOST, Equations, gathered, path_blocks, repetitions, side_by_side
from davinci_forces.maths.signals.smoothing import reach, smoothed
from davinci_forces.records import Average, Motion, Trajectory

PER_CUTOFF = 3  # samples kept per period of the low-pass's cutoff: more of them say nothing new


class Observed(NamedTuple):
    """The joints of one log on one clock."""

    records: tuple[Motion, ...]  # of n joints
    motion: ArmMotion
    tau: Array  # (N, n) effort, low-passed; NaN where a joint stands still: its friction takes any value
    block: Integers  # (N,) of the path
    period: Integers  # (N,) which repetition of the path; -1 where it does not repeat
    lowpass: float  # [Hz]
    number: int  # of the log, from 0
    white: dict[str, float]  # the noise of each joint's effort, where periods tell it

    @property
    def moving(self) -> Booleans:
        """Which of its joints move (n,)."""
        return np.array([not record.at_rest for record in self.records])

    def alone(self, joint: int) -> "Observed":
        """One joint by itself."""
        one = slice(joint, joint + 1)
        motion = self.motion._replace(**{name: getattr(self.motion, name)[:, one] for name in ("q", "dq", "ddq")})
        return self._replace(records=self.records[one], motion=motion, tau=self.tau[:, one])

    def rows(self, model: Model) -> tuple[Array, Array, Integers]:
        """Phi (K, m, p) and tau (K, m) of a model of these joints, through one low-pass, and the samples (K,) kept.

        Those at which none of the model's joints moves are left out.
        """
        names, rate = [record.joint for record in self.records], self.records[0].rate
        tau = self.tau[:, [names.index(effort) for effort in model.efforts]]
        step = max(1, int(rate / (PER_CUTOFF * self.lowpass)))
        wanted = (np.arange(len(tau)) % step == 0) & ~np.isnan(tau).all(axis=1)
        rows, kept = [], []
        for piece in pieces(model, self.motion, reach(rate, self.lowpass)):
            Phi, known = model.regressor(piece.motion)
            taken = np.flatnonzero(known[piece.inside] & wanted[piece.place])
            smooth = np.zeros((len(taken), *Phi.shape[1:]))
            some = Phi.any(axis=0)  # most columns are of one effort only
            smooth[:, some] = smoothed(Phi[:, some], piece.motion.segment, rate, self.lowpass)[piece.inside][taken]
            rows.append(smooth)
            kept.append(taken + piece.place.start)
        samples = np.concatenate(kept)
        return np.concatenate(rows), tau[samples], samples


def observed(records: Sequence[Motion], averages: Iterable[Average], lowpass: float, number: int) -> Observed:
    """The joints of one log, in their order, which share a clock."""
    first = records[0]
    own = {a.joint: a for a in averages if a.log == first.log}
    average = next(iter(own.values()), None)
    tau = np.stack([smooth_effort(r, lowpass) for r in records], axis=1)
    motion = joined_motion([recorded_motion(record) for record in records])
    moving, white = np.asarray(~np.isnan(tau).all(axis=1)), {joint: a.sigma_tau_white for joint, a in own.items()}
    block = path_blocks(first.t, average.period if average else 0.0, moving)
    period = np.full(len(first), -1)
    if average is not None:
        kept = averaged(first.t, average)
        # At most so many groups of whole periods.
        period[kept] = repetitions(first.t[kept], average.period) * min(average.periods, MOST) // average.periods
    return Observed(tuple(records), motion, tau, block, period, lowpass, number, white)


def smooth_effort(record: Motion, lowpass: float) -> Array:
    """The effort (N,) of a joint through the low-pass; NaN where it stands still, throughout where it is at rest."""
    if record.at_rest:
        return np.full(len(record), np.nan)
    return np.where(record.standing > 0, np.nan, smoothed(record.tau, record.segment, record.rate, lowpass))


def averaged(t: Array, own: Average | Trajectory) -> Booleans:
    """Which samples (N,), at these times [s], belong to the whole periods that were averaged."""
    since = t - own.t_start
    return np.asarray((since >= 0.0) & (since < own.periods * own.period - 0.5 / own.rate))


def pose_samples(
    model: Model, log: Observed, which: Booleans | None = None, known: Known = NOTHING
) -> tuple[Regression, Integers]:
    """The least squares problem of a joint of a log that does not repeat, and the samples (K,) that it is of.

    `which` (N,) samples are taken, all where it is left out.  Each counts as one period.
    """
    Phi, tau, kept = log.rows(model)
    if which is not None:
        Phi, tau, kept = Phi[which[kept]], tau[which[kept]], kept[which[kept]]
    names, ones = tuple(parameter.name for parameter in model.parameters), np.ones(len(kept), np.int64)
    return Regression(Phi[:, 0], tau[:, 0], np.zeros(len(kept)), ones, (0,), names, known), kept


def equations(model: Model, logs: Sequence[Observed], count: int) -> tuple[Integers, Equations, Equations]:
    """The normal equations in cells of the paths (6 a log) and of the periods (20 a log) of all `count` logs.

    And how many samples of each effort (m,) they are made of.
    """
    samples, by_block, by_period = np.zeros(len(model.efforts), np.int64), [], []
    for log in logs:
        Phi, tau, kept = log.rows(model)
        samples += (~np.isnan(tau)).sum(axis=0)
        by_block.append(gathered(Phi, tau, log.block[kept], BLOCKS))
        by_period.append(gathered(Phi, tau, log.period[kept], MOST))
    numbers = [log.number for log in logs]
    return samples, side_by_side(by_block, numbers, count), side_by_side(by_period, numbers, count)
