"""Logs of the guide's tutorials: copies of the demonstration's under a laboratory's names, and simulated motion."""

import shutil
from collections.abc import Callable
from pathlib import Path

import numpy as np

import davinci_forces
from tests.conftest import ROOT
from tests.logs.bag_writer import joint_state, write
from tests.test_new import table

DEMO = ROOT / "raw" / "davinci-demo"
RATE = 100.0  # [Hz]
LINK = """<link name="{name}"><inertial><origin xyz="{centre}"/><mass value="{mass}"/>
<inertia ixx="{small}" ixy="0" ixz="0" iyy="{large}" iyz="0" izz="{large}"/></inertial></link>
"""
JOINT = """<joint name="{name}" type="revolute"><parent link="{on}"/><child link="{link}"/><origin xyz="{at}"/>
<axis xyz="{axis}"/><limit lower="-3" upper="3" velocity="3" effort="{effort}"/></joint>
"""
URDF = "".join(
    [
        '<robot name="bench_arm">\n<link name="base"/>\n',
        LINK.format(name="shoulder", centre="0 0 0", mass=2.0, small=0.02, large=0.02),
        LINK.format(name="upper", centre="0.2 0 0", mass=3.0, small=0.01, large=0.06),
        LINK.format(name="fore", centre="0.15 0 0", mass=1.2, small=0.004, large=0.02),
        JOINT.format(name="pan", on="base", link="shoulder", at="0 0 0.1", axis="0 0 1", effort=150),
        JOINT.format(name="lift", on="shoulder", link="upper", at="0 0 0.1", axis="0 1 0", effort=150),
        JOINT.format(name="elbow", on="upper", link="fore", at="0.4 0 0", axis="0 1 0", effort=80),
        '<link name="tool"/><joint name="flange" type="fixed"><parent link="fore"/><child link="tool"/>'
        '<origin xyz="0.35 0 0"/></joint>\n</robot>\n',
    ]
)


def motion(seed: int, joints: int, duration: float, period: float, size: float) -> tuple[np.ndarray, ...]:
    """Times (N,) [s], and q, dq and ddq (N, joints) of three harmonics with phases of this seed."""
    t = np.arange(round(duration * RATE)) / RATE
    omega = 2 * np.pi / period * np.arange(1, 4)
    phase = np.random.default_rng(seed).uniform(0, 2 * np.pi, (3, joints))
    angle = omega[:, None] * t[:, None, None] + phase
    amplitude = size / np.arange(1, 4)[:, None]
    w = omega[:, None]
    return (
        t,
        (amplitude * np.sin(angle)).sum(1),
        (amplitude * w * np.cos(angle)).sum(1),
        (-amplitude * w**2 * np.sin(angle)).sum(1),
    )


def measured(ideal: np.ndarray, dq: np.ndarray, seed: int, scale: np.ndarray) -> np.ndarray:
    """Efforts with viscous and Coulomb friction and noise, in proportion to a scale of each joint."""
    noise = np.random.default_rng(seed).normal(size=dq.shape)
    return ideal + scale * (0.8 * dq + 0.6 * np.tanh(dq / 0.01) + 0.05 * noise)


def sensed(*signals: np.ndarray) -> tuple[np.ndarray, ...]:
    """Positions and velocities with the noise of an encoder."""
    rng = np.random.default_rng(7)
    return tuple(x + s * rng.normal(size=x.shape) for x, s in zip(signals, (1e-5, 2e-3), strict=True))


def push(t: np.ndarray, start: float, peak: float) -> np.ndarray:
    """A triangle of two seconds."""
    return peak * np.clip(1 - np.abs(t - start - 1.0), 0, None)


def copies(folder: str, **files: str) -> Callable[[Path], None]:
    def make(home: Path) -> None:
        (home / folder).mkdir(parents=True)
        for target, source in files.items():
            shutil.copy(DEMO / source, home / folder / (target + Path(source).suffix))

    return make


def demonstration(home: Path) -> None:
    """The roll's two logs of the demonstration, under its name and with its study.toml: seconds, not a minute."""
    folder = home / "raw" / "davinci-demo"
    folder.mkdir(parents=True)
    head, *logs = (DEMO / "study.toml").read_text().split("[[log]]\n")
    kept = [log for log in logs if log.startswith(('name = "roll-excitation"', 'name = "roll-contact"'))]
    (folder / "study.toml").write_text("[[log]]\n".join([head, *kept]))
    for name in ("roll_excitation.tdms", "roll_contact.tdms"):
        shutil.copy(DEMO / name, folder)


ROLES = {"excitation": (1, 40.0, 4.0), "validation": (2, 35.0, 5.0), "contact": (3, 35.0, 5.0)}  # seed, [s], [s]


def urdf_arm(home: Path) -> None:
    """Three joints of a UR-like arm as its controller streams them, with a push on the elbow in the last log."""
    folder = home / "raw" / "bench"
    folder.mkdir(parents=True)
    (folder / "bench_arm.urdf").write_text(URDF)
    robot = davinci_forces.robot("bench_arm.urdf", folder)
    names = ("actual_q_{}", "actual_qd_{}", "actual_torque_{}")
    header = ",".join(["timestamp", *(name.format(k) for name in names for k in range(3))])
    for name, (seed, duration, period) in ROLES.items():
        t, q, dq, ddq = motion(seed, 3, duration, period, 0.4)
        q += np.array([0.0, -0.5, 1.0])
        tau = measured(robot.inverse_dynamics(q, dq, ddq), dq, seed, np.array([2.0, 2.0, 1.0]))
        tau[:, 2] += push(t, 10.0, 4.0) * (name == "contact")
        table(folder / f"{name}.csv", t, *sensed(q, dq), tau, header=header)


def bags(home: Path) -> None:
    """The first three joints of a research kit's arm as CRTK publishes them, with a push on the slide in the last."""
    folder = home / "raw" / "psm"
    folder.mkdir(parents=True)
    joints = ["outer_yaw", "outer_pitch", "outer_insertion"]
    size = np.array([1.0, 1.0, 0.15])
    for name, (seed, duration, period) in ROLES.items():
        t, q, dq, ddq = motion(seed, 3, duration, period, 0.3)
        q, dq, ddq = q * size + [0, 0, 0.12], dq * size, ddq * size
        gravity = np.column_stack(
            [3.0 * np.sin(q[:, 0]), 2.0 * np.sin(q[:, 1]) + np.cos(q[:, 1]), np.full(len(t), -1.5)]
        )
        tau = measured(gravity + [0.5, 0.5, 1.5] * ddq, dq, seed, np.array([0.5, 0.5, 2.0]))
        tau[:, 2] += push(t, 10.0, 6.0) * (name == "contact")
        states = zip(t, *sensed(q, dq), tau, strict=True)
        write(folder / f"{name}.bag", (joint_state(s, joints, *state) for s, *state in states))


LOGS: dict[str, Callable[[Path], None]] = {
    "start": demonstration,
    "labview": copies("raw/arm", roll_1="roll_excitation.tdms", roll_2="roll_contact.tdms"),
    "ur": urdf_arm,
    "dvrk-bag": bags,
    "weight": copies("raw/mass", slide_excitation="slide_excitation.tdms", slide_weight="slide_weight.tdms"),
    "tissue": copies("raw/soft", slide_excitation="slide_excitation.tdms", tissue="tissue_approach.tdms"),
}
