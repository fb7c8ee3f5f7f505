"""Resolve the external efforts of the joints into the force at the tip, with its covariance."""

from collections.abc import Iterable, Iterator, Sequence

import numpy as np

from davinci_forces.maths.arrays import Array, Booleans, Integers, evenly
from davinci_forces.maths.mechanics import tip_force
from davinci_forces.maths.mechanics.chain import Chain
from davinci_forces.maths.mechanics.kinematics import along, jacobian, tip
from davinci_forces.maths.mechanics.tip_force import NEAR_SINGULAR, condition, matrix, shared
from davinci_forces.maths.signals.windows import SETTLE, free_space
from davinci_forces.maths.uncertainty.error_band import NORMAL_95, FreeSpaceLevels, levels
from davinci_forces.records import (
    ArmCorrelation,
    Contact,
    Diagnostic,
    JointCorrelation,
    TipBudget,
    TipContact,
    TipForce,
    Track,
    diagnostic,
)
from davinci_forces.robots.robot import Robot
from davinci_forces.study import LogEntry

ARM = 3  # joints that carry the tip; the wrist is taken to be straight
FEWEST = 100  # samples of free space, below which nothing is said of it
LOGS = 20  # at most, that a correlation is taken from
UNKNOWN = FreeSpaceLevels(*[float("nan")] * len(FreeSpaceLevels._fields))


def run(tracks: Sequence[Track], entry: LogEntry, robot: Robot) -> Iterator[JointCorrelation]:
    """One JointCorrelation of a log; none where a joint is at rest, or where it is not known when it was touched."""
    own = [track for joint in robot.joints[:ARM] for track in tracks if track.joint == joint.name and not track.at_rest]
    if robot.chain is None or len(robot.joints) != ARM or len(own) < ARM or not entry.tells_free_space:
        return
    calm = [(start - SETTLE, end) for start, end in entry.contact]  # the smoother sees a contact coming
    free = free_space(own[0].t, calm, own[0].rate)
    errors = np.array([track.tau_ext_smooth[free] for track in own])
    if errors.shape[1] < FEWEST or not errors.std(1).all():
        return
    rho = np.corrcoef(errors)
    yield JointCorrelation(entry.name, errors.shape[1], float(rho[0, 1]), float(rho[0, 2]), float(rho[1, 2]))


def gather(correlations: Iterable[JointCorrelation], robot: Robot) -> Iterator[ArmCorrelation]:
    """One ArmCorrelation where any log tells of it."""
    own = list(correlations)
    if not own:
        return
    some = [own[i] for i in evenly(len(own), LOGS)]
    yield ArmCorrelation(
        robot=robot.name,
        source=np.array([one.log for one in some], object),
        rho_12=np.array([one.rho_12 for one in some]),
        rho_13=np.array([one.rho_13 for one in some]),
        rho_23=np.array([one.rho_23 for one in some]),
    )


def apply(
    tracks: Sequence[Track],
    contacts: Iterable[Contact],
    correlations: Iterable[ArmCorrelation],
    entry: LogEntry,
    robot: Robot,
) -> Iterator[TipForce | TipContact | TipBudget | Diagnostic]:
    """The force at the tip in a log in which all joints that carry it move, if nothing else is touched.  (7.26)"""
    if robot.chain is None or len(robot.joints) < ARM or entry.role in ("weight", "friction"):
        return
    by_joint = {track.joint: track for track in tracks}
    if len(robot.joints) > ARM:  # the chain would be taken to stand still beyond them
        if entry.role in ("contact", "tissue"):
            said = f"{robot.name} has {len(robot.joints)} joints, and a force at the tip is told by {ARM} that carry it"
            yield diagnostic("resolve", entry.name, "note", f"{entry.name}: no force at the tip: {said}")
        return
    names = [joint.name for joint in robot.joints]
    missing = list(missing_joints(names, by_joint))
    if missing:
        if entry.role in ("contact", "tissue"):
            yield diagnostic("resolve", entry.name, "note", f"{entry.name}: no force at the tip: {'; '.join(missing)}")
        return
    own, free = [by_joint[name] for name in names], np.zeros(len(by_joint[names[0]]), np.bool_)
    if entry.tells_free_space:
        calm = [(start - SETTLE, end) for start, end in entry.contact]  # the smoother sees a contact coming
        free = free_space(own[0].t, calm, own[0].rate)
    rho, source = correlation(entry.name, correlations)
    force = resolved(own, robot.chain, rho, source, free)
    yield force
    yield budget(own, robot.chain, free if free.any() else ~free)
    yield from touching(force, own, robot.chain, [*windows(entry, contacts)])


def missing_joints(names: Sequence[str], tracks: dict[str, Track]) -> Iterator[str]:
    """Why the effort of joints is not known in a log."""
    for name in names:
        if name not in tracks:
            yield f"{name} is not tracked, as nothing recorded or fitted tells of it"
        elif tracks[name].at_rest:
            yield f"{name} is at rest, where friction hides its effort; move it"


def correlation(log: str, correlations: Iterable[ArmCorrelation]) -> tuple[Array, str]:
    """What other logs say of how the joints' errors go together (3,), and which they are; 0 where they do not agree."""
    for arm in correlations:
        others = arm.source != log
        rho = shared(np.column_stack([arm.rho_12, arm.rho_13, arm.rho_23])[others])
        if rho.any():
            return rho, ", ".join(arm.source[others].tolist())
    return np.zeros(ARM), ""


def resolved(own: Sequence[Track], chain: Chain, rho: Array, source: str, free: Booleans) -> TipForce:
    """The force at the tip of one log, without delay: joints that lag differently would point it elsewhere."""
    first, q = own[0], np.stack([track.q for track in own], axis=-1)
    J = along(lambda some: jacobian(chain, some)[0], q)
    tau_ext, std = (np.stack([getattr(t, name) for t in own], axis=-1) for name in ("tau_ext_smooth", "tau_ext_std"))
    f, C = tip_force.from_efforts(J, tau_ext, tip_force.covariance(std, matrix(*rho.tolist())))
    blur, (x, y, z) = condition(J), along(lambda some: tip(chain, some), q).T
    near = blur > NEAR_SINGULAR
    judged = free & ~near
    space = levels_of(f[judged], C[judged]) if int(judged.sum()) >= FEWEST else UNKNOWN
    return TipForce(
        log=first.log, role=first.role, filter=first.filter, model=first.model, tested=int(judged.sum()),
        force_rms=space.rms, force_rms_std=space.rms_std, force_level=space.level_95,
        force_level_std=space.level_95_std, force_detection=space.level_99, force_detection_std=space.level_99_std,
        force_coverage=space.coverage, force_coverage_std=space.coverage_std, rho_12=float(rho[0]),
        rho_13=float(rho[1]), rho_23=float(rho[2]), correlation_from=source,
        median_condition=float(np.median(blur)), near_share=float(near.mean()), t=first.t, x=x, y=y, z=z,
        f_x=f[:, 0], f_y=f[:, 1], f_z=f[:, 2], c_xx=C[:, 0, 0], c_yy=C[:, 1, 1], c_zz=C[:, 2, 2], c_xy=C[:, 0, 1],
        c_xz=C[:, 0, 2], c_yz=C[:, 1, 2], condition=np.minimum(blur, np.finfo(float).max),
        near_singular=near.astype(np.int64),
    )  # fmt: skip


def levels_of(f: Array, C: Array) -> FreeSpaceLevels:
    """The levels of the size of forces (N, 3) in free space, and the share within their 95 % ellipsoids."""
    return levels(np.linalg.norm(f, axis=1), tip_force.reach_95(f, C) / NORMAL_95)


def budget(own: Sequence[Track], chain: Chain, which: Booleans) -> TipBudget:
    """What the parts of each joint's deviation come to at the tip, at the median pose of some samples."""
    median = np.array([float(np.median(track.q[which])) for track in own])
    lever = tip_force.lever(jacobian(chain, median)[0])
    noise, model, late = (
        lever * np.array([getattr(track, part) for track in own]) for part in ("filter_part", "model_part", "lag_part")
    )
    total = np.sqrt(noise**2 + model**2 + late**2)
    wider = np.sqrt(total**2 + lever**2 * [model_variance_std(track) for track in own])
    return TipBudget(
        log=own[0].log, of_joint=np.array([track.joint for track in own], object), lever=lever, filter_force=noise,
        model_force=model, model_force_std=lever * [track.model_part_std for track in own], lag_force=late,
        total_force=total, total_force_std=wider - total,
    )  # fmt: skip


def model_variance_std(track: Track) -> float:
    """The standard error of the variance that the model's error adds to an external effort."""
    return (track.model_part + track.model_part_std) ** 2 - track.model_part**2


def windows(entry: LogEntry, contacts: Iterable[Contact]) -> Iterator[tuple[float, float, bool]]:
    """Start, end and whether it is stated, of the study's windows and of what was found beside them on any joint."""
    yield from ((start, end, True) for start, end in sorted(entry.contact))
    found = sorted(
        (float(contact.onset[i]), float(contact.release[i]))
        for contact in contacts for i in np.flatnonzero(contact.stated == 0)
    )  # fmt: skip
    while found:
        start, end = found.pop(0)
        while found and found[0][0] <= end:
            end = max(end, found.pop(0)[1])
        if not any(start <= last and end >= first for first, last in entry.contact):
            yield start, end, False


def touching(
    force: TipForce, own: Sequence[Track], chain: Chain, windows: Sequence[tuple[float, float, bool]]
) -> Iterator[TipContact]:
    """The force where it is largest in each window in which it is known anywhere."""
    f = np.column_stack([force.f_x, force.f_y, force.f_z])
    size = np.where(np.isnan(f[:, 0]), -1.0, np.linalg.norm(f, axis=1))
    peaks = [(*window, k) for window in windows if (k := largest(force.t, size, window)) is not None]
    if not peaks:
        return
    onset, release, stated, at = (np.array(column) for column in zip(*peaks, strict=True))
    C = np.stack([
        [force.c_xx, force.c_xy, force.c_xz], [force.c_xy, force.c_yy, force.c_yz], [force.c_xz, force.c_yz, force.c_zz]
    ])[..., at].transpose(2, 0, 1)  # fmt: skip
    sigma, axes = tip_force.sigma_ellipsoid(C)
    sigma_std = half_axes_std(force, own, chain, at, sigma)
    std, u = np.sqrt(np.diagonal(C, axis1=1, axis2=2)), f[at] / size[at, None]
    yield TipContact(
        log=force.log, filter=force.filter, stated=stated.astype(np.int64), onset=onset, release=release,
        t_peak=force.t[at], f_x=f[at, 0], f_x_std=std[:, 0], f_y=f[at, 1], f_y_std=std[:, 1], f_z=f[at, 2],
        f_z_std=std[:, 2], f_peak=size[at], f_peak_std=np.sqrt(np.einsum("ni,nij,nj->n", u, C, u)),
        sigma_1=sigma[:, 0], sigma_1_std=sigma_std[:, 0], sigma_2=sigma[:, 1], sigma_2_std=sigma_std[:, 1],
        sigma_3=sigma[:, 2], sigma_3_std=sigma_std[:, 2], weak_x=axes[:, 0, 0], weak_y=axes[:, 0, 1],
        weak_z=axes[:, 0, 2], x=force.x[at], y=force.y[at], z=force.z[at], condition=force.condition[at],
        near_singular=force.near_singular[at],
    )  # fmt: skip


def half_axes_std(force: TipForce, own: Sequence[Track], chain: Chain, at: Integers, sigma: Array) -> Array:
    """The standard errors (K, 3) of the half-axes at samples (K,): what each joint's model variance adds by its own."""
    J, _ = jacobian(chain, np.stack([track.q[at] for track in own], axis=-1))
    std = np.stack([track.tau_ext_std[at] for track in own], axis=-1)
    rho = matrix(force.rho_12, force.rho_13, force.rho_23)
    squares = np.zeros(sigma.shape)
    for i, track in enumerate(own):
        wider = std.copy()
        wider[:, i] = np.sqrt(std[:, i] ** 2 + model_variance_std(track))
        _, C = tip_force.from_efforts(J, np.zeros(std.shape), tip_force.covariance(wider, rho))
        squares += (tip_force.sigma_ellipsoid(C)[0] - sigma) ** 2
    return np.asarray(np.sqrt(squares))


def largest(t: Array, size: Array, window: tuple[float, float, bool]) -> int | None:
    """The sample at which a size (N,) is largest within a window, None where there is none of a size above 0."""
    inside = np.where((t >= window[0]) & (t <= window[1]), size, -1.0)
    k = int(np.argmax(inside))
    return k if inside[k] > 0.0 else None
