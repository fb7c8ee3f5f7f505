"""Records of measurements: as read, on a uniform clock, and averaged over periods."""

from davinci_forces.records.record import Column, Counts, Labels, LogJointRecord, LogRecord, Names


class LogSummary(LogRecord):
    """The summary of reading one log: its clock and rows, and the use of each channel."""

    PUBLISHED = ("log.{log}: rows rate duration jitter longest_gap duplicates dropped",)

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


class Touch(LogRecord):
    """The contact channels of one log, which belong to no joint, as recorded; NaN without such a channel."""

    UNKNOWN = ("t", "depth", "force", "force_x", "force_y", "force_z", "x", "y", "z")

    role: str
    sample: Counts
    push: Counts
    t: Column  # NaN of a log without a clock
    depth: Column
    force: Column
    force_x: Column
    force_y: Column
    force_z: Column
    x: Column
    y: Column
    z: Column


class Recording(LogJointRecord):
    """One joint during one log, as recorded: on the log's clock, in joint units."""

    role: str
    rate: float
    velocity: str  # "logged", or "derived": dq is then zero here and filled in when the clock is made uniform
    t: Column
    q: Column
    dq: Column
    tau: Column
    filled: Counts


class Signal(LogJointRecord):
    """One joint during one log on a uniform clock, with its velocity; a gap starts a new segment."""

    role: str
    rate: float
    method: str
    velocity: str
    gaps: int
    at_rest: int
    t: Column
    q: Column
    dq: Column
    tau: Column
    segment: Counts
    filled: Counts


class FilteredMotion(LogJointRecord):
    """The motion of one joint during one log after a low-pass filter without delay, and the measured motion.

    The motion is delayed by the lag of the effort.  The velocity `dq` is 0 where its sign is not known.
    """

    role: str
    rate: float
    velocity: str
    cutoff: float
    effort_lag: float
    at_rest: int
    t: Column
    q: Column
    dq: Column
    ddq: Column
    q_measured: Column
    dq_measured: Column
    tau: Column
    segment: Counts
    standing: Counts


class Motion(FilteredMotion):
    """The motion of one joint during one log, and the noise that the low-pass filter removes.

    Where the joint stands still, friction takes any value up to its static level, so that the effort is neither fitted
    nor judged there.  Samples that are filled in are not used either.
    """

    sigma_q: float
    sigma_dq: float
    sigma_tau: float
    filled: Counts


class AveragedPeriod(LogJointRecord):
    """One period of a joint, averaged over the periods of a recording, and the noise of the recording."""

    rate: float
    period: float
    periods: int
    t_start: float
    sigma_q: float
    sigma_dq: float
    sigma_tau: float
    sigma_tau_white: float
    t: Column
    q: Column
    dq: Column
    tau: Column
    tau_var: Column
    tau_alternating: Column
    count: Counts


class Average(AveragedPeriod):
    """One period as measured, with the spread between the periods."""

    PUBLISHED = ("period.{log}: =period± periods", "noise.{log}.{joint}: sigma_q± sigma_dq± sigma_tau± relative_noise±")

    period_std: float
    stated_period: float
    sigma_q_std: float
    sigma_dq_std: float
    sigma_tau_std: float
    relative_noise: float
    relative_noise_std: float
    q_var: Column
    dq_var: Column


class PeriodResidual(LogJointRecord):
    """The difference of each sample from the mean of the periods at its phase."""

    t: Column
    q_noise: Column
    dq_noise: Column
    tau_noise: Column


class Trajectory(AveragedPeriod):
    """One period of harmonics without noise, with the velocity and acceleration that follow from them."""

    harmonics: int
    ddq: Column


class Spectrum(LogJointRecord):
    """The amplitude of each harmonic of an averaged period: the harmonics kept, and those treated as noise."""

    harmonics: int
    frequency: Column
    amplitude: Column
