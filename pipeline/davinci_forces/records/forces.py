"""Records of the external effort on joints: the filter's noise, its estimates, and their errors."""

from collections.abc import Iterator

from davinci_forces.records.record import Column, Counts, JointRecord, Labels, LogJointRecord, Names, Published

SMOOTHER = "rts"  # the filter whose external effort is the result; the default filter is what real time would see
MIN_COVERAGE = 0.9  # share of free-space samples that a 95 % band covers if it is not too narrow


class Tuning(LogJointRecord):
    """The noise of one joint in one identification log that maximises the likelihood of the filter's innovations."""

    rate: float
    r_q: float
    r_dq: float
    r_tau: float
    q_tau: float
    inertia: float
    viscous: float
    likelihood_gain: float
    tested: int


class FilterNoise(JointRecord):
    """The noise that the filter assumes of a joint: the median of its identification logs."""

    PUBLISHED = ("tuning.{joint}: r_q r_dq r_tau q_tau",)

    logs: Names
    rate: float
    r_q: float
    r_dq: float
    r_tau: float
    q_tau: float
    delay: float
    inertia: float
    viscous: float
    trial_delay: Column
    trial_std: Column  # standard deviation of the filter at rest, with this delay instead of `delay`


class FreeMotion(LogJointRecord):
    """The smoother's external effort on one joint of a log of free motion, with a fit that did not use that log."""

    path: str
    scheme: str
    tested: int
    block: Counts
    dq: Column  # of at most 1000 samples, evenly spaced
    tau_ext_smooth: Column
    tau_ext_std_filter: Column
    uncorrelated: Column  # number of uncorrelated samples for which the row stands


class ErrorBand(JointRecord):
    """The errors of a joint's smoothed external effort in free motion outside the fit, of at most 20 logs."""

    PUBLISHED = ("band.{joint}: band_rms±",)

    band_rms: float
    band_rms_std: float
    source: Labels  # the log of the row; the band of a log uses the rows of the others
    path_of: Labels
    block: Counts
    dq: Column
    tau_ext_smooth: Column
    tau_ext_std_filter: Column
    uncorrelated: Column


class Track(LogJointRecord):
    """The external effort on one joint during one log, by filter and smoother, each with its standard deviation.

    Both combine the estimator's own covariance, the model's error in free motion outside the fit and, in a log with
    `free` windows, the uncertainty of the day's offset.  The filter's includes its lag, and the smoother's what it
    rounds off a fast change.  At standstill both include friction, which takes any value up to the static level.
    """

    PUBLISHED = (
        "{filter}.{log}.{joint}: r_q r_dq q_dq q_tau filter_part lag_part tau_ext_rms± nis_mean± model_part± "
        "day_offset±",
        "effort.{log}.{joint}: smooth_part",
    )

    model: str
    estimator: str
    filter: str
    role: str
    path: str
    at_rest: int
    rate: float
    tau_ext_rms: float
    tau_ext_rms_std: float
    nis_mean: float
    nis_mean_std: float
    r_q: float
    r_dq: float
    q_dq: float
    q_tau: float
    day_offset: float
    day_offset_std: float
    filter_part: float
    model_part: float
    model_part_std: float
    lag_part: float
    smooth_part: float
    smooth_rise: float
    static_friction: float
    band_from: str
    t: Column
    q: Column
    dq: Column
    tau: Column
    tau_hat: Column
    tau_ext: Column
    tau_ext_std: Column
    tau_ext_std_filter: Column
    tau_ext_smooth: Column
    tau_ext_smooth_std: Column
    tau_ext_rounding: Column
    tau_ext_direct: Column
    innovation_q: Column
    innovation_dq: Column
    nis: Column
    standing: Counts
    unscored: Counts


class FreeEffort(LogJointRecord):
    """The levels of one filter's external effort on one joint of one log, where nothing touched the robot."""

    KEY = ("log", "joint", "filter")

    filter: str
    role: str
    free_rms: float
    free_rms_std: float
    free_level: float
    free_level_std: float
    detection_level: float
    detection_level_std: float


class FreeSpace(FreeEffort):
    """The external effort of smoother or filter in free space, and the coverage of its stated band."""

    tested: int
    coverage: float
    coverage_std: float
    band_width: float
    free_max: float
    crossings: float
    quartile_coverage: Column  # by quartile of speed in motion; none if the joint hardly moves
    quartile_coverage_std: Column

    @property
    def prefix(self) -> str:
        """`effort.<log>.<joint>` of the smoother, whose effort is the result; `<filter>.<log>.<joint>` of a filter."""
        return f"{'effort' if self.filter == SMOOTHER else self.filter}.{self.log}.{self.joint}"

    def published(self) -> Iterator[Published]:
        """The levels, and the coverage of the stated band; of the smoother also by quartile of speed."""
        yield from self.publish(self.prefix, "free_rms± free_level± detection_level± coverage±")
        if self.filter == SMOOTHER:
            yield from self.publish(self.prefix, "band_width")
            yield from self.publish(f"{self.prefix}.coverage_q{{row}}", "=quartile_coverage±")


class Threshold(JointRecord):
    """The detection level for contacts on a joint: the highest level of its logs that were not fitted, if any."""

    KEY = ("joint", "filter")
    PUBLISHED = ("threshold.{joint}: detection_level± alarm_level±", "band.{joint}: coverage± band_width")

    filter: str
    detection_level: float
    detection_level_std: float
    alarm_level: float
    alarm_level_std: float
    level_from: str  # the log whose free space it is
    tested: int  # logs: those that were not fitted, if there are any
    coverage: float  # mean over these logs
    coverage_std: float
    band_width: float


class Contact(LogJointRecord):
    """The contacts of one joint in one log: its effort on the environment, and its detection level."""

    PUBLISHED = (
        "contact.{log}.{joint}.{row}: "
        "peak± t_peak middle_mean± mean± impulse± onset± release± duration± above stated found",
    )

    filter: str
    detection_level: float
    alarm_level: float
    level_from: str  # the log whose free space sets the detection level
    stated: Counts  # whether the study states the window; these come first, then other detected contacts
    found: Counts
    onset: Column  # of the stated window, if no contact was detected in it; so for the release
    onset_std: Column
    release: Column
    release_std: Column
    duration: Column
    duration_std: Column
    t_peak: Column
    peak: Column  # with what the smoother takes off the tip of a push
    peak_std: Column
    middle_mean: Column
    middle_mean_std: Column
    mean: Column
    mean_std: Column
    impulse: Column
    impulse_std: Column
    above: Counts


class Streamed(LogJointRecord):
    """One joint of one log filtered as samples arrive, beside the smoother; a row is a contact."""

    PUBLISHED = ("stream.{log}.{joint}: stream_delay free_rms± stream_loss± peak_ratio±",)

    role: str
    rate: float
    stream_delay: float
    free_rms: float
    free_rms_std: float
    stream_loss: float
    stream_loss_std: float
    free_max: float
    crossings: float
    peak_ratio: float
    peak_ratio_std: float
    onset: Column
    duration: Column
    smooth_peak: Column
    peak: Column


class StreamLevel(JointRecord):
    """The alarm level of one joint as samples arrive, over all its logs, and the contacts that exceed it."""

    PUBLISHED = ("stream.{joint}: alarm_level± contacts contacts_found",)

    alarm_level: float
    alarm_level_std: float
    tested: int
    stream_delay: float
    contacts: int
    contacts_found: int


class Comparison(FreeEffort):
    """One filter on one joint of a log: its effort in free space, and its response to a push added in software."""

    PUBLISHED = ("{filter}.{log}.{joint}: push_share push_delay",)

    default: int  # whether it is the default filter, whose free space is in FreeSpace, as is that of the smoother
    push_peak: float
    push_share: float
    push_delay: float
    t: Column
    tau_ext: Column

    def published(self) -> Iterator[Published]:
        """The levels in free space, and the share and the delay of a push."""
        if not self.default:
            yield from self.publish("{filter}.{log}.{joint}", "free_rms± free_level± detection_level±")
        yield from super().published()
