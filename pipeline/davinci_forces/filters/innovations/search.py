"""Search for the causes of innovations that are not white, by removing one after the other.

A cause is named only if the innovations pass every test without it.  As few causes as possible are removed at once; if
several removals suffice, each is named.  A test may pass by chance, so the smallest probability has to grow by the
factor `MIN_GROWTH`.  A test may also pass because samples are omitted; so if as many other samples are omitted
instead, the tests must still fail.
"""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from itertools import combinations
from typing import NamedTuple

import numpy as np

from davinci_forces.filters import DEFAULT, tracker
from davinci_forces.filters.innovations import coloured
from davinci_forces.filters.problem import FilterInput, NoiseModel
from davinci_forces.filters.response import likeliest_walk
from davinci_forces.maths.arrays import Array, Booleans, runs
from davinci_forces.maths.signals.whiteness import tests
from davinci_forces.maths.signals.windows import TRANSIENT, is_past_transient

LEVEL = 0.01  # probability below which a test rejects white noise
LAGS = 20  # number of lags of the Ljung-Box statistic
ELSEWHERE = 8  # number of other times at which as many samples are tested
CONTACT, REVERSALS = "contact", "reversals"  # their samples are omitted
WALK, SIZES, CLOCK, COLOUR = "walk", "sizes", "clock", "colour"  # corrected, as other models are
MIN_GROWTH = 100.0  # least factor by which the removal of a cause increases the smallest probability
MAX_SAMPLES_SEARCH = 50_000  # the first samples of a run
MIN_SAMPLES_TRIAL = 200  # tests on fewer samples are ignored
NEARLY_BEST = 0.95  # a trial is nearly best if it explains this part of the largest share
MAX_CAUSES = 3  # largest number of causes removed at once
WHITE, LEFT_OUT, MENDED, UNEXPLAINED = "white", "left out", "mended", "unexplained"
OMITTED = (CONTACT, REVERSALS)
CAUSES = {
    SIZES: "noise of another size than assumed",
    COLOUR: "coloured measurement noise",
    CLOCK: "uneven sampling times, as the other joints show",
}
NO_CAUSE = "not white: no tested cause explains it"
BY_CHANCE = "not white, but only slightly, as happens by chance in one of many runs"
MIN_SHARE_NAMED = 0.5  # a cause is named if it explains at least this share of the correlation


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


@dataclass(frozen=True, eq=False)
class Subject:
    """A joint's run without a gap, and the passes of the default filter over it; fitted noise is kept."""

    models: Mapping[str, FilterInput]  # the run (N,) under each model, that in use first, and `CLOCK` with even times
    noise: NoiseModel
    free: Booleans  # (N,) whether nothing touches the robot
    moving: Booleans  # (N,) whether the joint is far from any reversal
    _noises: dict[tuple[str, ...], coloured.Noise] = field(default_factory=dict)

    def trial(self, without: tuple[str, ...]) -> Trial:
        """Test the innovations without these causes."""
        pieces_q, pieces_dq = self.pieces(without, *self.samples(without))
        (box_q, wave_q), (box_dq, wave_dq) = tests(pieces_q, LAGS), tests(pieces_dq, LAGS)
        tested = sum(map(len, pieces_q))
        excess = max(box_q.statistic + box_dq.statistic - 2.0 * LAGS, 0.0) / max(tested, 1)
        walk = self.likeliest_noise(without).white.q_tau / self.noise.q_tau if self.noise.q_tau else 1.0
        probabilities = (box_q.probability, box_dq.probability)
        return Trial(without, tested, probabilities, (wave_q, wave_dq), excess, walk)

    def fails_elsewhere(self, without: tuple[str, ...]) -> bool:
        """Whether as many samples at most other times fail, where samples are omitted."""
        free, moving = self.samples(without)
        if free.all() and moving.all():
            return True
        failed = 0
        for i in range(1, ELSEWHERE + 1):
            later = round(len(free) * (i * 0.6180339887498949 % 1.0))  # even offsets, no multiples of a period
            pieces = self.pieces(without, np.roll(free, later), np.roll(moving, later))
            failed += any(min(box.probability, wave) <= LEVEL for box, wave in (tests(x, LAGS) for x in pieces))
        return failed > ELSEWHERE // 2

    def samples(self, without: tuple[str, ...]) -> tuple[Booleans, Booleans]:
        """Return the samples (N,) that the filter runs over, and those (N,) whose innovations are tested."""
        return self.free | (CONTACT not in without), self.moving | (REVERSALS not in without)

    def run_under_model(self, without: tuple[str, ...]) -> FilterInput:
        """Return the run under the model that replaces a removed one, or the model in use."""
        names = list(self.models)
        return self.models[next((name for name in names[1:] if name in without), names[0])]

    def pieces(self, without: tuple[str, ...], free: Booleans, moving: Booleans) -> tuple[list[Array], list[Array]]:
        """Return the settled innovations of position and velocity, run by run."""
        noise, pieces_q, pieces_dq = self.likeliest_noise(without), [], []
        for run in self.runs(free):
            part = self.run_under_model(without).part(run)
            tracked = coloured.track(part, noise) if COLOUR in without else tracker(DEFAULT)(part, noise.white)
            t = np.asarray(np.arange(part.samples) * part.T_s, np.float64)
            for piece in runs(is_past_transient(t) & moving[run]):
                if piece.stop - piece.start > LAGS:
                    pieces_q.append(tracked.innovation_q[piece])
                    pieces_dq.append(tracked.innovation_dq[piece])
        return pieces_q, pieces_dq

    def runs(self, free: Booleans) -> list[slice]:
        """Return the runs that are long enough for the filter to settle, or else the longest run."""
        T_s = next(iter(self.models.values())).T_s
        long = [run for run in runs(free) if (run.stop - run.start) * T_s > 6.0 * TRANSIENT]
        return long or [max(runs(free), key=lambda run: run.stop - run.start, default=slice(0, 0))]

    def likeliest_noise(self, without: tuple[str, ...]) -> coloured.Noise:
        """Return the noise in use, or that of greatest likelihood if noise is a removed cause."""
        key = tuple(name for name in without if name != REVERSALS)
        if key not in self._noises:
            self._noises[key] = self._fit_noise(key)
        return self._noises[key]

    def _fit_noise(self, without: tuple[str, ...]) -> coloured.Noise:
        noise, recording = self.noise, self.run_under_model(without)
        parts = [recording.part(run) for run in self.runs(self.samples(without)[0])]
        if WALK in without:
            noise = noise._replace(q_tau=likeliest_walk(parts, noise))
        if not {SIZES, CLOCK, COLOUR} & {*without}:
            return coloured.Noise(noise, coloured.UNCOLOURED)
        longest = max(parts, key=lambda part: len(part.q))
        return coloured.fit_noise(longest, noise, WALK in without, COLOUR in without)


class CauseSearch(NamedTuple):
    """All trials, the first of which removes no cause, and those that explain the correlation."""

    trials: list[Trial]
    explaining: list[Trial]

    def share(self, trial: Trial) -> float:
        """Return the share of the correlation that a trial removes."""
        excess = self.trials[0].excess
        return 1.0 - trial.excess / excess if excess > 0.0 else 0.0

    def nearest(self) -> Trial:
        """Return the trial of fewest causes among those that explain nearly the largest share."""
        trials = [trial for trial in self.trials if trial.tested >= MIN_SAMPLES_TRIAL] or self.trials[:1]
        largest = max(map(self.share, trials))
        return next(trial for trial in trials if self.share(trial) >= NEARLY_BEST * largest)

    @property
    def outcome(self) -> str:
        """Whether it is white, white where samples are left out, explained by a cause, or unexplained."""
        if self.trials[0].white:
            return WHITE
        if not self.explaining:
            return UNEXPLAINED
        return LEFT_OUT if any({*trial.without} <= {*OMITTED} for trial in self.explaining) else MENDED

    @property
    def verdict(self) -> str:
        """The result in words, with all explanations."""
        if self.trials[0].white:
            return WHITE
        return "; or ".join(map(describe_trial, self.explaining)) or describe_unexplained(self)


def search(subject: Subject) -> CauseSearch:
    """Find the fewest causes without which the innovations are white."""
    trials = [subject.trial(())]
    possible_causes = list(causes(subject))
    for size in range(1, MAX_CAUSES + 1):
        if trials[0].white or trials[0].tested < MIN_SAMPLES_TRIAL:
            break
        explaining: list[Trial] = []
        for without in combinations(possible_causes, size):
            if not may_combine(without, subject, explaining):
                continue
            trial = subject.trial(without)
            trials.append(trial)
            enough = trial.tested >= MIN_SAMPLES_TRIAL and trial.lowest > MIN_GROWTH * trials[0].lowest
            if trial.white and enough and subject.fails_elsewhere(without):
                explaining.append(trial)
        if explaining:
            return CauseSearch(trials, explaining)
    return CauseSearch(trials, [])


def causes(subject: Subject) -> Iterator[str]:
    """List the causes that can be removed from a run."""
    if not subject.free.all():
        yield CONTACT
    if not subject.moving.all():
        yield REVERSALS
    yield from (WALK, SIZES)
    yield from list(subject.models)[1:]
    yield COLOUR


def may_combine(without: tuple[str, ...], subject: Subject, explaining: list[Trial]) -> bool:
    """Whether these causes may be removed together.

    Causes are combined with at most one other model, and colour only with that of the clock.  Fits of colour and of the
    clock include sizes, so neither is tried if sizes suffice.  Of three causes, two omit samples.
    """
    if len(without) == MAX_CAUSES and not {CONTACT, REVERSALS} <= {*without}:
        return False
    others = {*list(subject.models)[1:]} & {*without}
    if len(others) > 1 or len({SIZES, COLOUR} & {*without}) > 1 or {SIZES, CLOCK} <= {*without}:
        return False
    if not {CLOCK, COLOUR} & {*without}:
        return True
    simpler = {*without} - {CLOCK, COLOUR} | {SIZES}
    return others <= {CLOCK} and all(simpler != {*trial.without} for trial in explaining)


def describe_trial(trial: Trial) -> str:
    """Describe an explaining trial: 'white outside contact', 'white except for coloured measurement noise'."""
    omitted = [name for name in OMITTED if name in trial.without]
    where = f" outside {' and '.join(omitted)}" if omitted else ""
    corrected = [cause(name, trial.walk) for name in trial.without if name not in OMITTED]
    return f"white{where}" + (f" except for {' and '.join(corrected)}" if corrected else "")


def describe_unexplained(search: CauseSearch) -> str:
    """Describe a search without explanation, by the causes of most of the correlation."""
    if search.trials[0].lowest > LEVEL / MIN_GROWTH:
        return BY_CHANCE
    nearest = search.nearest()
    share = search.share(nearest)
    if share < MIN_SHARE_NAMED:
        return NO_CAUSE
    names = " and ".join(name if name in OMITTED else cause(name, nearest.walk) for name in nearest.without)
    percent = f"{min(100 * share, 99):.0f} %"
    return f"not white: {percent} of the correlation is explained by {names}, the remainder by no tested cause"


def cause(name: str, walk: float) -> str:
    """Describe a cause that was corrected."""
    if name == WALK:
        return f"a random walk {'faster' if walk < 1.0 else 'slower'} than the data show"
    return CAUSES.get(name) or f"the model ({name} explains it)"
