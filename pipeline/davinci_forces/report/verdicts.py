"""When a number is good, when it calls for caution, and when it is a problem: every threshold of the report."""

import math
from dataclasses import dataclass

from davinci_forces.records import FreeSpace, Prediction
from davinci_forces.report.content import Cell, Level

GOOD, CAUTION = 0.10, 0.25  # model error over the root mean square of the measured effort
DETECTED, DETECTABLE = 1 / 3, 1.0  # detection level over the effort that the user wants to see
STIFF, STIFFER = 0.10, 0.25  # standard error of a stiffness over it
COVERED = (0.90, 0.98)  # coverage of a 95 % band that is right
NEAR_SINGULAR = 100.0  # condition number of the tip's Jacobian, as the stage that finds the force marks it
NORMAL_95 = 1.96  # standard deviations of a 95 % interval
WITHIN = 4.0  # standard errors that an estimate may be off the truth
WORDS: dict[Level, str] = {  # the mark and its word stay on one line
    "good": "●\N{NO-BREAK SPACE}Good",
    "warn": "▲\N{NO-BREAK SPACE}Caution",
    "bad": "✖\N{NO-BREAK SPACE}Problem",
}


@dataclass(frozen=True)
class Trust:
    """What is known of how far the external effort of one joint can be trusted: its worst unseen run."""

    joint: str
    prediction: Prediction | None
    space: FreeSpace | None
    sought: float | None  # the effort that the user wants to see

    @property
    def share(self) -> float:
        """Model error over the root mean square of the effort, NaN where no run was predicted."""
        p = self.prediction
        return p.model_error / p.effort_rms if p is not None and p.effort_rms > 0 else math.nan

    @property
    def fineness(self) -> float:
        """Detection level over the effort that is sought, NaN where none is stated."""
        return self.space.detection_level / self.sought if self.space is not None and self.sought else math.nan

    @property
    def same_path(self) -> bool:
        """Whether it was judged on the path that was fitted, where the model's error repeats."""
        return self.prediction is not None and self.prediction.path == "same path"

    @property
    def level(self) -> Level:
        """By the effort that is sought where one is stated, else by the model error; never good on the same path."""
        by = graded(self.fineness, DETECTED, DETECTABLE) if self.sought else graded(self.share, GOOD, CAUTION)
        return "warn" if by == "good" and self.same_path else by


def graded(share: float, good: float, caution: float) -> Level:
    """Good, caution or problem; what is not known calls for caution."""
    if math.isnan(share):
        return "warn"
    return "good" if share <= good else "warn" if share <= caution else "bad"


def band(coverage: float) -> Level:
    """Whether a 95 % band that covers this share of free-space samples is right; too wide is only cautious."""
    return "bad" if coverage < COVERED[0] else "info" if coverage > COVERED[1] else "good"


def band_in_words(coverage: float) -> str:
    """The same in words."""
    return {"bad": "too narrow", "info": "too wide", "good": "right"}[band(coverage)]


def percent(share: float) -> str:
    """A share as it is printed."""
    return "–" if math.isnan(share) else f"{100 * share:.0f} %"


def thresholds() -> tuple[tuple[Cell, ...], ...]:
    """What is judged, by what, and from where on: the rows of the table under methods."""
    return (
        ("External effort of a joint, where `effort` is stated", "detection level over the effort sought",
         f"at most {percent(DETECTED)}", f"at most {percent(DETECTABLE)}", "beyond"),
        ("External effort of a joint, elsewhere", "model error over the root mean square of the effort",
         f"at most {percent(GOOD)}, on a path that was not fitted", f"at most {percent(CAUTION)}, or the same path",
         "beyond"),
        ("95 % band of the external effort", "share of free-space samples that it covers",
         f"{percent(COVERED[0])} to {percent(COVERED[1])}", f"above {percent(COVERED[1])}: too wide",
         f"below {percent(COVERED[0])}: too narrow"),
        ("Stiffness of tissue", "its standard error over it",
         f"at most {percent(STIFF)}, of two pushes at least", f"at most {percent(STIFFER)}",
         "beyond, or no push counts"),
        ("Pose of the tip", "condition number of its Jacobian", "–", f"above {NEAR_SINGULAR:g}: near singular", "–"),
        ("Parameter of a simulated study", "standard errors from the truth", f"at most {WITHIN:g}", "–", "beyond"),
        ("White noise", "probability of a larger Ljung-Box statistic over 20 lags", "above 1 %", "–", "–"),
        ("Innovations of the filter", "that of position and velocity, and those of their cumulative periodograms",
         "each above 1 %, of the whole run or outside contact and reversals", "with or without a tested cause", "–"),
    )  # fmt: skip
