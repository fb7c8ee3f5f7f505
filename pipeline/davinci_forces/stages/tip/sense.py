"""Compare the estimated force with the force sensor of a log: error, lag and coverage of the 95 % band."""

from collections.abc import Iterable, Iterator
from typing import NamedTuple

import numpy as np

from davinci_forces.filters.problem import prismatic_track
from davinci_forces.maths.arrays import Array, Booleans
from davinci_forces.maths.contact.force_sensor import MIN_CORRELATION, errors, interpolate_sensor, lag
from davinci_forces.maths.signals.windows import is_past_transient
from davinci_forces.records import Diagnostic, SensorForce, TipForce, Touch, Track, diagnostic
from davinci_forces.robots.robot import Robot
from davinci_forces.study import LogEntry

MIN_SAMPLES_ERROR = 100
AXES = ("x", "y", "z")


class EstimatedForce(NamedTuple):
    """A force (N, k) with its covariance (N, k, k) over time, and the samples that are tested (N,)."""

    t: Array
    f: Array
    C: Array
    tested: Booleans


def run(
    touch: Touch, forces: Iterable[TipForce], tracks: Iterable[Track], entry: LogEntry, robot: Robot
) -> Iterator[SensorForce | Diagnostic]:
    """Compare the force at the tip, by component and as a vector, with a sensor of three axes in base axes.

    A sensor of one axis is compared with the magnitude of the tip force.  If no tip force is known, the sensor is
    compared with the external effort of the prismatic joint, with the sign of their correlation.
    """
    sensor = np.column_stack([getattr(touch, name) for name in ("force_x", "force_y", "force_z")])
    if not np.isfinite(sensor).all():
        sensor = touch.force[:, None]
    if not entry.joints or not np.isfinite(sensor).all():
        return
    pairs = list(comparisons(touch.t, sensor, list(forces), list(tracks), robot))
    if not pairs:
        why = "neither the force at the tip nor the external effort of a prismatic joint is known for enough samples"
        message = f"{entry.name}: its force sensor is not compared with an estimate: {why}"
        yield diagnostic("sense", entry.name, "warning", message)
    shown = [force for axis, f, measured in pairs for force in sensor_force(entry, axis, f, touch.t, measured)]
    yield from shown
    if opposite := ", ".join(f"force_{force.axis}" for force in shown if force.axis in AXES and is_opposite(force)):
        text = f"{entry.name}: the sensor shows the opposite of the estimate: if it measures the force on the robot"
        remedy = f"write sign = -1 with {opposite} in study.toml"
        yield diagnostic("sense", f"{entry.name}.sign", "warning", f"{text}, {remedy}")


def is_opposite(force: SensorForce) -> bool:
    """Whether the sensor's force is the estimate with the other sign."""
    f, sensor = np.stack([force.estimated_force, force.measured_force])[:, np.isfinite(force.measured_force)]
    return bool(np.cov(f, sensor)[0, 1] < -MIN_CORRELATION * f.std() * sensor.std())


def comparisons(
    clock: Array, sensor: Array, forces: list[TipForce], tracks: list[Track], robot: Robot
) -> Iterator[tuple[str, EstimatedForce, Array]]:
    """Axis, estimate and force of the sensor (M, k), on its clock (M,), of each comparison."""
    if forces:
        vector = estimate_at_tip(forces[0])
        if int(vector.tested.sum()) < MIN_SAMPLES_ERROR:
            return
        if sensor.shape[1] == 1:
            yield "size", size(vector), np.abs(sensor)
            return
        for i, axis in enumerate(AXES):
            yield axis, vector._replace(f=vector.f[:, [i]], C=vector.C[:, i : i + 1, i : i + 1]), sensor[:, [i]]
        yield "vector", vector, sensor
        return
    slide = prismatic_track(tracks, robot)
    if slide is not None and int(is_past_transient(slide.t).sum()) >= MIN_SAMPLES_ERROR:
        f, C = slide.tau_ext_smooth[:, None], (slide.tau_ext_smooth_std**2)[:, None, None]
        measured = sensor if sensor.shape[1] == 1 else np.linalg.norm(sensor, axis=1)[:, None]
        resampled = interpolate_sensor(slide.t, clock, measured, 3.0 / slide.rate)[:, 0]
        finite = np.isfinite(resampled)
        sign = -1.0 if finite.any() and np.cov(resampled[finite], f[finite, 0])[0, 1] < 0.0 else 1.0
        yield slide.joint, EstimatedForce(slide.t, f, C, is_past_transient(slide.t)), sign * measured


def estimate_at_tip(force: TipForce) -> EstimatedForce:
    """The force at the tip, tested where its pose is not near a singularity."""
    f = np.column_stack([force.f_x, force.f_y, force.f_z])
    C = np.stack([
        [force.c_xx, force.c_xy, force.c_xz], [force.c_xy, force.c_yy, force.c_yz], [force.c_xz, force.c_yz, force.c_zz]
    ]).transpose(2, 0, 1)  # fmt: skip
    return EstimatedForce(
        force.t, f, C, is_past_transient(force.t) & (force.near_singular == 0) & np.isfinite(f).all(1)
    )


def size(force: EstimatedForce) -> EstimatedForce:
    """Magnitude of a force, with its variance along the force."""
    length = np.linalg.norm(force.f, axis=1)
    u = force.f / np.maximum(length, 1e-300)[:, None]
    u[:, 0] += length == 0.0  # a zero force has no direction, so any serves
    return force._replace(f=length[:, None], C=np.einsum("ni,nij,nj->n", u, force.C, u)[:, None, None])


def sensor_force(
    entry: LogEntry, axis: str, estimate: EstimatedForce, clock: Array, sensor: Array
) -> Iterator[SensorForce]:
    """The error of an estimate, if enough samples of it and of the sensor are known."""
    rate = 1.0 / float(np.median(np.diff(estimate.t)))
    measured = interpolate_sensor(estimate.t, clock, sensor, 3.0 / rate)
    tested = estimate.tested & np.isfinite(measured).all(1)
    if int(tested.sum()) < MIN_SAMPLES_ERROR:
        return
    error = errors(estimate.f[tested], estimate.C[tested], measured[tested])
    sensor_lag, sensor_lag_std = lag(estimate.t, estimate.f, clock, sensor, rate, tested)
    drawn = size(estimate) if estimate.f.shape[1] > 1 else estimate
    yield SensorForce.like(
        error, log=entry.name, axis=axis, role=entry.role, tested=int(tested.sum()), sensor_lag=sensor_lag,
        sensor_lag_std=sensor_lag_std, t=estimate.t,
        measured_force=measured[:, 0] if measured.shape[1] == 1 else np.linalg.norm(measured, axis=1),
        estimated_force=drawn.f[:, 0], estimated_force_std=np.sqrt(drawn.C[:, 0, 0]),
    )  # fmt: skip
