"""All rules of the report: the limits of good, caution and problem."""

import csv
import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from scipy.special import bdtr

from davinci_forces.files import read_bytes, text_of
from davinci_forces.maths.arrays import Booleans
from davinci_forces.maths.uncertainty.error_band import NORMAL_95
from davinci_forces.records import Contact, FreeSpace, LogSummary, PathShare, Prediction, Stiffness
from davinci_forces.records.forces import MIN_COVERAGE
from davinci_forces.records.weight import SAME, TorqueConstant, Weight
from davinci_forces.report.content import Level, Number, in_format

GOOD, CAUTION = 0.10, 0.25  # model error over the root mean square of the measured effort
NO_ERROR = 0.05  # of its standard error: a smaller model error is stated as below twice its standard error
DETECTED, DETECTABLE = 1 / 3, 1.0  # detection level over the effort that the user wants to see
PRECISE, ROUGH = 0.10, 0.25  # standard error of a stiffness or a mass over its value
LIFTED_MASS = "lifted mass"  # the parameter of a slide that a reversed direction makes negative
TURN_AROUND = "write `sign = -1` with its position, velocity and effort, all three"
CONSTANT = 0.5  # share of a model error's square above which its mean is named
MIN_COUNTED = 0.5  # share of the pushes in contact that a stiffness is the median of; it is not that of a minority
# Share of a path's variance that no fitted path explains; the stage `predict` uses the same limit.
MIN_NEW_PATH = 0.0975
MAX_SPEED_RATIO = 1.5  # speed of a log over that of the fastest fitted one; the model extrapolates above it
MAX_OUTSIDE = 0.1  # share of samples beyond all fitted positions, above which page one says so
BEYOND = "beyond all fitted positions by more than 5 % of their range"  # OUTSIDE_MARGIN
MIN_MOVING = 0.5  # share of a run in motion; at rest, friction takes any value, and the run says nothing of the model
SMALL = 2.0  # of the alarm level: peaks of contacts below it may be errors of the model
COVERED = (MIN_COVERAGE, 0.98)  # coverage of a right 95 % band: not too narrow, not too wide
NEAR_SINGULAR = 100.0  # condition number of the tip's Jacobian; the stage `resolve` uses the same limit
WITHIN = {1: 0.6827, 2: 0.95, 4: 0.99994}  # share of right errors below this number of standard errors
DOUBTED = 0.05  # probability of the joints' masses, if they agree, below which a verdict states it
UNLIKELY = 0.01  # probability below which a test fails
MAX_PERIOD_NOISE = 3.0  # noise of a period over that of the median period
MAX_DUPLICATES = 0.1  # share of the rows of a log that repeat the row before
MAX_JITTER = 0.1  # standard deviation of a clock over its interval
WORDS: dict[Level, str] = {  # the mark and its word stay on one line
    "good": "●\N{NO-BREAK SPACE}Good",
    "warn": "▲\N{NO-BREAK SPACE}Caution",
    "bad": "✖\N{NO-BREAK SPACE}Problem",
}


@dataclass(frozen=True)
class Trust:
    """The trust in the external effort of one joint, from its worst run that was not fitted (see `decisive`)."""

    joint: str
    prediction: Prediction | None
    space: FreeSpace | None
    sought: float | None  # the effort that the user wants to see
    about: PathShare | None = None  # of the predicted run
    covered: FreeSpace | None = None  # the free space with the lowest coverage; `space` where it is None

    @property
    def share(self) -> float:
        """Model error over the root mean square of the effort; NaN if no run was predicted."""
        p = self.prediction
        return p.model_error / p.effort_rms if p is not None and p.effort_rms > 0 else math.nan

    @property
    def fineness(self) -> float:
        """Detection level over the effort sought; NaN if the study states no effort."""
        return self.space.detection_level / self.sought if self.space is not None and self.sought else math.nan

    @property
    def same_path(self) -> bool:
        """Whether the run repeats the path of another fitted log, or of its own; there the model's error repeats."""
        return self.prediction is not None and repeats_path(self.prediction, self.about)

    @property
    def of_parts(self) -> bool:
        """Whether parts of a fitted log decide, which refits left out."""
        return self.prediction is not None and not is_out_of_log(self.prediction)

    @property
    def new_path(self) -> str:
        """The share of the run's path that no fit had, as it is printed; a dash where parts of a fitted log decide."""
        return percent(self.about.path_new if self.about is not None and not self.of_parts else math.nan)

    @property
    def at_rest(self) -> bool:
        """Whether the joint stands still for most of the run."""
        return self.about is not None and self.about.moving < MIN_MOVING

    @property
    def level(self) -> Level:
        """The verdict by the effort sought if one is stated, else by the model error.

        It is never good on the same path, or without an effort in free space.  A joint at rest is neither good nor a
        problem.
        """
        by = grade(self.fineness, DETECTED, DETECTABLE) if self.sought else grade(self.share, GOOD, CAUTION)
        return "warn" if self.at_rest or (by == "good" and (self.same_path or self.space is None)) else by

    @property
    def narrow(self) -> bool:
        """Whether the 95 % band covers too few samples of free space."""
        return self.narrowest is not None and band(self.narrowest.coverage) == "bad"

    @property
    def narrowest(self) -> FreeSpace | None:
        """The free space of which the 95 % band covers the smallest share of samples."""
        return self.covered or self.space

    @property
    def words(self) -> str:
        """The verdict as it is printed."""
        return verdict_words(self.level, self.same_path, self.narrow) + (", at rest" if self.at_rest else "")


def is_out_of_log(p: Prediction) -> bool:
    """Whether the fit has seen no part of the log."""
    return p.role != "identification" or p.scheme.endswith(("log out", "logs out"))


def repeats_path(p: Prediction, about: PathShare | None) -> bool:
    """Whether a run that was predicted repeats a fitted path."""
    if is_out_of_log(p) and about is not None:
        return about.path_new < MIN_NEW_PATH
    return p.path == "same path"


def decisive(
    predictions: Sequence[Prediction], shares: Sequence[PathShare]
) -> tuple[Prediction | None, PathShare | None]:
    """Choose the run that decides on a joint: the worst of those that say most about unseen motion.

    A run in motion says more than one mostly at rest, and a whole log more than parts of one.  Among them, a new path
    says more than a fitted one, and a log that no fit uses more than one that refits leave out.  The worst has the
    largest error: as a share, that of slow motion, whose effort is small, would always be.
    """
    by_log = {share.log: share for share in shares}

    def rank(p: Prediction) -> tuple[bool, ...]:
        about = by_log.get(p.log)
        moves = about is None or about.moving >= MIN_MOVING
        return moves, is_out_of_log(p), not repeats_path(p, about), p.role != "identification"

    best = max(map(rank, predictions), default=())
    worst = max((p for p in predictions if rank(p) == best), key=lambda p: p.model_error, default=None)
    return worst, by_log.get(worst.log) if worst is not None else None


def stiffness_level(tissue: Stiffness, true: float | None = None) -> Level:
    """Grade a stiffness by its standard error; good needs two pushes, half of all, and an interval with the truth."""
    if not tissue.pushes or tissue.stiffness <= 0:
        return "bad"
    level = grade(tissue.stiffness_std / tissue.stiffness, PRECISE, ROUGH)
    if level == "good" and (tissue.pushes == 1 or is_minority(tissue)):
        return "warn"
    missed = true is not None and abs(tissue.stiffness - true) > NORMAL_95 * tissue.stiffness_std
    return "info" if level == "good" and missed else level


def is_minority(tissue: Stiffness) -> bool:
    """Whether most of the pushes in contact do not count."""
    return tissue.pushes < MIN_COUNTED * len(tissue)


def mass_level(weight: Weight, constants: Sequence[TorqueConstant]) -> tuple[Level, str]:
    """Grade a mass, and say why; good needs the side, agreeing joints, and a narrow interval with the stated mass.

    A mass does not test torque constants that its own log gave: `constants` are those of the joints of which the
    study states one.
    """
    if weight.side == "the other one":
        return "warn", "side"
    if weight.differing:
        return "warn", "joints"
    if is_impossible(weight.mass, weight.mass_std):
        return "warn", "sign"
    if math.isnan(weight.stated_mass):
        return "info", "unstated"
    if any(is_taken(constant) for constant in constants if constant.log == weight.log):
        return "info", "taken"
    if not is_same(weight.mass, weight.mass_std, weight.stated_mass):
        return "warn", "scale"
    return ("good", "right") if weight.mass_std <= PRECISE * weight.stated_mass else ("warn", "wide")


def is_same(value: float, std: float, stated: float) -> bool:
    """Whether a stated mass or constant lies in the 95 % interval of its estimate, or within `SAME` of it."""
    return abs(value - stated) <= max(NORMAL_95 * std, SAME * abs(stated))


def doubt_of_mass(weight: Weight) -> str:
    """How well the joints agree on a mass, in brackets after it, where they do so poorly; else ""."""
    is_poor = weight.agreement < DOUBTED and weight.side != "the other one"
    return f" (its joints agree poorly: p-value {Number(weight.agreement, digits=2, least=0.001)})" * is_poor


def is_taken(constant: TorqueConstant) -> bool:
    """Whether the torque constant in use is the one that the log gives, to four digits or as many as are printed."""
    given, used = constant.torque_constant, constant.torque_constant_used
    printed = math.floor(math.log10(abs(given))) - math.floor(math.log10(constant.torque_constant_std)) + 2
    least = min(max(printed, 2), 4)
    has_fewer = used == float(f"{used:.{least - 1}g}")  # a round number, as of a data sheet
    return not has_fewer and any(math.isclose(used, float(f"{given:.{n}g}"), rel_tol=1e-9) for n in range(least, 9))


def truth_level(errors: Sequence[float]) -> tuple[Level, str]:
    """Whether errors in standard errors are as small as right intervals make them, and how many lie within 1, 2 and 4.

    It is a problem if so few within 2 or 4 are unlikely (binomial), and information if so many within 1 are.
    """
    n = len(errors)
    counts = {width: sum(error <= width for error in errors) for width in WITHIN}
    words = ", ".join(f"{k} within {width}" for width, k in counts.items()) + " standard errors"
    if any(bdtr(counts[width], n, WITHIN[width]) < UNLIKELY for width in (2, 4)):
        return "bad", f"{words}; the stated errors are too small"
    too_wide = 1.0 - bdtr(counts[1] - 1, n, WITHIN[1]) < UNLIKELY
    return ("info", f"{words}; the stated errors are too large") if too_wide else ("good", words)


def is_impossible(value: float, std: float) -> bool:
    """Whether a value that physics makes positive is negative beyond its standard error."""
    return value + NORMAL_95 * std < 0.0


def log_remarks(summary: LogSummary) -> list[str]:
    """The remarks about a log; a log without any is read well."""
    texts = list(summary.warnings)
    if summary.dropped:
        texts.append(f"{summary.dropped} rows could not be used")
    if summary.duplicates > MAX_DUPLICATES * summary.rows:
        texts.append(f"{summary.duplicates} of {summary.rows} rows repeat the row before")
    if summary.jitter * summary.rate >= MAX_JITTER:
        texts.append(f"the clock jitters by {summary.jitter * 1e3:.3g} ms")
    return texts


def verdict_words(level: Level, same_path: bool, narrow: bool) -> str:
    """A verdict with its limitation; the word "Good" is not printed with a band that is too narrow."""
    if level == "good" and narrow:
        return "▲\N{NO-BREAK SPACE}Narrow band"
    return WORDS[level] + (", same path" if same_path else "")


def grade(share: float, good: float, caution: float) -> Level:
    """Grade a share as good, caution or problem; NaN calls for caution."""
    if math.isnan(share):
        return "warn"
    return "good" if share <= good else "warn" if share <= caution else "bad"


def is_small(contact: Contact) -> Booleans:
    """Whether each contact (C,) that nobody stated is so near the alarm level that it may be an error of the model."""
    return np.asarray((np.abs(contact.peak) < SMALL * contact.alarm_level) & (contact.stated == 0))


def is_mostly_constant(p: Prediction) -> bool:
    """Whether most of a model's squared error is that of its mean, beyond four standard errors of the mean."""
    return p.mean_error**2 > CONSTANT * p.model_error**2 and abs(p.mean_error) > 4.0 * p.mean_error_std


def band(coverage: float) -> Level:
    """Grade a 95 % band by the share of free-space samples that it covers, as printed; too wide is no problem."""
    printed = round(coverage, 2)
    return "bad" if printed < COVERED[0] else "info" if printed > COVERED[1] else "good"


def band_in_words(coverage: float, coverage_std: float = 0.0) -> str:
    """Whether a 95 % band that covers this share of free-space samples is too narrow, surely too wide or neither."""
    if band(coverage) == "info" and coverage - NORMAL_95 * coverage_std > 0.95:
        return "too wide"
    return "too narrow" if band(coverage) == "bad" else "wide enough"


def percent(share: float) -> str:
    """A share as it is printed."""
    return "–" if math.isnan(share) else "< 1 %" if 0.0 < share < 0.005 else in_format(round(100 * share), "d") + " %"


def covered_share(space: FreeSpace) -> str:
    """The share of free-space samples in a 95 % band, with its standard error."""
    std = f" ± {round(100 * space.coverage_std)}" * (space.coverage_std >= 0.005)
    return f"{round(100 * space.coverage)}{std} %"


def is_hidden(error: float, std: float | None) -> bool:
    """Whether a model error, the root of a difference that is at least 0, would be printed as 0.00 ± 0.12."""
    return std is not None and std > 0.0 and error <= NO_ERROR * std


def error_share(p: Prediction | None) -> str:
    """The model error over the root mean square of the effort, as it is printed; at most twice its error if hidden.

    In whole percent, or in as many digits as show that it is above a bound of a verdict.
    """
    if p is None or not p.effort_rms > 0.0:
        return percent(math.nan)
    most = f"< {max(math.ceil(200.0 * p.model_error_std / p.effort_rms), 1)} %"
    if is_hidden(p.model_error, p.model_error_std):
        return most
    share = p.model_error / p.effort_rms
    bound = next((100 * x for x in (GOOD, CAUTION) if share > x and percent(share) == percent(x)), math.inf)
    exact = (f"{100 * share:.{digits}f}" for digits in range(1, 9))
    return next((f"{text} %" for text in exact if float(text) > bound), percent(share))


def thresholds() -> list[tuple[str, ...]]:
    """The rows of the table of thresholds: quantity, measure, and the bounds of good, caution and problem."""
    shares = {
        "detected": DETECTED, "detectable": DETECTABLE, "good": GOOD, "caution": CAUTION, "new_path": MIN_NEW_PATH,
        "least": COVERED[0], "most": COVERED[1], "precise": PRECISE, "rough": ROUGH, "counted": MIN_COUNTED,
        "same": SAME, "unlikely": UNLIKELY,
    }  # fmt: skip
    limits = {name: percent(share) for name, share in shares.items()} | {"singular": f"{NEAR_SINGULAR:g}"}
    text = text_of(read_bytes(Path(__file__).with_name("thresholds.csv"))).format(**limits)
    return list(map(tuple, csv.reader(text.splitlines())))
