"""The records that flow between stages.

A record is a few scalars that say what it is about, and columns of one length that say what was measured or
found.  It checks itself once, when made, so a stage can trust what it is handed and `store` can write any of
them the same way.  Every field is a symbol of `quantities`.  `KEY` names the scalars that tell one record of a
kind from another: they are its place on disk.
"""

from dataclasses import dataclass, fields
from typing import Any, ClassVar, NamedTuple, TypeVar

import numpy as np
from numpy.typing import NDArray

from pipeline.errors import BadRecord

Column = NDArray[np.float64]
Counts = NDArray[np.int64]
Labels = NDArray[np.object_]
Names = tuple[str, ...]

COLUMN_DTYPES: dict[Any, Any] = {Column: np.float64, Counts: np.int64, Labels: np.object_}


class Origin(NamedTuple):
    """Where a record was read from: the file, its hash, and the units of its fields."""

    path: str
    sha256: str
    units: dict[str, str]


class Record:
    """What all records share; never made itself."""

    KEY: ClassVar[Names] = ("log", "joint")
    origin: ClassVar[Origin | None] = None  # set on the instances that `store` read

    @classmethod
    def columns(cls) -> Names:
        """Names of the fields that are columns."""
        return tuple(f.name for f in fields(cls) if f.type in COLUMN_DTYPES)  # type: ignore[arg-type]

    @classmethod
    def scalars(cls) -> Names:
        """Names of the fields that are scalars."""
        return tuple(f.name for f in fields(cls) if f.type not in COLUMN_DTYPES)  # type: ignore[arg-type]

    @property
    def key(self) -> Names:
        """What tells this record from others of its kind."""
        return tuple(str(getattr(self, name)) for name in self.KEY)

    def __post_init__(self) -> None:
        for f in fields(self):  # type: ignore[arg-type]
            if f.type in COLUMN_DTYPES:
                column = np.asarray(getattr(self, f.name), dtype=COLUMN_DTYPES[f.type])
                object.__setattr__(self, f.name, column)
        self._check_lengths()
        self._check_finite()

    def _check_lengths(self) -> None:
        lengths = {name: len(getattr(self, name)) for name in self.columns()}
        if len(set(lengths.values())) > 1:
            raise BadRecord(f"{self}: columns differ in length: {lengths}")

    def _check_finite(self) -> None:
        for name in self.columns():
            column = getattr(self, name)
            if column.dtype.kind == "f" and not np.isfinite(column).all():
                bad = np.flatnonzero(~np.isfinite(column))
                raise BadRecord(f"{self}: {name} has {len(bad)} values that are not finite, the first at row {bad[0]}")

    def __str__(self) -> str:
        return f"{type(self).__name__} {'/'.join(self.key)}"

    def __len__(self) -> int:
        columns = self.columns()
        return len(getattr(self, columns[0])) if columns else 0


AnyRecord = TypeVar("AnyRecord", bound=Record)


@dataclass(frozen=True, eq=False)
class Intake(Record):
    """How one log was read: what the reader noticed, and what each of its channels is used for."""

    KEY = ("log",)

    log: str
    role: str
    format: str
    files: Names
    started: str
    zone: str
    rows: int
    rate: float
    duration: float
    jitter: float
    longest_gap: float
    backward: int
    repeated: int
    duplicates: int
    dropped: int
    facts: Names
    warnings: Names
    channel: Labels
    unit: Labels
    feeds: Labels
    nulls: Counts
    nans: Counts


@dataclass(frozen=True, eq=False)
class Recording(Record):
    """One joint during one log, as recorded: at the log's own clock, in joint units."""

    log: str
    joint: str
    role: str
    rate: float
    velocity: str  # "logged", or "derived": dq is then zero here and filled in when the clock is made uniform
    t: Column
    q: Column
    dq: Column
    tau: Column


@dataclass(frozen=True, eq=False)
class Signal(Record):
    """One joint during one log on a uniform clock, with its velocity; a gap starts a new stretch."""

    log: str
    joint: str
    role: str
    rate: float
    method: str
    velocity: str
    gaps: int
    held: int
    t: Column
    q: Column
    dq: Column
    tau: Column
    stretch: Counts


@dataclass(frozen=True, eq=False)
class Average(Record):
    """One period of a joint, averaged over the periods of a recording, with the spread between them."""

    log: str
    joint: str
    rate: float
    period: float
    period_std: float
    stated_period: float
    periods: int
    sigma_q: float
    sigma_dq: float
    sigma_tau: float
    t: Column
    q: Column
    dq: Column
    tau: Column
    q_var: Column
    dq_var: Column
    tau_var: Column
    count: Counts


@dataclass(frozen=True, eq=False)
class Noise(Record):
    """What averaging removed: each sample minus the mean of the periods at its phase."""

    log: str
    joint: str
    t: Column
    q_noise: Column
    dq_noise: Column
    tau_noise: Column


@dataclass(frozen=True, eq=False)
class Trajectory(Record):
    """One averaged period with its velocity and acceleration, free of noise."""

    log: str
    joint: str
    rate: float
    period: float
    periods: int
    harmonics: int
    method: str
    t: Column
    q: Column
    dq: Column
    ddq: Column
    tau: Column
    tau_var: Column
    count: Counts


@dataclass(frozen=True, eq=False)
class Spectrum(Record):
    """Amplitude of each harmonic of an averaged period: the harmonics kept, and the rest taken as noise."""

    log: str
    joint: str
    harmonics: int
    frequency: Column
    amplitude: Column


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
class Links(Record):
    """The links of a robot: Denavit-Hartenberg parameters and masses.  Tables 3.1 and 4.2"""

    KEY = ("robot",)

    robot: str
    worst_condition: float
    link: Labels
    parent: Labels
    alpha: Column
    a: Column
    d: Column
    offset: Column
    moved_by: Counts
    mass: Column


@dataclass(frozen=True, eq=False)
class Pose(Record):
    """Where the frames of a robot's chain are at one configuration."""

    KEY = ("robot", "pose")

    robot: str
    pose: str
    link: Labels
    parent: Labels
    x: Column
    y: Column
    z: Column


@dataclass(frozen=True, eq=False)
class Workspace(Record):
    """Places that the tip can reach within the limits, and how well efforts tell the force there."""

    KEY = ("robot",)

    robot: str
    x: Column
    y: Column
    z: Column
    condition: Column


@dataclass(frozen=True, eq=False)
class Control(Record):
    """One joint in a simulated control study of chapter 5."""

    KEY = ("controller", "joint")

    controller: str
    joint: str
    start: float
    reference: float
    error_10: float
    error_20: float
    error_end: float
    t: Column
    q: Column
    dq: Column


@dataclass(frozen=True, eq=False)
class Lyapunov(Record):
    """The Lyapunov function along a simulated control study.  (5.9)"""

    KEY = ("controller",)

    controller: str
    V_rise: float
    t: Column
    V: Column


@dataclass(frozen=True, eq=False)
class Excitation(Record):
    """One period of an excitation trajectory, published or found, with what it is worth and what it exceeds."""

    KEY = ("joint", "source")

    joint: str
    source: str
    period: float
    objective: float
    condition: float
    coefficients: tuple[float, ...]
    excess_q: float
    excess_dq: float
    excess_ddq: float
    t: Column
    q: Column
    dq: Column
    ddq: Column


@dataclass(frozen=True, eq=False)
class Note(Record):
    """What a stage wants the reviewer to know: something left out, assumed, or wrong."""

    KEY = ("stage", "subject")

    stage: str
    subject: str
    severity: Labels
    text: Labels


KINDS: dict[str, type[Record]] = {
    kind.__name__: kind
    for kind in (
        Links, Pose, Workspace, Control, Lyapunov, Excitation, Intake, Recording, Signal, Average, Noise, Trajectory,
        Spectrum, Fit, Residual, Prediction, Track, Whiteness, Note,
    )
}  # fmt: skip


def note(stage: str, subject: str, severity: str, *texts: str) -> Note:
    """A note of one or more lines of one severity."""
    return Note(stage, subject, np.array([severity] * len(texts), object), np.array(texts, object))
