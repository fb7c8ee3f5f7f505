"""Records of the models of joints: their parameters, the choice among them, and friction over velocity."""

from collections.abc import Iterator
from typing import ClassVar

from davinci_forces.records.record import Column, Counts, JointRecord, Labels, LogJointRecord, Published, Record, slug


class ModelRecord(Record):
    """A record of a model of a joint, or of the arm, by one estimator."""

    KEY: ClassVar[tuple[str, ...]] = ("group", "model", "estimator")

    group: str
    model: str
    estimator: str


class Fit(ModelRecord):
    """The parameters of a model, estimated by one estimator from all identification logs."""

    UNKNOWN = ("described",)
    ROWS = "parameter"
    PUBLISHED = (
        "fit.{group}.{model}.{estimator}.{slug}: =theta± std_noise=theta_std_noise std_model=theta_std_model "
        "std_classical=theta_std_classical",
        "fit.{group}.{model}.{estimator}: mse± r2± condition samples periods hac_lags=correlated_lags",
    )

    structure: str
    cutoff: tuple[float, ...]  # of each effort of the model
    effort_lag: tuple[float, ...]  # likewise
    logs: tuple[str, ...]
    samples: int
    periods: int
    mse: float
    mse_std: float
    r2: float
    r2_std: float
    condition: float
    correlated_lags: int
    parameter: Labels
    phi: Labels
    unit: Labels
    combination: Labels
    scale: Column
    positive: Column
    described: Column
    theta: Column
    theta_std: Column
    theta_std_noise: Column
    theta_std_model: Column
    theta_std_classical: Column


class Guess(Record):
    """An initial guess of a joint's parameters, without measurements, and the error that it leaves."""

    KEY = ("group",)
    ROWS = "parameter"
    PUBLISHED = ("guess.{group}.{slug}: =theta", "guess.{group}: mse±")

    group: str
    mse: float
    mse_std: float
    parameter: Labels
    unit: Labels
    theta: Column


class CrossFit(ModelRecord):
    """The parameters of a model from fits that leave out some identification logs, each log once."""

    left_out: Labels  # separated by ", "
    parameter: Labels
    unit: Labels
    theta: Column


class SwarmSearch(ModelRecord):
    """A particle swarm search for the parameters of a model, with the lowest error after each iteration."""

    KEY = ("group", "model", "estimator", "walls")
    PUBLISHED = ("search.{group}.{model}.{estimator}.{walls}: mse± excess searched swarms iterations",)

    walls: str
    seed: int
    particles: int
    searched: int
    swarms: int
    iterations: int
    excess: float
    mse: float
    mse_std: float
    best_mse: Column


class Identifiability(Record):
    """The identifiability of a model's parameters: the correlation of each pair, and advice as text."""

    KEY = ("group", "model")

    group: str
    model: str
    scaled_condition: float
    together: tuple[str, ...]
    not_seen: tuple[str, ...]
    advice: str
    parameter: Labels
    beside: Labels
    correlation: Column

    def published(self) -> Iterator[Published]:
        """The condition number, and the correlation of every pair of parameters, once."""
        yield from self.publish("identifiability.{group}.{model}", "condition=scaled_condition")
        names = list(dict.fromkeys(self.parameter))
        for i, (a, b) in enumerate(zip(self.parameter, self.beside, strict=True)):
            if names.index(a) < names.index(b):
                yield Published(f"correlation.{'.'.join(self.key)}.{slug(a)}.{slug(b)}", "correlation", row=i)


class FittedPaths(JointRecord):
    """The fitted paths of a joint, one period per path, one after the other; of many paths, those that differ most."""

    speed: float  # of its fastest log
    source: Labels  # the log that follows the path
    period: Column
    t: Column
    q: Column


class MeasurementNoise(JointRecord):
    """The noise of a joint between periods: the root mean square over its identification logs."""

    sigma_q: float
    sigma_dq: float
    sigma_tau: float


class Residual(LogJointRecord):
    """The averaged effort of one identification log, and the effort of a fit for it."""

    KEY = ("log", "joint", "model", "estimator")

    model: str
    estimator: str
    rate: float
    t: Column
    dq: Column
    tau: Column
    tau_hat: Column


class Choice(Record):
    """The model of a joint, or of the arm, that cross-validation chose from candidates."""

    KEY = ("group",)
    UNKNOWN = "over_periods", "over_periods_std"
    ROWS = "candidate"
    PUBLISHED = ("choice.{group}.{slug}: score± training± over_periods± parameters",)

    group: str
    model: str
    friction: str
    estimator: str
    chosen: str  # the candidate, by name
    best: str  # the candidate with the lowest score
    why: str
    logs: tuple[str, ...]
    candidate: Labels
    variant: Labels
    parameters: Counts
    physical: Counts
    score: Column
    score_std: Column
    training: Column
    training_std: Column
    over_periods: Column
    over_periods_std: Column


class ModelSearch(JointRecord):
    """The steps of the search for the model of a joint in a structure; processing and terms are of the chosen step."""

    KEY = ("joint", "structure")
    ROWS = "step"

    structure: str
    cutoff: float
    effort_lag: float
    ridge: float
    term: tuple[str, ...]
    term_scale: tuple[float, ...]
    used: int
    chosen_step: int
    step: Labels
    step_cutoff: Column
    step_lag: Column
    step_ridge: Column
    parameters: Counts
    score: Column
    score_std: Column

    def published(self) -> Iterator[Published]:
        """The cutoff, the lag, the ridge and the added terms, each with its scale, if the chosen model has them."""
        if not self.used:
            return
        yield from self.publish("choice.{joint}", "cutoff effort_lag ridge")
        for i, term in enumerate(self.term):
            yield Published(f"choice.{self.joint}.term.{slug(term)}", "term_scale", row=i)


class FrictionMap(LogJointRecord):
    """The effort of one joint in one log minus a fit's terms except friction, and the fit's friction, over velocity."""

    KEY = ("log", "joint", "model", "estimator")

    model: str
    estimator: str
    role: str
    dq: Column  # mean of a range of velocity
    gaining: Counts  # whether the row is of increasing speed
    tau_friction: Column
    tau_friction_std: Column
    tau_friction_hat: Column
