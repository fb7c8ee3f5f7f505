"""The joints of one identification log on one clock, ready for normal equations of any model."""

from collections.abc import Iterable, Sequence
from functools import reduce
from typing import NamedTuple

import numpy as np

from davinci_forces.estimators.problem import NO_PRIOR, Prior, Regression
from davinci_forces.identification.regression import averaged_motion, joined_motion, motion_at, stands_still
from davinci_forces.maths.arrays import Array, Booleans, Integers
from davinci_forces.maths.models.memory import pieces
from davinci_forces.maths.models.model import ArmMotion, Model
from davinci_forces.maths.periods.agreement import repetitions
from davinci_forces.maths.selection import MAX_GROUPS, PATH_BLOCKS, Equations, path_blocks, side_by_side, sum_equations
from davinci_forces.maths.signals.smoothing import lowpass_segments, reach
from davinci_forces.records import Average, Motion, Trajectory

SAMPLES_PER_CUTOFF = 3  # samples per period of the low-pass's cutoff: more samples add no information


class Processing(NamedTuple):
    """The low-pass of the motion and the effort of a joint, and the delay of its effort after the motion."""

    cutoff: float  # [Hz]
    effort_lag: float  # [s]


class Observed(NamedTuple):
    """The joints of one log on one clock."""

    records: tuple[Motion, ...]  # of n joints
    processing: tuple[Processing, ...]  # for the effort of each joint
    still: Booleans  # (N, n) whether each joint stands still, so that its friction is undetermined
    block: Integers  # (N,) of the path
    period: Integers  # (N,) number of the repetition of the path; -1 if it does not repeat
    lowpass: float  # [Hz] of the scores
    number: int  # of the log, from 0
    white: dict[str, float]  # standard deviation of each joint's effort noise, if periods repeat

    @property
    def joints(self) -> list[str]:
        """The names of its joints."""
        return [record.joint for record in self.records]

    @property
    def is_moving(self) -> Booleans:
        """Whether each of its joints moves (n,)."""
        return np.array([not record.at_rest for record in self.records])

    def single_joint(self, joint: int) -> "Observed":
        """Return the log of one joint alone."""
        column = slice(joint, joint + 1)
        records, processing, still = self.records[column], self.processing[column], self.still[:, column]
        return self._replace(records=records, processing=processing, still=still)

    def first_samples(self, number: int) -> "Observed":
        """Return the first samples of a longer log."""
        if number >= len(self.block):
            return self
        which = np.arange(number)  # a slice would keep the whole log in memory
        return self._replace(
            records=tuple(record.select(which) for record in self.records),
            **{name: getattr(self, name)[which] for name in ("still", "block", "period")},
        )

    def motion(self, joint: int) -> ArmMotion:
        """Compute the motion of all joints, as the effort of a joint is modelled with; a long log's is not kept."""
        return joined_motion([motion_at(record, *self.processing[joint]) for record in self.records])

    def rows(self, model: Model) -> tuple[Array, Array, Integers]:
        """Return low-passed Phi (K, m, p) and tau (K, m) of a model of these joints, and their samples (K,).

        Both pass the low-pass of their effort's processing.  An effort is NaN while its joint stands still.  Samples at
        which none of the model's joints moves are omitted.
        """
        [(Phi, tau)], samples = self.rows_at(model, [None])
        return Phi, tau, samples

    def rows_at(self, model: Model, cutoffs: Sequence[float | None]) -> tuple[list[tuple[Array, Array]], Integers]:
        """Return Phi and tau of `rows` at each of some cutoffs [Hz], None being the effort's own, and their samples."""
        columns = [self.joints.index(effort) for effort in model.efforts]
        step = max(1, int(self.records[0].rate / (SAMPLES_PER_CUTOFF * self.lowpass)))
        wanted = (np.arange(len(self.block)) % step == 0) & ~self.still[:, columns].all(axis=1)
        parts = {}
        for processing in dict.fromkeys(self.processing[i] for i in columns):
            efforts = [m for m, i in enumerate(columns) if self.processing[i] == processing]
            motion = self.motion(columns[efforts[0]])
            passed = [cutoff or processing.cutoff for cutoff in cutoffs]
            parts[tuple(efforts)] = self._smooth_rows(model, motion, efforts, passed, wanted)
        samples = reduce(np.intersect1d, (taken for _, taken in parts.values()))
        results = []
        for number, cutoff in enumerate(cutoffs):
            Phi = np.zeros((len(samples), len(columns), len(model.parameters)))
            for efforts_of_part, (rows, taken) in parts.items():
                Phi[:, list(efforts_of_part)] = rows[number][np.searchsorted(taken, samples)]
            tau = np.empty(Phi.shape[:2])
            for m, i in enumerate(columns):
                record = self.records[i]
                smooth = lowpass_segments(record.tau, record.segment, record.rate, cutoff or self.processing[i].cutoff)
                tau[:, m] = np.where(is_still(record), np.nan, smooth)[samples]
            results.append((Phi, tau))
        return results, samples

    def _smooth_rows(
        self, model: Model, motion: ArmMotion, efforts: Sequence[int], cutoffs: Sequence[float], wanted: Booleans
    ) -> tuple[list[Array], Integers]:
        """Phi (K, e, p) of efforts, low-passed at each cutoff, at wanted samples (N,) where it is known, and these."""
        rate, indices = self.records[0].rate, []
        rows: list[list[Array]] = [[] for _ in cutoffs]
        for piece in pieces(model, motion, max(reach(rate, cutoff) for cutoff in cutoffs)):
            Phi, is_known = model.regressor(piece.motion)
            Phi = Phi[:, efforts]
            taken = np.flatnonzero(is_known[piece.inside] & wanted[piece.place])
            present = Phi.any(axis=0)  # most columns belong to one effort only
            for at_cutoff, cutoff in zip(rows, cutoffs, strict=True):
                smooth = np.zeros((len(taken), *Phi.shape[1:]))
                passed = lowpass_segments(Phi[:, present], piece.motion.segment, rate, cutoff)
                smooth[:, present] = passed[piece.inside][taken]
                at_cutoff.append(smooth)
            indices.append(taken + piece.place.start)
        return [np.concatenate(at_cutoff) for at_cutoff in rows], np.concatenate(indices)


def observe(records: Sequence[Motion], averages: Iterable[Average], lowpass: float, number: int) -> Observed:
    """Return the joints of one log, in their order; the joints share a clock."""
    first = records[0]
    by_joint = {a.joint: a for a in averages if a.log == first.log}
    average = next(iter(by_joint.values()), None)
    still = np.stack([is_still(record) for record in records], axis=1)
    white = {joint: a.sigma_tau_white for joint, a in by_joint.items()}
    block = path_blocks(first.t, average.period if average else 0.0, np.asarray(~still.all(axis=1)))
    period = np.full(len(first), -1)
    if average is not None:
        inside = averaged_samples(first.t, average)
        groups = min(average.periods, MAX_GROUPS)  # of whole periods
        period[inside] = repetitions(first.t[inside], average.period) * groups // average.periods
    n, processing = len(records), Processing(lowpass, 0.0)
    return Observed(tuple(records), (processing,) * n, still, block, period, lowpass, number, white)


def is_evaluated(record: Motion) -> Booleans:
    """Whether each sample (N,) is fitted and scored: the joint moves there, and the sample was measured."""
    return np.asarray((record.standing == 0) & (record.filled == 0))


def is_still(record: Motion) -> Booleans:
    """Whether a joint stands still at each sample (N,), or the sample is only filled in: its effort is not used."""
    return ~is_evaluated(record) | bool(record.at_rest)


def averaged_samples(t: Array, average: Average | Trajectory) -> Booleans:
    """Return which samples (N,), at these times [s], belong to the averaged periods."""
    since = t - average.t_start
    return np.asarray((since >= 0.0) & (since < average.periods * average.period - 0.5 / average.rate))


def pose_samples(
    model: Model, log: Observed, which: Booleans | None = None, known: Prior = NO_PRIOR
) -> tuple[Regression, Integers]:
    """Return the least squares problem of a joint of a log without periods, at `which` samples (N,), and these (K,)."""
    Phi, tau, samples = log.rows(model)
    if which is not None:
        Phi, tau, samples = Phi[which[samples]], tau[which[samples]], samples[which[samples]]
    names, ones = tuple(parameter.name for parameter in model.parameters), np.ones(len(samples), np.int64)
    return Regression(Phi[:, 0], tau[:, 0], np.zeros(len(samples)), ones, (0,), names, known), samples


def block_equations(model: Model, log: "Trajectory | Observed") -> Equations:
    """Return the normal equations of the model of a joint by blocks of path, of a period or of a log's samples."""
    if isinstance(log, Observed):
        Phi, tau, rows = log.rows(model)
        return sum_equations(Phi, tau, log.block[rows], PATH_BLOCKS)
    root = np.sqrt(np.where(stands_still(log), 0, log.count))[:, None]
    Phi = model.regressor(averaged_motion(log)).Phi
    return sum_equations(root[:, :, None] * Phi, root * log.tau[:, None], path_blocks(log.t, log.period), PATH_BLOCKS)


class CellEquations(NamedTuple):
    """The normal equations of a model, by cells of the data."""

    samples: Integers  # (m,) number of samples of each effort
    sums: Array  # (m,) of these samples
    by_block: Equations  # 6 cells a log
    by_period: Equations  # 20 cells a log
    scored: Equations  # 6 cells a log, of the motion and the effort as they are scored


def equations(model: Model, logs: Sequence[Observed], count: int) -> CellEquations:
    """Return the normal equations of all `count` logs, in cells of the path and of the periods."""
    samples, sums = np.zeros(len(model.efforts), np.int64), np.zeros(len(model.efforts))
    by_block, by_period, scored = [], [], []
    for log in logs:
        differs = any(processing.cutoff != log.lowpass for processing in log.processing)
        passed, rows = log.rows_at(model, [None, log.lowpass] if differs else [None])
        samples += (~np.isnan(passed[0][1])).sum(axis=0)
        sums += np.nansum(passed[0][1], axis=0)
        by_block.append(sum_equations(*passed[0], log.block[rows], PATH_BLOCKS))
        by_period.append(sum_equations(*passed[0], log.period[rows], MAX_GROUPS))
        scored.append(sum_equations(*passed[1], log.block[rows], PATH_BLOCKS) if differs else by_block[-1])
    numbers = [log.number for log in logs]
    cells = (side_by_side(part, numbers, count) for part in (by_block, by_period, scored))
    return CellEquations(samples, sums, *cells)
