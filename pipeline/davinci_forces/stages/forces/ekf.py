"""Estimate the external effort on every joint of every log with an extended Kalman filter and its smoother."""

from collections.abc import Iterator

import numpy as np

from davinci_forces.filters import DEFAULT, diverges, filter_blocks, filter_parts, gather_blocks, tracker
from davinci_forces.filters.error_bands import total_variance
from davinci_forces.filters.problem import Tracked, filter_inputs
from davinci_forces.filters.response import lag_error, noise_model, rise, rounding_error
from davinci_forces.maths.arrays import BLOCK_SAMPLES, Booleans
from davinci_forces.maths.signals.smoothing import segments
from davinci_forces.maths.signals.windows import free_space, is_past_transient
from davinci_forces.maths.uncertainty.bootstrap import error_of_pooled_mean, rms, root_mean_square
from davinci_forces.maths.uncertainty.error_band import DayOffset, day_offset
from davinci_forces.records import Diagnostic, ErrorBand, FilterNoise, JointModel, Track, diagnostic
from davinci_forces.records.forces import SMOOTHER
from davinci_forces.robots.robot import Joint
from davinci_forces.study import LogEntry


def run(
    model: JointModel, noise: FilterNoise | None, band: ErrorBand | None, entry: LogEntry, joint: Joint, *, q_tau: float
) -> Iterator[Track | Diagnostic]:
    """Filter one joint of a log.

    The effect of other joints and of the friction's memory enters by the measured motion.  (7.6)-(7.16)
    """
    if noise is None:
        message = "no identification log gives the noise of the filter, so its external effort is not estimated"
        yield diagnostic("ekf", f"{model.log}.{model.joint}", "note", f"{model.log}/{model.joint}: {message}")
        return
    filter_noise = noise_model(noise, joint, 1.0 / model.rate, q_tau)
    parts, moving = filter_inputs(model), (model.unscored == 0) | bool(model.at_rest)
    offset = day_offset(model.t[moving], (model.tau - model.tau_hat)[moving], entry.free)
    converged = np.concatenate([is_past_transient(model.t[part]) for part in segments(model.segment)])
    is_long = len(model) > BLOCK_SAMPLES  # then the filter runs once more, block by block, to take less memory
    estimate = filter_parts(
        DEFAULT, parts, filter_noise, ("tau_ext", "tau_ext_std", "nis") if is_long else Tracked._fields
    )
    if diverges(estimate.tau_ext, nis := float(np.mean(estimate.nis))):
        yield divergence_warning(model, nis)
        if not np.isfinite(estimate.tau_ext).all():
            return
    free = free_space(model.t, entry.possible_contact, model.rate, model.unscored)
    numbers = numbers_of(estimate, offset, converged, free)
    blocks = (
        gather_blocks(filter_blocks(DEFAULT, parts, filter_noise)) if is_long else [(slice(0, len(model)), estimate)]
    )
    del estimate
    smoothed, own = filter_parts(SMOOTHER, parts, filter_noise, ("tau_ext", "tau_ext_std"))[2:4]
    late = lag_error(parts, smoothed, filter_noise)
    variance, variance_std, source = own**2, 0.0, ""
    if band is not None:
        variance, std, source = total_variance(band, model.log, model.path, model.dq, own, bool(entry.free))
        variance_std = float(np.mean(std))
    model_part = float(np.sqrt(np.mean(np.maximum(variance - own**2, 0.0))))
    if offset.drifts and not model.at_rest:  # where a joint rests, it is the friction that changes
        kind = "warning" if 0.5 * abs(offset.drift) > model_part else "note"
        yield drift_remark(kind, model, offset, joint.unit("{effort}"))
    smooth_rise = rise(tracker(SMOOTHER), parts[0], filter_noise)
    rounding = np.concatenate([
        rounding_error(smoothed[part], variance[part], 1.0 / model.rate, smooth_rise)
        for part in segments(model.segment)
    ])  # fmt: skip
    numbers |= {
        "model_part": model_part,
        "model_part_std": float(np.sqrt(model_part**2 + variance_std)) - model_part,
        "lag_part": rms(late[converged]),
        "smooth_part": rms(np.minimum(own, np.sqrt(variance))[converged]),
        "smooth_rise": smooth_rise,
    }
    for rows, estimate in blocks:
        part = model.part(rows)
        # At standstill, friction is anywhere between its static levels: a uniform distribution.
        friction = part.standing * part.static_friction**2 / 3.0
        model_variance = np.maximum(variance[rows] - own[rows] ** 2, 0.0)
        yield Track.like(
            estimate,
            filter_noise,
            part,
            filter=DEFAULT,
            q_tau=filter_noise.q_tau * model.rate**0.5,
            day_offset=offset.value,
            day_offset_std=offset.std,
            band_from=source,
            **numbers,
            tau_ext=estimate.tau_ext - offset.value,
            tau_ext_std=np.sqrt(estimate.tau_ext_std**2 + late[rows] ** 2 + model_variance + offset.std**2 + friction),
            tau_ext_std_filter=estimate.tau_ext_std,
            tau_ext_smooth=smoothed[rows] - offset.value,
            tau_ext_smooth_std=np.sqrt(variance[rows] + offset.std**2 + friction + rounding[rows] ** 2),
            tau_ext_rounding=rounding[rows],
            tau_ext_direct=part.tau - part.tau_hat - offset.value,
        )


def numbers_of(estimate: Tracked, offset: DayOffset, converged: Booleans, free: Booleans) -> dict[str, float]:
    """The numbers of a filter's estimate, after its transients and in free space, as fields of a Track."""
    effort_free, nis = (estimate.tau_ext - offset.value)[free], estimate.nis[converged]
    return {
        "tau_ext_rms": rms(effort_free),
        "tau_ext_rms_std": root_mean_square(effort_free)[1] if free.any() else float("nan"),
        "nis_mean": float(np.mean(nis)),
        "nis_mean_std": error_of_pooled_mean(nis),
        "filter_part": rms(estimate.tau_ext_std[converged]),
    }


def divergence_warning(model: JointModel, nis: float) -> Diagnostic:
    """Warn of innovations that are much larger than the filter assumes."""
    size = f"the filter's innovations are {np.sqrt(nis / 2.0):.3g} times as large as it assumes"
    message = f"{model.log}/{model.joint}: {size}, so the measured motion does not follow from the effort"
    remedy = "check the units, signs and clock of its channels, and whether a sensor was stuck"
    return diagnostic("ekf", f"{model.log}.{model.joint}", "warning", f"{message}; {remedy}")


def drift_remark(kind: str, model: JointModel, offset: DayOffset, unit: str) -> Diagnostic:
    """Say that an offset changes between the free windows; a warning where that is more than the model's error."""
    drift = f"{offset.drift:.3g} {unit}, with a standard error of {offset.drift_std:.2g} {unit}"
    message = f"{model.log}/{model.joint}: the offset drifts within the free windows by {drift}"
    follows = "so an effort far from them may be off by half of it more than its error says"
    remedy = "a shorter log, or free windows closer around what matters, make that less"
    return diagnostic("ekf", f"{model.log}.{model.joint}", kind, f"{message}, {follows}; {remedy}")
