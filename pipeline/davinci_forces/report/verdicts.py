"""All thresholds of the report: the limits of good, caution and problem."""

import math
from dataclasses import dataclass

from davinci_forces.records import FreeSpace, Prediction
from davinci_forces.report.content import Cell, Level

GOOD, CAUTION = 0.10, 0.25  # model error over the root mean square of the measured effort
DETECTED, DETECTABLE = 1 / 3, 1.0  # detection level over the effort that the user wants to see
STIFF, STIFFER = 0.10, 0.25  # standard error of a stiffness over the stiffness
COVERED = (0.90, 0.98)  # coverage of a right 95 % band: not too narrow, not too wide
NEAR_SINGULAR = 100.0  # condition number of the tip's Jacobian; the stage `resolve` uses the same limit
WITHIN = 4.0  # largest accepted error of an estimate in standard errors
WORDS: dict[Level, str] = {  # the mark and its word stay on one line
    "good": "●\N{NO-BREAK SPACE}Good",
    "warn": "▲\N{NO-BREAK SPACE}Caution",
    "bad": "✖\N{NO-BREAK SPACE}Problem",
}


@dataclass(frozen=True)
class Trust:
    """The trust in the external effort of one joint, from its worst run that was not fitted."""

    joint: str
    prediction: Prediction | None
    space: FreeSpace | None
    sought: float | None  # the effort that the user wants to see

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
        """Whether the run repeats the fitted path; there the model's error repeats, too."""
        return self.prediction is not None and self.prediction.path == "same path"

    @property
    def level(self) -> Level:
        """The verdict by the effort sought if one is stated, else by the model error; never good on the same path."""
        by = grade(self.fineness, DETECTED, DETECTABLE) if self.sought else grade(self.share, GOOD, CAUTION)
        return "warn" if by == "good" and self.same_path else by

    @property
    def narrow(self) -> bool:
        """Whether the 95 % band covers too few samples of free space."""
        return self.space is not None and band(self.space.coverage) == "bad"

    @property
    def words(self) -> str:
        """The verdict as it is printed."""
        return verdict_words(self.level, self.same_path, self.narrow)


def verdict_words(level: Level, same_path: bool, narrow: bool) -> str:
    """A verdict with its limitation; the word "Good" is not printed with a band that is too narrow."""
    if level == "good" and narrow:
        return "●\N{NO-BREAK SPACE}Small error, narrow band"
    return WORDS[level] + (", same path" if same_path else "")


def grade(share: float, good: float, caution: float) -> Level:
    """Grade a share as good, caution or problem; NaN calls for caution."""
    if math.isnan(share):
        return "warn"
    return "good" if share <= good else "warn" if share <= caution else "bad"


def band(coverage: float) -> Level:
    """Grade a 95 % band by the share of free-space samples that it covers; too wide is no problem."""
    return "bad" if coverage < COVERED[0] else "info" if coverage > COVERED[1] else "good"


def band_in_words(coverage: float) -> str:
    """Whether a 95 % band that covers this share of free-space samples is too narrow, right or too wide."""
    return {"bad": "too narrow", "info": "too wide", "good": "right"}[band(coverage)]


def percent(share: float) -> str:
    """A share as it is printed."""
    return "–" if math.isnan(share) else f"{100 * share:.0f} %"


def thresholds() -> tuple[tuple[Cell, ...], ...]:
    """The rows of the table of thresholds: quantity, measure, and the bounds of good, caution and problem."""
    return (
        ("External effort of a joint, if the study states the `effort` sought", "detection level over this effort",
         f"at most {percent(DETECTED)}", f"at most {percent(DETECTABLE)}", "beyond"),
        ("External effort of a joint, if no `effort` is stated", "model error over the root mean square of the effort",
         f"at most {percent(GOOD)}, on a path that was not fitted", f"at most {percent(CAUTION)}, or the same path",
         "beyond"),
        ("95 % band of the external effort", "coverage: share of free-space samples in the band",
         f"{percent(COVERED[0])} to {percent(COVERED[1])}", f"above {percent(COVERED[1])}: too wide",
         f"below {percent(COVERED[0])}: too narrow"),
        ("Stiffness of tissue", "standard error over stiffness",
         f"at most {percent(STIFF)}, from at least two pushes", f"at most {percent(STIFFER)}",
         "beyond, or no usable push"),
        ("Pose of the tip", "condition number of its Jacobian", "–", f"above {NEAR_SINGULAR:g}: near singular", "–"),
        ("Parameter of a simulated study", "standard errors from the truth", f"at most {WITHIN:g}", "–", "beyond"),
        ("White noise", "p-value of the Ljung-Box test over 20 lags", "above 1 %", "–", "–"),
        ("Innovations of the filter", "p-values of this test and of the cumulative periodogram, both signals",
         "each above 1 %, in the whole run or outside contact and reversals",
         "below, with or without a known cause", "–"),
    )  # fmt: skip
