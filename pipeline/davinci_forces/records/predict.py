"""Records of predictions of effort that a fit has not seen."""

from collections.abc import Iterator
from dataclasses import dataclass

from davinci_forces.records.record import Column, Published, Record

CHOSEN = "chosen"
SAME_PATH, ANOTHER_PATH = "same path", "another path"  # as what was fitted


@dataclass(frozen=True, eq=False)
class Prediction(Record):
    """The effort of a log that a fit has not seen, and the effort that the fit predicts for it.

    Of the chosen model, whatever it is, `model` is "chosen" and `estimator` names its fit.
    """

    KEY = ("log", "joint", "model", "estimator")

    log: str
    joint: str
    model: str
    estimator: str
    role: str
    scheme: str  # "validation", "contact", "leave one log out", "leave 5 logs out", ...
    path: str  # "another path" than what was fitted, or the "same path", on which the model's error repeats
    rmse: float
    nrmse: float
    r2: float
    fit_percent: float
    r2_ceiling: float
    model_error: float
    model_error_std: float
    effort_rms: float
    relative_error: float
    relative_error_1111: float
    t: Column
    tau: Column
    tau_hat: Column

    @property
    def prefix(self) -> str:
        """`predict.<log>.<joint>.<model>.<estimator>` or `.chosen`; `cv.` where the log itself was fitted."""
        key = self.key[:-1] if self.model == CHOSEN else self.key
        return ".".join(("cv" if self.role == "identification" else "predict", *key))

    def published(self) -> Iterator[Published]:
        """The scores."""
        scores = ("rmse", "nrmse", "r2", "fit_percent", "r2_ceiling", "effort_rms")
        yield from self.publish(self.prefix, *scores, "relative_error", "relative_error_1111")
        yield Published(f"{self.prefix}.model_error", "model_error", std="model_error_std")
