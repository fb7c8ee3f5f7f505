"""Compute the force at the tip, with its covariance, from the external efforts of the joints."""

from collections.abc import Iterable, Iterator, Sequence

import numpy as np

from davinci_forces.maths.arrays import Array, Booleans, Integers, evenly
from davinci_forces.maths.contact.detection import (
    Rounding,
    largest_size,
    mean_effort,
    narrower_means,
    rounded_off,
    without_rounding,
)
from davinci_forces.maths.mechanics import tip_force
from davinci_forces.maths.mechanics.chain import Chain
from davinci_forces.maths.mechanics.kinematics import evaluate_in_blocks, jacobian, tip
from davinci_forces.maths.mechanics.tip_force import NEAR_SINGULAR, is_singular, matrix, shared_correlations
from davinci_forces.maths.signals.windows import MIN_FREE_SAMPLES, free_smoothed
from davinci_forces.maths.uncertainty.error_band import NORMAL_95, FreeSpaceLevels, levels
from davinci_forces.records.forces import Contact, Track
from davinci_forces.records.record import Diagnostic, diagnostic, join_names
from davinci_forces.records.tip import ArmCorrelation, JointCorrelation, TipBudget, TipContact, TipForce
from davinci_forces.robots.robot import TIP_JOINTS, Robot
from davinci_forces.study import LogEntry

MAX_LOGS_CORRELATION = 20
UNKNOWN = FreeSpaceLevels(*[float("nan")] * len(FreeSpaceLevels._fields))


def run(tracks: Sequence[Track], entry: LogEntry, robot: Robot) -> Iterator[JointCorrelation]:
    """Correlate the errors of the joints in free space, in a log in which all joints move and contacts are known."""
    if robot.chain is None or len(robot.joints) != TIP_JOINTS or not entry.has_known_free_motion:
        return
    moving = [track for joint in robot.joints for track in tracks if track.joint == joint.name and not track.at_rest]
    if len(moving) < TIP_JOINTS:
        return
    free = free_of(moving, entry.possible_contact)
    errors = np.array([track.tau_ext_smooth[free] for track in moving])
    if errors.shape[1] < MIN_FREE_SAMPLES or not errors.std(1).all():
        return
    rho = np.corrcoef(errors)
    yield JointCorrelation(entry.name, errors.shape[1], float(rho[0, 1]), float(rho[0, 2]), float(rho[1, 2]))


def gather(correlations: Iterable[JointCorrelation], robot: Robot) -> Iterator[ArmCorrelation]:
    """Collect the correlations of at most `MAX_LOGS_CORRELATION` logs."""
    of_logs = list(correlations)
    rows = [of_logs[i] for i in evenly(len(of_logs), MAX_LOGS_CORRELATION)]
    if rows:
        yield ArmCorrelation(
            robot=robot.name,
            source=np.array([row.log for row in rows], object),
            **{name: np.array([getattr(row, name) for row in rows]) for name in ("rho_12", "rho_13", "rho_23")},
        )


def apply(
    tracks: Sequence[Track],
    contacts: Iterable[Contact],
    correlations: Iterable[ArmCorrelation],
    entry: LogEntry,
    robot: Robot,
) -> Iterator[TipForce | TipContact | TipBudget | Diagnostic]:
    """Compute the force at the tip in a log in which all joints that carry it move.  (7.26)

    It holds if the arm touches its environment with the tip only.
    """
    if robot.chain is None or len(robot.joints) < TIP_JOINTS or entry.role in ("weight", "friction"):
        return
    by_joint = {track.joint: track for track in tracks}
    if why := why_unknown(by_joint, robot, robot.chain):
        if entry.role in ("contact", "tissue"):
            yield diagnostic("resolve", entry.name, "note", f"{entry.name}: no force at the tip: {why}")
        return
    tracks = [by_joint[joint.name] for joint in robot.joints]
    free = free_of(tracks, entry.possible_contact) & entry.has_known_free_motion
    rho, source = correlation(entry.name, correlations)
    force = tip_force_of(tracks, robot.chain, rho, source, free)
    yield force
    yield budget(tracks, robot.chain, free if free.any() else ~free)
    yield from tip_contacts(force, tracks, robot.chain, [*windows(entry, contacts)])


def free_of(tracks: Sequence[Track], windows: Sequence[tuple[float, float]]) -> Booleans:
    """Whether all joints move in free space, outside these windows, at each sample (N,), for the smoother."""
    free = [free_smoothed(track.t, windows, track.rate, track.unscored) for track in tracks]
    return np.asarray(np.all(free, axis=0))


def why_unknown(tracks: dict[str, Track], robot: Robot, chain: Chain) -> str:
    """State why the force at the tip is not known in a log; "" if it is."""
    if len(robot.joints) > TIP_JOINTS:  # the chain would assume that the joints beyond stand still
        moment = f"the efforts of more than {TIP_JOINTS} also hold a moment"
        remedy = "make joints that stand still `fixed` in its URDF, or see `davinci-forces guide tip-force`"
        return f"{robot.name} has {len(robot.joints)} joints, and {moment}; {remedy}"
    names = [joint.name for joint in robot.joints]
    missing = [
        f"{name} is at rest, where friction hides its effort; move it"
        if name in tracks
        else f"the external effort of {name} is not known, because it is not recorded or has no fit"
        for name in names
        if name not in tracks or tracks[name].at_rest
    ]
    if missing:
        return "; ".join(missing)
    if currents := [joint.name for joint in robot.joints if joint.effort]:
        return f"the effort of {join_names(currents)} is a current, not a force; state torque_constant"
    q = np.column_stack([tracks[name].q for name in names])
    if bool(evaluate_in_blocks(lambda block: is_singular(chain, block), q).all()):
        why = "no pose determines all its directions, as where the last frame lies on a joint's axis"
        return f"{why}; add a fixed link to the tip of the tool"
    return ""


def correlation(log: str, correlations: Iterable[ArmCorrelation]) -> tuple[Array, str]:
    """Correlation of the joints' errors (3,) in all other logs, and the logs' names; 0 where the logs disagree."""
    for arm in correlations:
        is_other = arm.source != log
        rho = shared_correlations(np.column_stack([arm.rho_12, arm.rho_13, arm.rho_23])[is_other])
        if rho.any():
            return rho, ", ".join(arm.source[is_other].tolist())
    return np.zeros(TIP_JOINTS), ""


def tip_force_of(tracks: Sequence[Track], chain: Chain, rho: Array, source: str, free: Booleans) -> TipForce:
    """The force at the tip in one log, by the smoother, since different lags of the joints would turn the force."""
    first, R = tracks[0], matrix(*rho.tolist())
    of_joints = [getattr(t, name) for name in ("q", "tau_ext_smooth", "tau_ext_smooth_std") for t in tracks]
    forces = evaluate_in_blocks(lambda block: forces_in_block(chain, block, R), np.column_stack(of_joints))
    f, C, blur, (x, y, z) = forces[:, :3], forces[:, 3:12].reshape(-1, 3, 3), forces[:, 12], forces[:, 13:].T
    near = blur > NEAR_SINGULAR
    tested = free & ~near
    space = UNKNOWN
    if int(tested.sum()) >= MIN_FREE_SAMPLES:  # within the 95 % ellipsoids
        reach = evaluate_in_blocks(lambda k: tip_force.reach_95(f[k], C[k]), np.flatnonzero(tested))
        space = levels(np.linalg.norm(f[tested], axis=1), reach / NORMAL_95)
    return TipForce(
        log=first.log, role=first.role, filter=first.filter, model=first.model, tested=int(tested.sum()),
        force_rms=space.free_rms, force_rms_std=space.free_rms_std, force_level=space.free_level,
        force_level_std=space.free_level_std, force_detection=space.detection_level,
        force_detection_std=space.detection_level_std, force_coverage=space.coverage,
        force_coverage_std=space.coverage_std, rho_12=float(rho[0]), rho_13=float(rho[1]), rho_23=float(rho[2]),
        correlation_from=source,
        median_condition=float(np.median(blur)), near_share=float(near.mean()), t=first.t, x=x, y=y, z=z,
        f_x=f[:, 0], f_y=f[:, 1], f_z=f[:, 2], c_xx=C[:, 0, 0], c_yy=C[:, 1, 1], c_zz=C[:, 2, 2], c_xy=C[:, 0, 1],
        c_xz=C[:, 0, 2], c_yz=C[:, 1, 2], condition=np.minimum(blur, np.finfo(float).max),
        near_singular=near.astype(np.int64),
    )  # fmt: skip


def forces_in_block(chain: Chain, of_joints: Array, R: Array) -> Array:
    """Force (3), its covariance (9), condition number and tip (3) in rows (N, 16), of q, tau_ext and std (N, 9)."""
    q, tau_ext, std = np.split(of_joints, 3, axis=1)
    J, _ = jacobian(chain, q)
    f, C = tip_force.from_efforts(J, tau_ext, tip_force.covariance(std, R))
    return np.column_stack([f, C.reshape(-1, 9), np.linalg.cond(J), tip(chain, q)])


def budget(tracks: Sequence[Track], chain: Chain, which: Booleans) -> TipBudget:
    """Force at the tip from each part of the error of each joint, at the median pose of the samples `which`."""
    median = np.array([float(np.median(track.q[which])) for track in tracks])
    lever = tip_force.lever(jacobian(chain, median)[0])
    noise, model = (lever * [getattr(track, part) for track in tracks] for part in ("smooth_part", "model_part"))
    total = np.hypot(noise, model)
    wider = np.sqrt(total**2 + lever**2 * [model_variance_std(track) for track in tracks])
    return TipBudget(
        log=tracks[0].log, of_joint=np.array([track.joint for track in tracks], object), lever=lever,
        filter_force=noise, model_force=model, model_force_std=lever * [track.model_part_std for track in tracks],
        total_force=total, total_force_std=wider - total,
    )  # fmt: skip


def model_variance_std(track: Track) -> float:
    """Standard error of the variance that the model's error adds to an external effort."""
    return (track.model_part + track.model_part_std) ** 2 - track.model_part**2


def windows(entry: LogEntry, contacts: Iterable[Contact]) -> Iterator[tuple[float, float, bool]]:
    """Start and end of the study's windows and of other contacts detected on any joint, and whether each is stated."""
    yield from ((start, end, True) for start, end in sorted(entry.contact))
    detected = sorted(
        (float(contact.onset[i]), float(contact.release[i]))
        for contact in contacts for i in np.flatnonzero(contact.stated == 0)
    )  # fmt: skip
    while detected:
        start, end = detected.pop(0)
        while detected and detected[0][0] <= end:
            end = max(end, detected.pop(0)[1])
        if not any(start <= last and end >= first for first, last in entry.contact):
            yield start, end, False


def tip_contacts(
    force: TipForce, tracks: Sequence[Track], chain: Chain, windows: Sequence[tuple[float, float, bool]]
) -> Iterator[TipContact]:
    """The largest force in each window in which the force is known."""
    f = np.column_stack([force.f_x, force.f_y, force.f_z])
    size = np.where(np.isnan(f[:, 0]), -1.0, np.linalg.norm(f, axis=1))
    insides = (np.where((force.t >= start) & (force.t <= end), size, -1.0) for start, end, _ in windows)
    pairs = zip(windows, insides, strict=True)
    peaks = [(*window, int(inside.argmax())) for window, inside in pairs if inside.max() > 0.0]
    if not peaks:
        return
    onset, release, stated, at = (np.array(column) for column in zip(*peaks, strict=True))
    u = f[at] / size[at, None]
    free = free_of(tracks, [*zip(onset, release, strict=True)])
    rounding = rounded_off_joints(tracks, at, np.round((release - onset) * tracks[0].rate).astype(int), free)
    C, sigma_std, lost = peak_errors(force, tracks, chain, at, u, rounding)
    middle, middle_std = np.array([
        middle_force(force, tracks, chain, (0.75 * a + 0.25 * b, 0.25 * a + 0.75 * b), free)
        for a, b in zip(onset.tolist(), release.tolist(), strict=True)
    ]).T  # fmt: skip
    x, y, z = f_peak = (f[at] + lost).T
    sigma, axes = tip_force.sigma_ellipsoid(C)
    std = np.sqrt(np.diagonal(C, axis1=1, axis2=2))
    yield TipContact(
        log=force.log, filter=force.filter, stated=stated.astype(np.int64), onset=onset, release=release,
        t_peak=force.t[at], f_x=x, f_x_std=std[:, 0], f_y=y, f_y_std=std[:, 1], f_z=z, f_z_std=std[:, 2],
        f_peak=np.linalg.norm(f_peak, axis=0), f_peak_std=np.sqrt(np.einsum("ni,nij,nj->n", u, C, u)),
        f_middle=middle, f_middle_std=middle_std,
        sigma_1=sigma[:, 0], sigma_1_std=sigma_std[:, 0], sigma_2=sigma[:, 1], sigma_2_std=sigma_std[:, 1],
        sigma_3=sigma[:, 2], sigma_3_std=sigma_std[:, 2], weak_x=axes[:, 0, 0], weak_y=axes[:, 0, 1],
        weak_z=axes[:, 0, 2], x=force.x[at], y=force.y[at], z=force.z[at], condition=force.condition[at],
        near_singular=force.near_singular[at],
    )  # fmt: skip


def middle_force(
    force: TipForce, tracks: Sequence[Track], chain: Chain, window: tuple[float, float], free: Booleans
) -> tuple[float, float]:
    """The size of the mean force over the middle half of a contact, and its error along itself; no smoothing moves it.

    NaN where no pose in it determines the force.
    """
    t = force.t
    within = ((t >= window[0]) & (t <= window[1])) | (np.abs(t - 0.5 * sum(window)) < 0.6 / tracks[0].rate)
    J, _ = jacobian(chain, np.stack([track.q[within] for track in tracks], axis=-1))
    direct = np.stack([track.tau_ext_direct[within] for track in tracks], axis=-1)
    friction = [np.asarray(x.static_friction / 3**0.5 * x.standing, np.float64) for x in tracks]
    means = [mean_effort(x.t, x.tau_ext_direct, window, free, y) for x, y in zip(tracks, friction, strict=True)]
    C_tau = tip_force.covariance([std for _, std in means], matrix(force.rho_12, force.rho_13, force.rho_23))
    f, C = tip_force.from_efforts(J, direct, C_tau)
    regular = np.isfinite(f[:, 0])
    if not regular.any():
        return np.nan, np.nan
    mean = f[regular].mean(axis=0)
    size = float(np.linalg.norm(mean))
    return size, float(np.sqrt(mean @ C[regular].mean(axis=0) @ mean) / max(size, np.finfo(float).tiny))


def rounded_off_joints(tracks: Sequence[Track], at: Integers, lengths: Integers, free: Booleans) -> Rounding:
    """What is rounded off each joint's effort at peaks (K,) of contacts of `lengths` samples (K,), each (K, 3)."""
    rows = []
    for t in tracks:
        means = narrower_means(t.t, t.tau_ext_direct, free, t.smooth_rise)
        for k, n in zip(at.tolist(), lengths.tolist(), strict=True):
            largest = largest_size(t.tau_ext_smooth, free, max(n, 1))
            of = (t.t, t.tau_ext_smooth, t.tau_ext_direct, k, t.smooth_rise)
            rows.append(rounded_off(*of, largest, means, moves=False))
    return Rounding(*np.nan_to_num(rows).reshape(len(tracks), len(at), 3).transpose(2, 1, 0))


def peak_errors(
    force: TipForce, tracks: Sequence[Track], chain: Chain, at: Integers, u: Array, rounding: Rounding
) -> tuple[Array, Array, Array]:
    """Covariance (K, 3, 3) of the force at peaks (K,), errors (K, 3) of its half-axes, and what is rounded off (K, 3).

    Noise raises the largest of many samples, so along its direction `u` (K, 3) that of the `rounding` (K, 3) counts,
    too.  Each joint's model variance has an error; the shape of a push is as uncertain as the rest of f.
    """
    J, _ = jacobian(chain, np.stack([track.q[at] for track in tracks], axis=-1))
    std = np.stack([without_rounding(t.tau_ext_smooth_std[at], t.tau_ext_rounding[at]) for t in tracks], axis=-1)
    rho = matrix(force.rho_12, force.rho_13, force.rho_23)
    lost, C = tip_force.from_efforts(J, rounding.lost, tip_force.covariance(std, rho))
    shape, _ = tip_force.from_efforts(J, rounding.shape, tip_force.covariance(std, rho))
    squares, half_axes = np.zeros(std.shape), tip_force.sigma_ellipsoid(C)[0]
    for i, track in enumerate(tracks):
        wider = std.copy()
        wider[:, i] = np.sqrt(std[:, i] ** 2 + model_variance_std(track))
        _, C_wider = tip_force.from_efforts(J, rounding.shape, tip_force.covariance(wider, rho))
        squares += (tip_force.sigma_ellipsoid(C_wider)[0] - half_axes) ** 2
    _, C_largest = tip_force.from_efforts(J, rounding.noise, tip_force.covariance(rounding.noise, rho))
    raised = u * np.sqrt(np.einsum("ni,nij,nj->n", u, C_largest, u))[:, None]
    C_peak = C + sum(x[:, :, None] * x[:, None, :] for x in (shape, raised))
    sigma, axes = tip_force.sigma_ellipsoid(C_peak)
    share = np.einsum("nki,ni->nk", axes, shape) / np.maximum(sigma, np.finfo(float).tiny)
    return C_peak, np.sqrt(squares + share**2 * np.einsum("nki,nij,nkj->nk", axes, C, axes)), lost
