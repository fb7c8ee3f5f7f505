"""Filter recorded logs as if their samples arrived one by one, and compare with the smoother."""

from collections.abc import Collection, Iterable, Iterator, Sequence

import numpy as np

from davinci_forces.filters import DEFAULT, diverges, filter_blocks
from davinci_forces.filters.error_bands import joint_alarm_level
from davinci_forces.filters.online import Window, delay_of
from davinci_forces.filters.problem import filter_inputs
from davinci_forces.filters.response import noise_model
from davinci_forces.identification.joint_models import Identified, LogModels
from davinci_forces.maths.arrays import Array
from davinci_forces.maths.contact.detection import free_motion_statistics
from davinci_forces.maths.models.model import ArmMotion
from davinci_forces.maths.signals.smoothing import segments
from davinci_forces.maths.signals.windows import MIN_FREE_SAMPLES, free_space
from davinci_forces.maths.uncertainty.bootstrap import root_mean_square
from davinci_forces.records import Contact, FilterNoise, Fit, JointModel, Motion, Streamed, StreamLevel, Track, by_name
from davinci_forces.records.recordings import FilteredMotion
from davinci_forces.robots.robot import Robot
from davinci_forces.study import LogEntry

ROLES = ("validation", "contact")
MEDIAN_STD = 1.2533  # standard error of a median over that of a mean, of normal values
LONG = 3.0  # a contact is long if it lasts this multiple of the delay


def _motion(record: FilteredMotion, cutoff: float, effort_lag: float) -> ArmMotion:
    window = Window.design(record.rate, cutoff, effort_lag - record.effort_lag)
    columns, parts, q = np.empty((3, len(record))), list(segments(record.segment)), record.q_measured
    signals = ((record.dq_measured, 0), (record.dq_measured, 1)) if record.velocity == "logged" else ((q, 1), (q, 2))
    for column, (x, derivative) in zip(columns, ((q, 0), *signals), strict=True):
        for part in parts:
            column[part] = window.filter_signal(x[part], derivative)
    q, dq, ddq = columns[:, :, None]
    return ArmMotion(q, dq, ddq, 1.0 / record.rate, record.segment)


class CausalModels(LogModels):
    """Models along a log whose motion is computed as a stream computes it, from a window around each sample."""

    _motion_at = staticmethod(_motion)


def run(
    models: Sequence[JointModel],
    motions: Collection[Motion],
    fits: Iterable[Fit | FilterNoise],
    estimates: Iterable[Track | Contact],
    entry: LogEntry,
    robot: Robot,
    *,
    q_tau: float,
) -> Iterator[Streamed]:
    """Filter the moving joints of a log sample by sample, and compare with the smoother and its contacts."""
    if entry.role not in ROLES or not entry.has_known_free_motion:
        return
    records, estimates = list(fits), list(estimates)
    noises = {noise.joint: noise for noise in records if isinstance(noise, FilterNoise)}
    identified = Identified(robot, [fit for fit in records if isinstance(fit, Fit)])
    along = CausalModels(identified, motions)
    moving = [model for model in models if not model.at_rest and model.joint in noises]
    late = delay_of([(model.rate, model.cutoff, model.effort_lag) for model in moving])
    for model in moving:
        fit = identified.fit_of(model.joint, f"{model.model}.{model.estimator}")
        track = next((t for t in estimates if isinstance(t, Track) and t.joint == model.joint), None)
        found = next((c for c in estimates if isinstance(c, Contact) and c.joint == model.joint), None)
        if fit is not None and track is not None and len(track) == len(model):
            noise = noises[model.joint]
            filter_noise = noise_model(noise, robot.joint(model.joint), 1.0 / model.rate, q_tau)
            parts = filter_inputs(along.with_fit(model, fit))
            tau_ext, nis = np.empty(len(model)), 0.0
            for rows, tracked in filter_blocks(DEFAULT, parts, filter_noise):
                tau_ext[rows] = tracked.tau_ext
                nis += float(np.sum(tracked.nis)) / len(model)
            del parts, tracked
            if not diverges(tau_ext, nis):
                tau_ext -= track.day_offset
                yield from compare(track, tau_ext, found, entry, late, noise.delay)


def compare(
    track: Track, tau_ext: Array, found: Contact | None, entry: LogEntry, late: float, delay: float
) -> Iterator[Streamed]:
    """Compare the streamed external effort (N,) of a joint in free motion and in contacts with the smoother's."""
    free = free_space(track.t, entry.possible_contact, track.rate, track.unscored)
    if int(free.sum()) < MIN_FREE_SAMPLES:
        return
    statistics = free_motion_statistics(tau_ext, free, track.rate)
    rms, rms_std = root_mean_square(tau_ext[free])
    loss, loss_std = root_mean_square(tau_ext[free], track.tau_ext_smooth[free])
    rows = np.flatnonzero(found.found).tolist() if found is not None else []
    peaks = [streamed_peak(track.t, tau_ext, found, row, late + delay) for row in rows] if found is not None else []
    columns = ("onset", "duration", "peak")
    onset, duration, smooth = (getattr(found, name)[rows] if found is not None else np.zeros(0) for name in columns)
    peak = np.array(peaks, np.float64)
    long = duration > LONG * (late + delay)
    ratios = peak[long] / smooth[long]
    ratio = float(np.median(ratios)) if len(ratios) else float("nan")
    ratio_std = MEDIAN_STD * float(np.std(ratios, ddof=1)) / len(ratios) ** 0.5 if len(ratios) > 1 else float("nan")
    yield Streamed.like(
        statistics, track, stream_delay=late, free_rms=rms, free_rms_std=rms_std, stream_loss=loss,
        stream_loss_std=loss_std, peak_ratio=ratio, peak_ratio_std=ratio_std, onset=onset,
        duration=duration, smooth_peak=smooth, peak=peak,
    )  # fmt: skip


def streamed_peak(t: Array, tau_ext: Array, contact: Contact, row: int, late: float) -> float:
    """The largest streamed effort of the sign of a contact, from its onset to its release and the filter's delay."""
    within = (t >= contact.onset[row]) & (t <= contact.release[row] + late)
    sign = float(np.sign(contact.peak[row]))
    return sign * float(np.max(sign * tau_ext[within], initial=0.0))


def gather(streams: Iterable[Streamed]) -> Iterator[StreamLevel]:
    """Compute the alarm level of each joint's stream, and count the contacts whose peak exceeds it."""
    for joint, logs in by_name(streams, "joint").items():
        level, source = joint_alarm_level(logs)
        yield StreamLevel(
            joint=joint, alarm_level=level, alarm_level_std=level * source.free_rms_std / source.free_rms,
            tested=len(logs), stream_delay=max(s.stream_delay for s in logs), contacts=sum(len(s) for s in logs),
            contacts_found=sum(int((np.abs(s.peak) > level).sum()) for s in logs),
        )  # fmt: skip
