"""Records of a fit along a log: the predicted effort, and the joint model for filters."""

from collections.abc import Iterator

from davinci_forces.records.record import Column, Counts, LogJointRecord, Published
from davinci_forces.records.recordings import FilteredMotion

CHOSEN = "chosen"
CHOSEN_BY_LOG = "chosen_by_log"  # the chosen model, refitted without whole logs instead of blocks of path
SAME_PATH, ANOTHER_PATH = "same path", "another path"  # as fitted
# Fields of a `JointModel` with the coefficients of the bias, in the order of `maths.models.terms`.
BIAS = ("constant", "gravity_sine", "gravity_cosine", "spring", "viscous", "coulomb", "presliding")


class Prediction(LogJointRecord):
    """The effort of a log that was left out of a fit, and the effort that the fit predicts for that log."""

    KEY = ("log", "joint", "model", "estimator")

    model: str  # `CHOSEN` or `CHOSEN_BY_LOG` for the chosen model
    estimator: str  # of the chosen model, the name of its fit
    role: str
    scheme: str  # "validation", "contact", "leave one log out", "leave 5 logs out", ...
    path: str  # "another path" than the fitted ones, or the "same path", on which the model's error repeats
    rmse: float
    rmse_std: float
    nrmse: float
    nrmse_std: float
    r2: float
    r2_std: float
    fit_percent: float
    fit_percent_std: float
    r2_ceiling: float
    r2_ceiling_std: float
    model_error: float
    model_error_std: float
    mean_error: float
    mean_error_std: float
    effort_rms: float
    effort_rms_std: float
    relative_error: float
    relative_error_std: float
    relative_error_1111: float
    relative_error_1111_std: float
    t: Column
    tau: Column
    tau_hat: Column

    @property
    def prefix(self) -> str:
        """`predict.<log>.<joint>.<model>.<estimator>`, `.chosen` or `.chosen_by_log`; `cv.` for identification logs."""
        key = self.key[:-1] if self.model in (CHOSEN, CHOSEN_BY_LOG) else self.key
        return ".".join(("cv" if self.role == "identification" else "predict", *key))

    def published(self) -> Iterator[Published]:
        """The scores."""
        scores = "rmse± nrmse± r2± fit_percent± r2_ceiling± effort_rms±"
        errors = "relative_error± relative_error_1111± model_error± mean_error±"
        return self.publish(self.prefix, f"{scores} {errors}")


class PathShare(LogJointRecord):
    """The share of a joint's path that no other identification log follows, and the share of time in motion.

    Also its speed over that of the fastest identification log, and the share of samples beyond fitted positions.
    """

    PUBLISHED = ("path.{log}.{joint}: path_new speed_ratio outside moving",)

    role: str
    path_new: float
    moving: float
    speed_ratio: float  # NaN where no fitted path is known
    outside: float  # likewise


class JointModel(FilteredMotion):
    """The model of one joint along one log, with the fit that the setting `fit` selects:

    inertia ddq + b(q, dq) + tau_known + tau_ext = tau                                              (7.15), (7.16)
    """

    UNKNOWN = ("tau_hat_unseen",)

    model: str
    estimator: str
    stand_in: str
    path: str
    scheme: str  # of the refits without the samples; "" where there are none
    path_unseen: str
    constant: float
    gravity_sine: float
    gravity_cosine: float
    spring: float
    viscous: float
    coulomb: float
    presliding: float
    static_friction: float
    unscored: Counts
    inertia: Column
    tau_known: Column
    tau_hat: Column
    tau_hat_unseen: Column  # in an identification log, by refits without the sample; NaN elsewhere
