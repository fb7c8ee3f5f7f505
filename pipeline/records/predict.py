"""Records of predictions of effort that a fit has not seen."""

from collections.abc import Iterator
from dataclasses import dataclass

from pipeline.records.record import Column, Published, Record


@dataclass(frozen=True, eq=False)
class Prediction(Record):
    """The effort of a log that a fit has not seen, and the effort that the fit predicts for it."""

    KEY = ("log", "joint", "model", "estimator")

    log: str
    joint: str
    model: str
    estimator: str
    role: str
    scheme: str  # "validation", "contact", "leave one log out", "leave 5 logs out" or "leave one period out"
    path: str  # "another path" than what was fitted, or the "same path", on which the model's error repeats
    rmse: float
    nrmse: float
    r2: float
    r2_ceiling: float
    model_error: float
    model_error_std: float
    effort_rms: float
    relative_error: float
    t: Column
    tau: Column
    tau_hat: Column

    @property
    def prefix(self) -> str:
        """`predict.<log>.<joint>.<model>.<estimator>`, or `cv.` where the log itself was fitted."""
        return ".".join(("cv" if self.role == "identification" else "predict", *self.key))

    def published(self) -> Iterator[Published]:
        """The scores."""
        yield from self.publish(self.prefix, "rmse", "nrmse", "r2", "r2_ceiling", "effort_rms", "relative_error")
        yield Published(f"{self.prefix}.model_error", "model_error", std="model_error_std")
