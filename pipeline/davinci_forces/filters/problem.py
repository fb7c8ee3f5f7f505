"""The input and the output of every filter."""

from collections.abc import Callable, Iterable, Iterator
from functools import partial
from typing import NamedTuple

import numpy as np

from davinci_forces.maths.arrays import BLOCK_SAMPLES, Array, row_blocks
from davinci_forces.maths.models.model import JointDynamics
from davinci_forces.maths.models.terms import COEFFICIENTS, VISCOUS
from davinci_forces.maths.signals.smoothing import segments
from davinci_forces.records import JointModel, Track
from davinci_forces.records.prediction import BIAS
from davinci_forces.robots.robot import Kind, Robot


class FilterInput(NamedTuple):
    """A recording as a filter takes it: (N,) samples in the joint's units; T_s [s].

    `ddq` has no delay; `initial_std` is the standard deviation of the external effort before the first sample.
    """

    joint: JointDynamics
    q: Array
    dq: Array
    ddq: Array
    tau: Array
    T_s: float
    initial_std: float

    @property
    def samples(self) -> int:
        """The number of samples."""
        return len(self.q)

    def part(self, which: slice) -> "FilterInput":
        """Return some of the samples, in their order."""
        joint = self.joint._replace(inertia=self.joint.inertia[which], known=self.joint.known[which])
        q, dq, ddq, tau = (x[which] for x in (self.q, self.dq, self.ddq, self.tau))
        return FilterInput(joint, q, dq, ddq, tau, self.T_s, self.initial_std)


class LongInput(NamedTuple):
    """A recording of many samples, which filters read in parts."""

    samples: int
    T_s: float
    initial_std: float
    part: Callable[[slice], FilterInput]


Recording = FilterInput | LongInput


def input_blocks(recording: Recording) -> Iterator[tuple[slice, FilterInput]]:
    """Yield the samples of a recording in blocks."""
    return ((rows, recording.part(rows)) for rows in row_blocks(recording.samples))


def column(recording: Recording, of: Callable[[FilterInput], Array]) -> Array:
    """Return one column (N,) of a recording."""
    values = np.empty(recording.samples)
    for rows, part in input_blocks(recording):
        values[rows] = of(part)
    return values


def joint_at_rest(
    inertia: Array | float, viscous: float, tau: Array, T_s: float, initial_std: float = 1.0
) -> FilterInput:
    """Return a joint at rest whose motor exerts an effort (N,) on the environment; a filter is linear there."""
    still = np.zeros(len(tau))
    coefficients = tuple(viscous if i == VISCOUS else 0.0 for i in range(len(COEFFICIENTS)))
    dynamics = JointDynamics(np.full(len(tau), inertia), coefficients, still)
    return FilterInput(dynamics, still, still, still, tau, T_s, initial_std)


class NoiseModel(NamedTuple):
    """Standard deviations of the measurements, and of the process noise of each state over a sample."""

    r_q: float
    r_dq: float
    q_q: float
    q_dq: float  # due to an acceleration that is constant over the sample and changes q by T_s q_dq / 2
    q_tau: float  # of one step of the random walk


class Tracked(NamedTuple):
    """The states of a filter over (N,) samples, their uncertainty, and the normalised innovation squared (NIS).

    A filter without innovations returns 0 for them and for `nis`.
    """

    q: Array
    dq: Array
    tau_ext: Array
    tau_ext_std: Array
    innovation_q: Array
    innovation_dq: Array
    nis: Array


Filter = Callable[[Recording, NoiseModel], Tracked]
Block = tuple[slice, Tracked]  # some samples of a recording, and what a filter made of them


def join_blocks(blocks: Iterable[Block], N: int, names: Iterable[str] = Tracked._fields) -> Tracked:
    """Join the blocks of N samples; columns that are not named are empty."""
    columns = {name: np.empty(N) for name in names}
    for rows, tracked in blocks:
        for name, column in columns.items():
            column[rows] = getattr(tracked, name)
    return Tracked(**{name: columns.get(name, np.empty(0)) for name in Tracked._fields})


def filter_inputs(model: JointModel, tau_hat: Array | None = None, smooth: bool = False) -> list[Recording]:
    """Return the segments of a joint's log for a filter, which restarts after each gap.

    `tau_hat` (N,) is the effort of another fit, to be subtracted instead of the model's effort.  The motion is that
    measured, or low-passed if `smooth`.
    """
    coefficients = tuple(getattr(model, name) for name in BIAS)
    T_s, initial_std = 1.0 / model.rate, float(np.std(model.tau)) or 1.0

    def read(start: int, rows: slice) -> FilterInput:
        which = slice(start + rows.start, start + rows.stop)
        part = model.part(which)
        known = part.tau_known if tau_hat is None else part.tau_known + (tau_hat[which] - part.tau_hat)
        q, dq = (part.q, part.dq) if smooth else (part.q_measured, part.dq_measured)
        dynamics = JointDynamics(part.inertia, coefficients, known)
        return FilterInput(dynamics, q, dq, part.ddq, part.tau, T_s, initial_std)

    inputs = [LongInput(s.stop - s.start, T_s, initial_std, partial(read, s.start)) for s in segments(model.segment)]
    return [long.part(slice(0, long.samples)) if long.samples <= BLOCK_SAMPLES else long for long in inputs]


def prismatic_track(tracks: Iterable[Track], robot: Robot) -> Track | None:
    """Return the track of the prismatic joint that moves farthest, of those whose effort is a force, not a current."""
    forces = {joint.name for joint in robot.joints if joint.kind is Kind.PRISMATIC and not joint.effort}
    slides = [track for track in tracks if track.joint in forces and not track.at_rest]
    return max(slides, key=lambda track: float(np.ptp(track.q)), default=None)
