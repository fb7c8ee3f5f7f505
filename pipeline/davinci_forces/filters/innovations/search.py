"""Search for the causes of innovations that are not white, by removing one after the other.

A cause is named only if the innovations pass every test without it.  As few causes as possible are removed at once; if
several removals suffice, each is named.  A test may pass by chance, so the smallest probability has to grow by the
factor `MIN_GROWTH`.  A test may also pass because samples are omitted; so if as many other samples are omitted
instead, the tests must still fail.
"""

from collections.abc import Iterator
from itertools import combinations
from typing import NamedTuple

from davinci_forces.filters.innovations.trials import (
    CLOCK,
    COLOUR,
    CONTACT,
    FINER_STEPS,
    LEVEL,
    REVERSALS,
    SIZES,
    STEP,
    WALK,
    Passes,
    Subject,
    Trial,
)

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
    STEP: "the error of the filter's integration step",
}
NO_CAUSE = "not white: no tested cause explains it"
BY_CHANCE = "not white, but only slightly, as happens by chance in one of many runs"
MIN_SHARE_NAMED = 0.5  # a cause is named if it explains at least this share of the correlation


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


def search(subject: Subject) -> CauseSearch:
    """Find the fewest causes without which the innovations are white."""
    passes = Passes(subject)
    trials = [passes.trial(())]
    possible_causes = list(causes(subject))
    for size in range(1, MAX_CAUSES + 1):
        if trials[0].white or trials[0].tested < MIN_SAMPLES_TRIAL:
            break
        explaining: list[Trial] = []
        for without in combinations(possible_causes, size):
            if not may_combine(without, subject, explaining):
                continue
            trial = passes.trial(without)
            trials.append(trial)
            enough = trial.tested >= MIN_SAMPLES_TRIAL and trial.lowest > MIN_GROWTH * trials[0].lowest
            if trial.white and enough and passes.fails_elsewhere(without):
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
    if subject.filter in FINER_STEPS:
        yield STEP
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


def classify(search: CauseSearch) -> str:
    """Classify the result: white, white where samples are left out, explained by a cause, or unexplained."""
    if search.trials[0].white:
        return WHITE
    if not search.explaining:
        return UNEXPLAINED
    return LEFT_OUT if any({*trial.without} <= {*OMITTED} for trial in search.explaining) else MENDED


def verdict(search: CauseSearch) -> str:
    """Return the result in words, with all explanations."""
    if search.trials[0].white:
        return "white"
    return "; or ".join(map(describe_trial, search.explaining)) or describe_unexplained(search)


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
