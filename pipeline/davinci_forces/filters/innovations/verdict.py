"""What a search for causes found, in words."""

from davinci_forces.filters.innovations.search import CLEARLY, CauseSearch
from davinci_forces.filters.innovations.trials import CLOCK, COLOUR, CONTACT, LEVEL, REVERSALS, SIZES, STEP, WALK, Trial

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
