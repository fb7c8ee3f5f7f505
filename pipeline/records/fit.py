"""Records of the parameters of a model, and what they leave of the effort."""

from dataclasses import dataclass

from pipeline.records.record import Column, Labels, Names, Record


@dataclass(frozen=True, eq=False)
class Fit(Record):
    """The parameters of a model, estimated by one estimator from all identification logs."""

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
    """The averaged effort of one identification log, and the effort that a fit gives for it."""

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
