"""Find every push of a tissue log, estimate the tissue's stiffness, and choose the law that predicts its force."""

from collections.abc import Iterator, Sequence

import numpy as np

from davinci_forces.filters.problem import prismatic_track
from davinci_forces.maths.arrays import Array
from davinci_forces.maths.signals.smoothing import lowpass as lowpass_of
from davinci_forces.maths.signals.windows import unbroken
from davinci_forces.maths.tissue import palpation, tissue
from davinci_forces.maths.tissue.indentation import median_std
from davinci_forces.records import Column, Diagnostic, Push, Stiffness, TissueModel, Touch, Track, diagnostic
from davinci_forces.robots.robot import Robot
from davinci_forces.study import WHOLE_LOG, LogEntry

QUARTILE_FACTOR = 1.857  # of the variance of a mean: p (1 - p) over the square of the normal density, p = 1/4
WAYS = ("loading", "loading_std", "unloading", "unloading_std")
MIN_SAMPLES_PUSH = 8  # in a log, and in a push with which tissue models are compared


def run(
    touches: Sequence[Touch], tracks: Sequence[Track], entry: LogEntry, robot: Robot, *, lowpass: float
) -> Iterator[Push | Stiffness | TissueModel | Diagnostic]:
    """Find the pushes of a tissue log, and estimate the stiffness and the model of the tissue.

    The force is a sensor's channel.  Without a sensor, it is the external effort of the prismatic joint: its effort
    less the model's, low-passed without delay.  The filter's estimate would lag the depth, which shifts first contact
    and adds a false hysteresis loop; the model's error is in both alike.
    """
    if entry.role != "tissue":
        return
    touch, slide = next(iter(touches), None), prismatic_track(tracks, robot)
    data = palpation_data(touch, slide, lowpass)
    if data is None or len(data.t) < MIN_SAMPLES_PUSH:
        message = "no push can be found, because no force or no depth is known"
        advice = "state their channels, or add an identification log of the prismatic joint, and its torque_constant"
        yield diagnostic("palpate", entry.name, "warning", f"{entry.name}: {message}; {advice}")
        return
    whole, windows = entry.contact == WHOLE_LOG, () if entry.contact == WHOLE_LOG else entry.contact
    pushes = palpation.evaluate_pushes(data, windows, whole, rate_of(data.t), lowpass)
    touched = [push for push in pushes if push.line is not None]
    texts = [f"{entry.name}: {remark}" for remark in palpation.remarks(pushes)]
    if not entry.contact and data.push.any() and palpation.touches_at_once(numbered_pushes(data)):
        what = "the force rises from the first sample of each push on, but its contact is searched"
        remedy = 'write contact = "all" if the probe touches from the start, else contact windows'
        texts.append(f"{entry.name}: {what}, which changes the stiffness; {remedy}")
    if texts:
        yield diagnostic("palpate", entry.name, "warning", *texts)
    if not touched:
        return
    models, best, why = choose_law(touched, clocked=bool(rate_of(data.t)))
    yield from (record_of(push, entry.name, best) for push in touched)
    by_joint = touch is None or not has_force(touch)
    yield stiffness_of(touched, entry.name, slide.joint if by_joint and slide else "force sensor", len(pushes))
    if best is not None:
        yield model_of(models, best, why, touched, entry.name, float(np.median(data.std)))


def numbered_pushes(data: palpation.Probing) -> list[tuple[Column, Column]]:
    """Depth and force (N,) of each push that the log numbers."""
    starts = np.flatnonzero(np.diff(data.push)) + 1
    way = np.linalg.norm(data.depth - data.depth[0], axis=1) if data.depth.shape[1] > 1 else data.depth[:, 0]
    return list(zip(np.split(way, starts), np.split(data.size, starts), strict=True))


def has_force(touch: Touch) -> bool:
    """Whether a log has a force sensor's channels."""
    return bool(np.isfinite(touch.force).any() or np.isfinite(touch.force_x).any())


def palpation_data(touch: Touch | None, slide: Track | None, cutoff: float) -> palpation.Probing | None:
    """Force, depth and place of a log, from its own channels or, without such channels, from the prismatic joint."""
    if touch is not None and has_force(touch):
        is_scalar = np.isfinite(touch.force).any()
        force = touch.force[:, None] if is_scalar else np.column_stack([touch.force_x, touch.force_y, touch.force_z])
        zeros = np.zeros(len(touch))
        depth = depth_of(touch, slide, touch.t)
        if depth is None:
            return None
        return palpation.known_samples(
            palpation.Probing(touch.t, touch.push, depth, force, place_of(touch), zeros + np.nan, zeros)
        )
    if slide is None:
        return None
    direct, dq = np.zeros(len(slide)), np.zeros(len(slide))
    for part in unbroken(slide.t, 1.5 / slide.rate):
        direct[part] = lowpass_of(slide.tau_ext_direct[part], slide.rate, cutoff)
        dq[part] = lowpass_of(slide.dq[part], slide.rate, cutoff)
    depth = depth_of(touch, slide, slide.t)
    assert depth is not None
    push, place = np.zeros(len(slide), np.int64), np.full((len(slide), 3), np.nan)
    if touch is not None:
        nearest = np.clip(np.searchsorted(touch.t, slide.t), 0, len(touch) - 1)
        push, place = touch.push[nearest], place_of(touch)[nearest]
    # The error that pushes may share is that of the model, or where unknown, the total: the residual of a line contains
    # the noise, its intercept the constant effort offset that differs from day to day, and there is no lag.
    std = np.full(len(slide), slide.model_part) if slide.band_from else slide.tau_ext_smooth_std
    return palpation.known_samples(palpation.Probing(slide.t, push, depth, direct[:, None], place, dq, std))


def depth_of(touch: Touch | None, slide: Track | None, t: Column) -> Array | None:
    """Depth (N, 1) or tip position (N, 3) at times (N,), from channels, or else the prismatic joint's position."""
    for columns in ((touch.depth,), (touch.x, touch.y, touch.z)) if touch is not None else ():
        if np.isfinite(columns[0]).any():
            return np.column_stack([x if t is touch.t else np.interp(t, touch.t, x) for x in columns])  # type: ignore[union-attr]
    return None if slide is None else np.interp(t, slide.t, slide.q)[:, None]


def place_of(touch: Touch) -> Array:
    """Position of the tip (N, 3)."""
    return np.column_stack([touch.x, touch.y, touch.z])


def rate_of(t: Column) -> float:
    """Sampling rate [Hz]; 0 without a clock."""
    return 1.0 / float(np.median(np.diff(t))) if np.isfinite(t).all() else 0.0


def choose_law(
    pushes: Sequence[palpation.PalpatedPush], *, clocked: bool
) -> tuple[list[tissue.FittedLaw], tissue.FittedLaw | None, str]:
    """Score every tissue model on left-out pushes, and choose one model; this needs at least two pushes."""
    long = [push for push in pushes if push.contact.inside.sum() >= MIN_SAMPLES_PUSH]
    if len(long) < 2:
        return [], None, ""
    inside = [push.contact.inside for push in long]
    sums = tissue.moments([(p.depth_in_contact[i], p.rate[i], p.force[i]) for p, i in zip(long, inside, strict=True)])
    models = [tissue.cross_validate_law(sums, law) for law in tissue.LAWS if clocked or law.columns == (0,)]
    return models, *tissue.preferred_law(models)


def record_of(push: palpation.PalpatedPush, log: str, best: tissue.FittedLaw | None) -> Push:
    """One push, with the force of the chosen model, or of the straight line if no model was chosen."""
    inside, line = push.contact.inside, push.line
    assert line is not None
    fitted = line.c + line.k * push.depth
    if best is not None:
        fitted = tissue.force_of(best, push.depth_in_contact, push.rate)
        fitted = fitted + float(np.mean((push.force - fitted)[inside]))
    return Push.like(
        push,
        push.contact,
        line,
        log=log,
        push=push.number,
        contact=push.contact.state,
        k_t=line.k,
        k_t_std=float(np.hypot(line.k_std, push.k_t_std_model)),
        intercept=line.c,
        fitted=np.where(inside, fitted, np.nan),
        **dict(zip("xyz", push.place.T, strict=True)),
    )


def stiffness_of(pushes: Sequence[palpation.PalpatedPush], log: str, source: str, swings: int) -> Stiffness:
    """The stiffness of a log: the median slope of the pushes whose force is a straight line."""
    lines = [push.line for push in pushes if push.line is not None]
    k, k_std, r2 = (np.array([getattr(line, name) for line in lines]) for name in ("k", "k_std", "r2"))
    model = np.array([push.k_t_std_model for push in pushes])
    counts = np.array([push.explained for push in pushes]) > palpation.MIN_EXPLAINED
    common = float(np.median(model[counts])) if counts.any() else float("nan")
    low, middle, high = np.quantile(k[counts], [0.25, 0.5, 0.75]) if counts.any() else [float("nan")] * 3
    std = median_std(k[counts], k_std[counts], common) if counts.any() else float("nan")
    quartile_std = median_std(k[counts], k_std[counts], common, QUARTILE_FACTOR) if counts.any() else float("nan")
    lost = np.array([push.dissipated_energy for push in pushes])
    closed = lost[np.isfinite(lost).all(axis=1)]
    lost_std = np.full((len(k), 2), closed.std(axis=0, ddof=1) if len(closed) > 1 else np.nan)
    return Stiffness(
        log=log,
        source=source,
        swings=swings,
        stiffness=float(middle),
        stiffness_std=std,
        stiffness_std_model=common,
        stiffness_q1=float(low),
        stiffness_q1_std=quartile_std,
        stiffness_q3=float(high),
        stiffness_q3_std=quartile_std,
        pushes=int(counts.sum()),
        push=np.array([push.number for push in pushes]),
        counted=counts.astype(np.int64),
        k_t=k,
        k_t_std=np.hypot(k_std, model),
        r2=r2,
        r2_std=2.0 * r2 * (1.0 - r2) * np.hypot(k_std, model) / np.where(k == 0.0, 1.0, np.abs(k)),  # d R2 of dk
        onset_depth=np.array([push.contact.onset_depth for push in pushes]),
        onset_depth_std=np.array([push.contact.onset_depth_std for push in pushes]),
        onset=np.array([push.t[int(np.argmax(push.contact.inside))] for push in pushes]),
        onset_std=np.array([onset_time_std(push) for push in pushes]),
        **{f"k_t_{way}": np.array([getattr(push, f"k_{way}") for push in pushes]) for way in WAYS},
        lost=lost[:, 0],
        lost_std=lost_std[:, 0],
        lost_share=lost[:, 1],
        lost_share_std=lost_std[:, 1],
        **dict(zip("xyz", np.array([push.place[int(np.argmax(push.depth))] for push in pushes]).T, strict=True)),
    )


def onset_time_std(push: palpation.PalpatedPush) -> float:
    """Standard error of the time of first contact [s]: that of its depth over the rate of the depth there."""
    rate = abs(float(push.rate[int(np.argmax(push.contact.inside))]))
    return push.contact.onset_depth_std / rate if rate > 0.0 else float("nan")


def model_of(
    models: Sequence[tissue.FittedLaw],
    best: tissue.FittedLaw,
    why: str,
    pushes: Sequence[palpation.PalpatedPush],
    log: str,
    model_std: float,
) -> TissueModel:
    """Stiffness and damping of each model of the tissue at half the median depth of the pushes.

    The force of a joint errs by `model_std`.  An error of friction reverses with the motion, as damping does.
    """
    middle = float(np.median([push.depth_in_contact[push.contact.inside].max() for push in pushes])) / 2
    stiff, damping = np.array([tissue.tangent(model, middle) for model in models]).T
    stiff_std, damping_std, exponent_std = np.array([tissue.standard_errors(model, middle) for model in models]).T
    speed = float(np.mean(np.abs(np.concatenate([push.rate[push.contact.inside] for push in pushes]))))
    if speed > 0.0:
        damping_std = np.where(damping != 0.0, np.hypot(damping_std, model_std / speed), damping_std)
    return TissueModel(
        log=log,
        chosen=best.law.name,
        why=why,
        middle=middle,
        law=np.array([model.law.name for model in models], object),
        error=np.array([model.score for model in models]),
        error_std=np.array([model.score_std for model in models]),
        tangent=stiff,
        tangent_std=stiff_std,
        damping=damping,
        damping_std=damping_std,
        exponent=np.array([model.exponent for model in models]),
        exponent_std=exponent_std,
    )
