"""Test a filter's innovations with some causes of correlation removed: samples omitted, or errors corrected."""

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np

from davinci_forces.filters import DEFAULT, tracker
from davinci_forces.filters.innovations import coloured
from davinci_forces.filters.problem import FilterInput, NoiseModel
from davinci_forces.filters.tuning import likeliest_walk
from davinci_forces.maths.arrays import Array, Booleans, runs
from davinci_forces.maths.signals.whiteness import tests
from davinci_forces.maths.signals.windows import TRANSIENT, is_past_transient

LEVEL = 0.01  # probability below which a test rejects white noise
LAGS = 20  # number of lags of the Ljung-Box statistic
ELSEWHERE = 8  # number of other times at which as many samples are tested

CONTACT, REVERSALS = "contact", "reversals"  # their samples are omitted
STEP, WALK, SIZES, CLOCK, COLOUR = "step", "walk", "sizes", "clock", "colour"  # corrected, as other models are
FINER_STEPS = {"ekf_euler": DEFAULT}  # a filter, and the filter with smaller step errors


class Subject(NamedTuple):
    """A joint's run without a gap under each model, the one in use first; (N,) samples.

    The run with corrected sampling times is the additional model `CLOCK`.
    """

    models: Mapping[str, FilterInput]
    noise: NoiseModel
    free: Booleans  # whether nothing touches the robot
    moving: Booleans  # whether the joint is far from any reversal
    filter: str = DEFAULT


class Trial(NamedTuple):
    """The tests of the innovations with some causes removed."""

    without: tuple[str, ...]
    tested: int
    ljung_box: tuple[float, float]  # probabilities, of q and dq
    periodogram: tuple[float, float]
    excess: float  # the sum of squared autocorrelations beyond that of white noise, of q and dq together
    walk: float  # fitted `q_tau` over the `q_tau` in use

    @property
    def lowest(self) -> float:
        """Return the smallest probability."""
        return min(*self.ljung_box, *self.periodogram)

    @property
    def white(self) -> bool:
        """Whether every test passes."""
        return self.lowest > LEVEL


class Passes:
    """The filter passes over a run; fitted noise is kept for further trials."""

    def __init__(self, subject: Subject) -> None:
        self.subject = subject
        self._noises: dict[tuple[str, ...], coloured.Noise] = {}

    def trial(self, without: tuple[str, ...]) -> Trial:
        """Test the innovations without these causes."""
        pieces_q, pieces_dq = self.pieces(without, self.filtered_samples(without), self.tested_samples(without))
        (box_q, wave_q), (box_dq, wave_dq) = tests(pieces_q, LAGS), tests(pieces_dq, LAGS)
        tested = sum(map(len, pieces_q))
        excess = max(box_q.statistic + box_dq.statistic - 2.0 * LAGS, 0.0) / max(tested, 1)
        walk = self.noise(without).white.q_tau / self.subject.noise.q_tau if self.subject.noise.q_tau else 1.0
        probabilities = (box_q.probability, box_dq.probability)
        return Trial(without, tested, probabilities, (wave_q, wave_dq), excess, walk)

    def fails_elsewhere(self, without: tuple[str, ...]) -> bool:
        """Whether as many samples at most other times fail, where samples are omitted."""
        free, moving = self.filtered_samples(without), self.tested_samples(without)
        if free.all() and moving.all():
            return True
        failed = 0
        for i in range(1, ELSEWHERE + 1):
            later = round(len(free) * (i * 0.6180339887498949 % 1.0))  # even offsets, no multiples of a period
            pieces = self.pieces(without, np.roll(free, later), np.roll(moving, later))
            failed += any(min(box.probability, wave) <= LEVEL for box, wave in (tests(x, LAGS) for x in pieces))
        return failed > ELSEWHERE // 2

    def filtered_samples(self, without: tuple[str, ...]) -> Booleans:
        """Return the samples (N,) that the filter runs over."""
        return self.subject.free if CONTACT in without else np.ones_like(self.subject.free)

    def tested_samples(self, without: tuple[str, ...]) -> Booleans:
        """Return the samples (N,) whose innovations are tested."""
        return self.subject.moving if REVERSALS in without else np.ones_like(self.subject.moving)

    def run_under_model(self, without: tuple[str, ...]) -> FilterInput:
        """Return the run under the model that replaces a removed one, or the model in use."""
        names = list(self.subject.models)
        return self.subject.models[next((name for name in names[1:] if name in without), names[0])]

    def pieces(self, without: tuple[str, ...], free: Booleans, moving: Booleans) -> tuple[list[Array], list[Array]]:
        """Return the settled innovations of position and velocity, run by run."""
        pieces_q, pieces_dq = [], []
        for run in self.runs(free):
            part = self.run_under_model(without).part(run)
            i_q, i_dq = self.innovations(without, part)
            for piece in runs(is_past_transient(np.asarray(np.arange(len(i_q)) * part.T_s, np.float64)) & moving[run]):
                if piece.stop - piece.start > LAGS:
                    pieces_q.append(i_q[piece])
                    pieces_dq.append(i_dq[piece])
        return pieces_q, pieces_dq

    def runs(self, free: Booleans) -> list[slice]:
        """Return the runs that are long enough for the filter to settle, or else the longest run."""
        T_s = next(iter(self.subject.models.values())).T_s
        long = [run for run in runs(free) if (run.stop - run.start) * T_s > 6.0 * TRANSIENT]
        return long or [max(runs(free), key=lambda run: run.stop - run.start, default=slice(0, 0))]

    def innovations(self, without: tuple[str, ...], part: FilterInput) -> tuple[Array, Array]:
        """Compute the innovations of one run."""
        noise = self.noise(without)
        if COLOUR in without:
            return coloured.innovations(part, noise)
        name = FINER_STEPS[self.subject.filter] if STEP in without else self.subject.filter
        tracked = tracker(name)(part, noise.white)
        return tracked.innovation_q, tracked.innovation_dq

    def noise(self, without: tuple[str, ...]) -> coloured.Noise:
        """Return the noise in use, or that of greatest likelihood if noise is a removed cause."""
        key = tuple(name for name in without if name != REVERSALS)
        if not {WALK, SIZES, CLOCK, COLOUR} & {*key}:
            return coloured.Noise(self.subject.noise, coloured.UNCOLOURED)
        if key not in self._noises:
            self._noises[key] = self._fit_noise(key)
        return self._noises[key]

    def _fit_noise(self, without: tuple[str, ...]) -> coloured.Noise:
        noise, recording = self.subject.noise, self.run_under_model(without)
        parts = [recording.part(run) for run in self.runs(self.filtered_samples(without))]
        if WALK in without:
            noise = noise._replace(q_tau=likeliest_walk(parts, noise))
        if not {SIZES, CLOCK, COLOUR} & {*without}:
            return coloured.Noise(noise, coloured.UNCOLOURED)
        longest = max(parts, key=lambda part: len(part.q))
        return coloured.fit_noise(longest, noise, WALK in without, COLOUR in without)
