"""Set the estimated force against that of a force sensor, where a log has one: error, range, lag and coverage."""

from collections.abc import Iterable, Iterator
from typing import NamedTuple

import numpy as np

from davinci_forces.maths.arrays import Array, Booleans
from davinci_forces.maths.contact.force_sensor import at, errors, lag
from davinci_forces.maths.signals.windows import settled
from davinci_forces.records import Diagnostic, SensorForce, TipForce, Touch, Track, diagnostic
from davinci_forces.robots.robot import Kind, Robot
from davinci_forces.study import LogEntry

FEWEST = 100  # samples, below which nothing is said
AXES = ("x", "y", "z")


class EstimatedForce(NamedTuple):
    """A force (N, k) with its covariance (N, k, k) over time, and where it is to be judged (N,)."""

    t: Array
    f: Array
    C: Array
    judged: Booleans


def run(
    touch: Touch, forces: Iterable[TipForce], tracks: Iterable[Track], entry: LogEntry, robot: Robot
) -> Iterator[SensorForce | Diagnostic]:
    """The force at the tip, component by component and as a vector, against a sensor of three axes in base axes.

    A sensor of one axis is set against the size of that force; where that is not known, against the external effort
    of the joint that slides, with the sign with which both go together.
    """
    sensor = np.column_stack([getattr(touch, name) for name in ("force_x", "force_y", "force_z")])
    one = touch.force[:, None]
    if not entry.joints or not (np.isfinite(sensor).all() or np.isfinite(one).all()):
        return
    made = list(compared(touch.t, sensor if np.isfinite(sensor).all() else one, list(forces), list(tracks), robot))
    if not made:
        said = (
            f"{entry.name}: its force sensor is compared with nothing: neither the force at the tip nor the external "
            "effort of a joint that slides is known there, or too few of their samples"
        )
        yield diagnostic("sense", entry.name, "note", said)
    for axis, estimate, shown in made:
        yield from against(entry, axis, estimate, touch.t, shown)


def compared(
    clock: Array, sensor: Array, forces: list[TipForce], tracks: list[Track], robot: Robot
) -> Iterator[tuple[str, EstimatedForce, Array]]:
    """What is set against what: an axis, the estimate, and what the sensor shows of it (M, k) on its clock (M,)."""
    if forces:
        whole = of_tip(forces[0])
        if int(whole.judged.sum()) < FEWEST:
            return
        if sensor.shape[1] == 1:
            yield "size", size(whole), np.abs(sensor)
            return
        for i, axis in enumerate(AXES):
            yield axis, whole._replace(f=whole.f[:, [i]], C=whole.C[:, i : i + 1, i : i + 1]), sensor[:, [i]]
        yield "vector", whole, sensor
        return
    slide = sliding(tracks, robot)
    if slide is not None and int(settled(slide.t).sum()) >= FEWEST:
        f, C = slide.tau_ext_smooth[:, None], (slide.tau_ext_std**2)[:, None, None]
        along = sensor if sensor.shape[1] == 1 else np.linalg.norm(sensor, axis=1)[:, None]
        shown = at(slide.t, clock, along, 3.0 / slide.rate)[:, 0]
        known = np.isfinite(shown)
        sign = -1.0 if known.any() and np.cov(shown[known], f[known, 0])[0, 1] < 0.0 else 1.0
        yield slide.joint, EstimatedForce(slide.t, f, C, settled(slide.t)), sign * along


def of_tip(force: TipForce) -> EstimatedForce:
    """The force at the tip where its pose tells it."""
    f = np.column_stack([force.f_x, force.f_y, force.f_z])
    C = np.stack([
        [force.c_xx, force.c_xy, force.c_xz], [force.c_xy, force.c_yy, force.c_yz], [force.c_xz, force.c_yz, force.c_zz]
    ]).transpose(2, 0, 1)  # fmt: skip
    return EstimatedForce(force.t, f, C, settled(force.t) & (force.near_singular == 0) & np.isfinite(f).all(1))


def size(of: EstimatedForce) -> EstimatedForce:
    """The size of a force, with its variance along itself."""
    length = np.linalg.norm(of.f, axis=1)
    u = of.f / np.maximum(length, 1e-300)[:, None]
    u[:, 0] += length == 0.0  # of no force, any direction
    return of._replace(f=length[:, None], C=np.einsum("ni,nij,nj->n", u, of.C, u)[:, None, None])


def sliding(tracks: list[Track], robot: Robot) -> Track | None:
    """The joint that slides farthest, of those whose effort is a force."""
    slides = [t for t in tracks if robot.joint(t.joint).kind is Kind.PRISMATIC and not t.at_rest]
    forces = [t for t in slides if not robot.joint(t.joint).effort]
    return max(forces, key=lambda track: float(np.ptp(track.q)), default=None)


def against(entry: LogEntry, axis: str, estimate: EstimatedForce, clock: Array, shown: Array) -> Iterator[SensorForce]:
    """One SensorForce, if enough samples of both are known."""
    rate = 1.0 / float(np.median(np.diff(estimate.t)))
    measured = at(estimate.t, clock, shown, 3.0 / rate)
    judged = estimate.judged & np.isfinite(measured).all(1)
    if int(judged.sum()) < FEWEST:
        return
    of = errors(estimate.f[judged], estimate.C[judged], measured[judged])
    late = lag(estimate.t, estimate.f, clock, shown, rate, judged)
    drawn = size(estimate) if estimate.f.shape[1] > 1 else estimate
    yield SensorForce(
        log=entry.name, axis=axis, role=entry.role, tested=int(judged.sum()), force_error=of.rmse,
        force_error_std=of.rmse_std, force_bias=of.bias, force_bias_std=of.bias_std, force_error_max=of.largest,
        force_range=of.span, force_relative_error=of.relative, force_relative_error_std=of.relative_std,
        sensor_lag=late.value, sensor_lag_std=late.std, sensor_coverage=of.coverage,
        sensor_coverage_std=of.coverage_std, t=estimate.t,
        measured_force=measured[:, 0] if measured.shape[1] == 1 else np.linalg.norm(measured, axis=1),
        estimated_force=drawn.f[:, 0], estimated_force_std=np.sqrt(drawn.C[:, 0, 0]),
    )  # fmt: skip
