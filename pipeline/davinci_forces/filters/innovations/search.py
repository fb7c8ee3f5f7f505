"""Why a filter's innovations are not white, told by taking one cause after the other away.

A cause is named only where the innovations pass every test without it.  As few causes as possible are taken away at
once, and where several would do, each is named.  Two things could make a test pass that is no cause: chance, so the
smallest probability has to grow by `CLEARLY`; and that fewer samples are left to tell by, so as many samples at other
times, with what was left out among them, must still fail.
"""

from collections.abc import Iterator
from itertools import combinations
from typing import NamedTuple

from davinci_forces.filters.innovations.trials import (
    CLOCK,
    COLOUR,
    CONTACT,
    LEVEL,
    REVERSALS,
    SIZES,
    STEP,
    STEPS,
    WALK,
    Passes,
    Subject,
    Trial,
)

CLEARLY = 100.0  # times, that the smallest probability has to grow by where a cause is taken away
MOST = 50_000  # samples that the causes are looked for in
FEWEST = 200  # samples, fewer than which are left of a run tell nothing
NEAR = 0.95  # of the most that is explained
TOGETHER = 3  # causes that are taken away at once, at most
WHITE, LEFT_OUT, MENDED, UNEXPLAINED = "white", "left out", "mended", "unexplained"
LEAVING = (CONTACT, REVERSALS)
SAID = {
    SIZES: "noise of another size than assumed",
    COLOUR: "coloured measurement noise",
    CLOCK: "uneven times of the samples, as the other joints tell them",
    STEP: "what the filter's step leaves out",
}
NOTHING = "not white: no tested cause explains it"
BY_LITTLE = "not white, but by little, as one of many runs is by chance"
MOST_OF_IT = 0.5  # of the correlation, below which a cause is not worth its name


class CauseSearch(NamedTuple):
    """Every trial, the first of them with nothing taken away, and those that explain."""

    trials: list[Trial]
    explaining: list[Trial]

    def share(self, trial: Trial) -> float:
        """How much of the correlation is gone in a trial."""
        whole = self.trials[0].excess
        return 1.0 - trial.excess / whole if whole > 0.0 else 0.0

    def nearest(self) -> Trial:
        """Of those that come near to explaining the most, the one that takes least away."""
        told = [trial for trial in self.trials if trial.tested >= FEWEST] or self.trials[:1]
        most = max(map(self.share, told))
        return next(trial for trial in told if self.share(trial) >= NEAR * most)


def search(subject: Subject) -> CauseSearch:
    """The fewest causes without which the innovations are white."""
    first = next(iter(subject.models.values()))
    if len(first.q) > MOST:
        subject = beginning(subject)
    passes = Passes(subject)
    trials = [passes.trial(())]
    there = list(causes(subject))
    for size in range(1, TOGETHER + 1):
        if trials[0].white or trials[0].tested < FEWEST:
            break
        explaining: list[Trial] = []
        for without in combinations(there, size):
            if not possible(without, subject, explaining):
                continue
            trial = passes.trial(without)
            trials.append(trial)
            enough = trial.tested >= FEWEST and trial.least > CLEARLY * trials[0].least
            if trial.white and enough and passes.fails_elsewhere(without):
                explaining.append(trial)
        if explaining:
            return CauseSearch(trials, explaining)
    return CauseSearch(trials, [])


def causes(subject: Subject) -> Iterator[str]:
    """What can be taken away of a run."""
    if not subject.free.all():
        yield CONTACT
    if not subject.moving.all():
        yield REVERSALS
    if subject.filter in STEPS:
        yield STEP
    yield from (WALK, SIZES)
    yield from list(subject.models)[1:]
    yield COLOUR


def possible(without: tuple[str, ...], subject: Subject, explaining: list[Trial]) -> bool:
    """Whether these go together: one model at a time; sizes are part of colour and of the clock, which are not tried
    where sizes alone will do; no colour for another model; and of three, two are samples that are left out.
    """
    if len(without) == TOGETHER and not {CONTACT, REVERSALS} <= {*without}:
        return False
    others = {*list(subject.models)[1:]} & {*without}
    if len(others) > 1 or len({SIZES, COLOUR} & {*without}) > 1 or {SIZES, CLOCK} <= {*without}:
        return False
    if not {CLOCK, COLOUR} & {*without}:
        return True
    simpler = {*without} - {CLOCK, COLOUR} | {SIZES}
    return others <= {CLOCK} and all(simpler != {*trial.without} for trial in explaining)


def beginning(subject: Subject) -> Subject:
    """Its first samples."""
    few = slice(MOST)
    models = {name: driven.part(few) for name, driven in subject.models.items()}
    return subject._replace(models=models, free=subject.free[few], moving=subject.moving[few])


def finding(search: CauseSearch) -> str:
    """White, white where something is left out, explained by something that can be mended, or unexplained."""
    if search.trials[0].white:
        return WHITE
    if not search.explaining:
        return UNEXPLAINED
    return LEFT_OUT if any({*trial.without} <= {*LEAVING} for trial in search.explaining) else MENDED


def verdict(search: CauseSearch) -> str:
    """The same in words; where several would explain it, all of them."""
    if search.trials[0].white:
        return "white"
    return "; or ".join(explained(trial) for trial in search.explaining) or unexplained(search)


def explained(trial: Trial) -> str:
    """What one trial shows: 'white outside contact', 'white but for coloured measurement noise'."""
    left = [name for name in LEAVING if name in trial.without]
    where = f" outside {' and '.join(left)}" if left else ""
    mended = [cause(name, trial.walk) for name in trial.without if name not in LEAVING]
    return f"white{where}" + (f" but for {' and '.join(mended)}" if mended else "")


def unexplained(search: CauseSearch) -> str:
    """That nothing explains it, and what explains most of it."""
    if search.trials[0].least > LEVEL / CLEARLY:
        return BY_LITTLE
    nearest = search.nearest()
    share = search.share(nearest)
    if share < MOST_OF_IT:
        return NOTHING
    names = " and ".join(name if name in LEAVING else cause(name, nearest.walk) for name in nearest.without)
    said = f"{min(100 * share, 99):.0f} % of the correlation is explained by {names}, the rest by nothing tested"
    return f"not white: {said}"


def cause(name: str, walk: float) -> str:
    """One cause that was mended."""
    if name == WALK:
        return f"a walk {'faster' if walk < 1.0 else 'slower'} than the data ask"
    return SAID.get(name) or f"the model ({name} would do)"
