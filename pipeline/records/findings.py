"""Records of what was found: parameters, predictions, external effort, and how far to trust them."""

from dataclasses import dataclass

from pipeline.records.record import Column, Counts, Labels, Names, Record


@dataclass(frozen=True, eq=False)
class Fit(Record):
    """The parameters of a model, found by one estimator from all identification logs."""

    KEY = ("group", "model", "estimator")

    group: str
    model: str
    estimator: str
    logs: Names
    samples: int
    periods: int
    mse: float
    r2: float
    condition: float
    hac_lags: int
    parameter: Labels
    phi: Labels
    unit: Labels
    theta: Column
    theta_std: Column
    theta_std_hac: Column


@dataclass(frozen=True, eq=False)
class Residual(Record):
    """The averaged effort of one identification log beside what a fit makes of it."""

    KEY = ("log", "joint", "model", "estimator")

    log: str
    joint: str
    model: str
    estimator: str
    rate: float
    t: Column
    dq: Column
    tau: Column
    tau_hat: Column


@dataclass(frozen=True, eq=False)
class Prediction(Record):
    """The effort of a log that a fit has not seen, beside what the fit makes of it."""

    KEY = ("log", "joint", "model", "estimator")

    log: str
    joint: str
    model: str
    estimator: str
    role: str
    scheme: str  # "validation", "contact", "leave one log out" or "leave one period out"
    rmse: float
    nrmse: float
    r2: float
    relative_error: float
    t: Column
    tau: Column
    tau_hat: Column


@dataclass(frozen=True, eq=False)
class Track(Record):
    """The external effort on one joint during one log, as a filter tracked it."""

    log: str
    joint: str
    model: str
    estimator: str
    filter: str
    role: str
    held: int
    rate: float
    tau_ext_rms: float
    nis_mean: float
    r_q: float
    r_dq: float
    q_q: float
    q_dq: float
    q_tau: float
    t: Column
    q: Column
    dq: Column
    tau: Column
    tau_hat: Column
    tau_ext: Column
    tau_ext_std: Column
    tau_ext_direct: Column
    innovation_q: Column
    innovation_dq: Column
    nis: Column


@dataclass(frozen=True, eq=False)
class Whiteness(Record):
    """Whether a signal that should be white is: its autocorrelation and the tests of it."""

    KEY = ("log", "joint", "signal")

    log: str
    joint: str
    signal: str
    tested: int
    band: float
    acf1: float
    outside: float
    ljung_box: float
    ljung_box_lags: int
    ljung_box_p: float
    jarque_bera_p: float
    skewness: float
    kurtosis: float
    white: int
    all_white: int
    lag: Counts
    acf: Column


@dataclass(frozen=True, eq=False)
class Note(Record):
    """What a stage wants the reviewer to know: something left out, assumed, or wrong."""

    KEY = ("stage", "subject")

    stage: str
    subject: str
    severity: Labels
    text: Labels
