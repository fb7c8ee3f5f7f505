"""What a filter's innovations look like with some causes of colour taken away: left out of the run, or mended."""

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np

from davinci_forces.filters import DEFAULT, tracker
from davinci_forces.filters.innovations import coloured
from davinci_forces.filters.problem import Driven, NoiseModel
from davinci_forces.filters.tuning import likeliest_walk
from davinci_forces.maths.arrays import Array, Booleans
from davinci_forces.maths.signals.whiteness import tests
from davinci_forces.maths.signals.windows import SETTLE, runs, settled

LEVEL = 0.01  # below this probability a test rejects white noise
LAGS = 20  # of the Ljung-Box statistic
ELSEWHERE = 8  # other times at which as many samples are tested

CONTACT, REVERSALS = "contact", "reversals"  # left out
STEP, WALK, SIZES, CLOCK, COLOUR = "step", "walk", "sizes", "clock", "colour"  # mended; so is each other model
STEPS = {"ekf_euler": DEFAULT}  # a filter, and the one that leaves less out of a step


class Subject(NamedTuple):
    """A joint's run without a gap, as the filter takes it under each model, the one in use first; (N,) samples.

    With the times of its samples mended it counts as another model, `CLOCK`.
    """

    models: Mapping[str, Driven]
    noise: NoiseModel
    free: Booleans  # whether nothing touches the robot
    moving: Booleans  # whether it is far from any reversal
    filter: str = DEFAULT


class Trial(NamedTuple):
    """The tests of the innovations with some causes taken away."""

    without: tuple[str, ...]
    tested: int
    ljung_box: tuple[float, float]  # probabilities, of q and dq
    periodogram: tuple[float, float]
    excess: float  # the sum of squared autocorrelations beyond that of white noise, of q and dq together
    walk: float  # over the one in use

    @property
    def least(self) -> float:
        """The smallest probability."""
        return min(*self.ljung_box, *self.periodogram)

    @property
    def white(self) -> bool:
        """Whether every test passes."""
        return self.least > LEVEL


class Passes:
    """The passes of filters over a subject; what was found likeliest is kept for other trials."""

    def __init__(self, subject: Subject) -> None:
        self.subject = subject
        self._noises: dict[tuple[str, ...], coloured.Noise] = {}

    def trial(self, without: tuple[str, ...]) -> Trial:
        """The tests without these causes."""
        pieces_q, pieces_dq = self.pieces(without, self.free(without), self.moving(without))
        (box_q, wave_q), (box_dq, wave_dq) = tests(pieces_q, LAGS), tests(pieces_dq, LAGS)
        tested = sum(map(len, pieces_q))
        excess = max(box_q.statistic + box_dq.statistic - 2.0 * LAGS, 0.0) / max(tested, 1)
        walk = self.noise(without).white.q_tau / self.subject.noise.q_tau if self.subject.noise.q_tau else 1.0
        probabilities = (box_q.probability, box_dq.probability)
        return Trial(without, tested, probabilities, (wave_q, wave_dq), excess, walk)

    def fails_elsewhere(self, without: tuple[str, ...]) -> bool:
        """Whether as many samples at most other times fail, where samples were left out."""
        free, moving = self.free(without), self.moving(without)
        if free.all() and moving.all():
            return True
        failed = 0
        for i in range(1, ELSEWHERE + 1):
            later = round(len(free) * (i * 0.6180339887498949 % 1.0))  # at even distances that fit no period
            pieces = self.pieces(without, np.roll(free, later), np.roll(moving, later))
            failed += any(min(box.probability, wave) <= LEVEL for box, wave in (tests(x, LAGS) for x in pieces))
        return failed > ELSEWHERE // 2

    def free(self, without: tuple[str, ...]) -> Booleans:
        """The samples that the filter goes through."""
        return self.subject.free if CONTACT in without else np.ones_like(self.subject.free)

    def moving(self, without: tuple[str, ...]) -> Booleans:
        """The samples of these that are tested."""
        return self.subject.moving if REVERSALS in without else np.ones_like(self.subject.moving)

    def driven(self, without: tuple[str, ...]) -> Driven:
        """The run under the model that is not a cause."""
        names = list(self.subject.models)
        return self.subject.models[next((name for name in names[1:] if name in without), names[0])]

    def pieces(self, without: tuple[str, ...], free: Booleans, moving: Booleans) -> tuple[list[Array], list[Array]]:
        """The innovations of position and velocity, settled, run by run."""
        pieces_q, pieces_dq = [], []
        for run in self.runs(free):
            part = self.driven(without).part(run)
            i_q, i_dq = self.innovations(without, part)
            for piece in runs(settled(np.asarray(np.arange(len(i_q)) * part.T_s, np.float64)) & moving[run]):
                if piece.stop - piece.start > LAGS:
                    pieces_q.append(i_q[piece])
                    pieces_dq.append(i_dq[piece])
        return pieces_q, pieces_dq

    def runs(self, free: Booleans) -> list[slice]:
        """Runs that are long enough for the filter to settle in."""
        T_s = next(iter(self.subject.models.values())).T_s
        found = [run for run in runs(free) if (run.stop - run.start) * T_s > 6.0 * SETTLE]
        return found or [max(runs(free), key=lambda run: run.stop - run.start, default=slice(0, 0))]

    def innovations(self, without: tuple[str, ...], part: Driven) -> tuple[Array, Array]:
        """Of one run."""
        noise = self.noise(without)
        if COLOUR in without:
            return coloured.innovations(part, noise)
        name = STEPS[self.subject.filter] if STEP in without else self.subject.filter
        made = tracker(name)(part, noise.white)
        return made.innovation_q, made.innovation_dq

    def noise(self, without: tuple[str, ...]) -> coloured.Noise:
        """What is assumed: the noise in use, or what is likeliest of it where that is what is mended."""
        key = tuple(name for name in without if name != REVERSALS)
        if not {WALK, SIZES, CLOCK, COLOUR} & {*key}:
            return coloured.Noise(self.subject.noise, coloured.UNCOLOURED)
        if key not in self._noises:
            self._noises[key] = self._likeliest(key)
        return self._noises[key]

    def _likeliest(self, without: tuple[str, ...]) -> coloured.Noise:
        used, driven = self.subject.noise, self.driven(without)
        parts = [driven.part(run) for run in self.runs(self.free(without))]
        if WALK in without:
            used = used._replace(q_tau=likeliest_walk(parts, used))
        if not {SIZES, CLOCK, COLOUR} & {*without}:
            return coloured.Noise(used, coloured.UNCOLOURED)
        longest = max(parts, key=lambda part: len(part.q))
        return coloured.likeliest(longest, used, WALK in without, COLOUR in without)
