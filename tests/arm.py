"""A small arm of the tests' own: its robot, and recordings of known parameters, as records and as files."""

import json
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import numpy as np
import pytest

from davinci_forces.identification import search
from davinci_forces.maths.models.independent import bias_coefficients, inertia_of, regressor
from davinci_forces.maths.models.model import JointDynamics
from davinci_forces.maths.models.terms import coulomb, gravity_cos, gravity_sin, inertia, lifted_mass, viscous
from davinci_forces.maths.signals.smoothing import measured_motion
from davinci_forces.records import Diagnostic, JointModel, Motion, Signal
from davinci_forces.robots.robot import Joint, Kind, Limits, Robot
from davinci_forces.stages.model import predict
from davinci_forces.stages.recordings import resample
from davinci_forces.study import LogEntry

HAND = Limits(q=(-0.6, 0.6), dq=(-1.2, 1.2), ddq=(-1.2, 1.2))
SLIDE = Limits(q=(-0.07, 0.11), dq=(-2.0, 2.0), ddq=(-3.0, 3.0))
MOTOR = {"gear_ratio": 100.0, "torque_constant": 0.05}

ARM = Robot(
    name="arm",
    title="Arm of the tests",
    joints=(
        Joint(
            "hand_roll", "Hand roll", Kind.REVOLUTE, (inertia, gravity_sin, viscous, coulomb), HAND, **MOTOR
        ),
        Joint(
            "hand_pitch", "Hand pitch", Kind.REVOLUTE, (inertia, gravity_sin, gravity_cos, viscous, coulomb), HAND,
            **MOTOR,
        ),
        Joint(
            "instrument_slide", "Instrument slide", Kind.PRISMATIC, (lifted_mass, inertia, viscous, coulomb), SLIDE,
            gear_ratio=1000.0, torque_constant=0.05,
        ),
    ),
)  # fmt: skip

THETA = {  # the LSE columns of Tables 6.4-6.6; the slide's inertia inside its physical bounds
    "hand_roll": np.array([0.4528, 0.0103, 0.3706, 0.21968]),
    "hand_pitch": np.array([0.2384, 0.1343, 0.0705, 0.9064, 0.4155]),
    "instrument_slide": np.array([2.5626, 0.05, 3.2723, 3.984]),
}
EXCITATION = {  # Table 6.1 with its misprints corrected: period, a0, a1, b1, a2, b2
    "hand_roll": (10.0, -0.1848, 0.0260, -0.2783, 0.0609, -0.4261),
    "hand_pitch": (10.0, -0.1912, 0.2861, -0.0639, 0.1741, 0.3701),
    "instrument_slide": (5.0, 0.02, 0.0001, 0.0002, -0.1632, -0.1350),
}
NOISE = {"hand_roll": 0.140, "hand_pitch": 0.214, "instrument_slide": 1.345}  # roots of the printed MSE


def coarse_grids() -> dict[str, tuple[float, ...]]:
    """The first, the middle and the last of each grid that a model is searched on, so that every extreme is tried."""
    names = ("CUTOFF_GRID", "LAG_GRID", "RIDGE_GRID", "DISPLACEMENT_GRID", "WIDTH_GRID", "DECAY_VELOCITY_GRID")
    grids = {name: getattr(search, name) for name in names}
    return {name: (grid[0], grid[len(grid) // 2], grid[-1]) for name, grid in grids.items()}


@contextmanager
def searched_coarsely() -> Iterator[None]:
    """As the fixture `coarse_search`, for what a module makes once."""
    with pytest.MonkeyPatch.context() as patch:
        for name, grid in coarse_grids().items():
            patch.setattr(search, name, grid)
        yield


def joint(name: str) -> Joint:
    return ARM.joint(name)


def excitation(name: str, t, period=None):
    """Position, velocity and acceleration of the optimal trajectory.  (6.16)-(6.18)"""
    T, a0, a1, b1, a2, b2 = EXCITATION[name]
    w = 2 * np.pi / (period or T)
    s1, c1, s2, c2 = np.sin(w * t), np.cos(w * t), np.sin(2 * w * t), np.cos(2 * w * t)
    q = a0 + (a1 * s1 - b1 * c1) / w + (a2 * s2 - b2 * c2) / (2 * w)
    dq = a1 * c1 + b1 * s1 + a2 * c2 + b2 * s2
    return q, dq, w * (b1 * c1 - a1 * s1) + 2 * w * (b2 * c2 - a2 * s2)


def dynamics(terms, theta, N) -> JointDynamics:
    """What a filter is told of a joint of these terms."""
    return JointDynamics(np.full(N, inertia_of(terms, theta)), bias_coefficients(terms, theta), np.zeros(N))


def signal(
    name="hand_roll",
    seed=0,
    periods=10,
    rate=100.0,
    period=None,
    noise=1.0,
    role="identification",
    log="run",
    external=None,
):
    """An excited joint as a Signal; `noise` scales the effort's, and external(t) is exerted on the environment."""
    T = period or EXCITATION[name][0]
    t = np.arange(round(periods * T * rate)) / rate
    q, dq, ddq = excitation(name, t, T)
    rng = np.random.default_rng(seed)
    tau = regressor(joint(name).terms, q, dq, ddq) @ THETA[name] + noise * NOISE[name] * rng.normal(size=len(t))
    if external is not None:
        tau = tau + external(t)
    q = q + noise * 1e-4 * rng.normal(size=len(t))
    dq = dq + noise * 1e-3 * rng.normal(size=len(t))
    at_rest = int(np.ptp(q) < 0.01)
    zero = np.zeros(len(t), int)
    columns = {"t": t, "q": q, "dq": dq, "tau": tau, "segment": zero, "filled": zero}
    return Signal(log, name, role, rate, "as recorded", "logged", 0, at_rest, **columns)


def motion(signal, cutoff=17.0) -> Motion:
    """The Motion of a Signal, as `resample` makes it."""
    dq = signal.dq if signal.velocity == "logged" else None
    smooth = measured_motion(signal.q, dq, signal.segment, signal.rate, cutoff)
    return resample.without_noise(signal, smooth, cutoff)


def models(signals, fits, predictions=(), fit="independent.lse", robot=ARM) -> list[JointModel | Diagnostic]:
    """What `predict` makes of the joints of a log, beside predictions."""
    entry = LogEntry(signals[0].log, (f"{signals[0].log}.csv",), signals[0].role, ())
    return list(predict.apply([motion(s) for s in signals], predictions, [], fits, entry, robot, fit=fit))


def write_csv(file: Path, signals, extra=None) -> None:
    """Signals of one clock as columns of text with a header: time, then <joint>.q, <joint>.dq, <joint>.tau of each."""
    columns = {"time": signals[0].t}
    for s in signals:
        columns |= {f"{s.joint}.q": s.q, f"{s.joint}.dq": s.dq, f"{s.joint}.tau": s.tau}
    columns |= extra or {}
    rows = np.column_stack(list(columns.values()))
    lines = [",".join(columns), *(",".join(map(repr, row)) for row in rows.tolist())]
    file.parent.mkdir(parents=True, exist_ok=True)
    file.write_text("\n".join(lines) + "\n")


def write_pushes(file: Path, seed=0, rate=50.0, stiffness=450.0, surface=4e-3, noise=0.02) -> str:
    """Three pushes 10 mm deep into a spring, as columns of text; returns their table of a study."""
    t = np.arange(round(12 * rate)) / rate
    depth = 5e-3 * (1 - np.cos(2 * np.pi * t / 4))
    force = stiffness * np.clip(depth - surface, 0, None) + noise * np.random.default_rng(seed).normal(size=len(t))
    lines = ["time,depth,force", *(",".join(map(repr, row)) for row in np.column_stack([t, depth, force]).tolist())]
    file.write_text("\n".join(lines) + "\n")
    channels = "".join(f'{name} = "{name}"\n' for name in ("time", "depth", "force"))
    return f'[[log]]\nname = "{file.stem}"\nfile = "{file.name}"\nrole = "tissue"\n[log.channels]\n{channels}'


def log_table(name: str, file: str, role: str, joints, more="") -> str:
    channels = "\n".join(f'"{j}.{s}" = "{j}.{s}"' for j in joints for s in ("q", "dq", "tau"))
    entry = f'[[log]]\nname = "{name}"\nfile = "{file}"\nrole = "{role}"\n{more}\n'
    return f'{entry}[log.channels]\ntime = "time"\n{channels}\n'


def write_robot(folder: Path) -> None:
    """The arm as a laboratory would describe it: arm.toml, beside a study."""
    tables = [f'name = "{ARM.name}"\ntitle = "{ARM.title}"\n']
    for j in ARM.joints:
        limits = ", ".join(f"{name} = {list(getattr(j.limits, name))}" for name in ("q", "dq", "ddq"))
        tables.append(
            f'[[joint]]\nname = "{j.name}"\ntitle = "{j.title}"\nkind = "{j.kind.value}"\n'
            f"terms = {json.dumps([term.name for term in j.terms])}\nlimits = {{ {limits} }}\n"
            f"gear_ratio = {j.gear_ratio}\ntorque_constant = {j.torque_constant}\n"
            f"harmonics = {j.harmonics}\n"
        )
    (folder / "arm.toml").write_text("\n".join(tables))


def write_study(folder: Path, seed=0, periods=5, rate=50.0) -> Path:
    """A small study of two joints: excitation, validation and contact of the roll, and the slide's excitation.

    The robot has no geometry, which leaves its chain, its controllers and its excitation out of the design.
    """
    short = {"periods": periods, "rate": rate, "seed": seed}
    roll = signal("hand_roll", period=2.0, **short)
    write_csv(folder / "roll.csv", [roll])
    write_csv(folder / "slide.csv", [signal("instrument_slide", period=2.0, **short)])
    write_csv(folder / "check.csv", [signal("hand_roll", period=2.6, **{**short, "seed": seed + 1})])
    push = signal("hand_roll", period=2.6, external=lambda t: np.where((t > 4) & (t < 6), 1.0, 0.0), **short)
    write_csv(folder / "push.csv", [push])
    write_robot(folder)
    (folder / "study.toml").write_text(
        'title = "A test"\nrobot = "arm.toml"\nsimulated = true\n'
        + log_table("roll", "roll.csv", "identification", ["hand_roll"], "period = 2.0")
        + log_table("slide", "slide.csv", "identification", ["instrument_slide"])
        + log_table("check", "check.csv", "validation", ["hand_roll"])
        + log_table("push", "push.csv", "contact", ["hand_roll"], "contact = [[4.0, 6.0]]")
    )
    return folder
