"""A study as a laboratory may record it: stops, gaps, uneven clocks, wrong statements, a sensor of one axis."""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from davinci_forces.maths.contact.weighing import unit_load
from davinci_forces.maths.simulation.surroundings import triangle
from davinci_forces.records import Signal
from davinci_forces.robots.davinci import CHAIN
from tests import arm

RATE = 100.0
SETTINGS = "[settings]\nlowpass = 11.0\ndelay = 0.15\n[settings.effort]\nhand_roll = 0.3\n"
WEIGHT = 'weight = { mass = 0.5, moves_with = "instrument_slide", position = [0.02, 0.01, -0.3] }'
STIFFNESS = 300.0  # [N/m]
MASS, PLACE = 0.6, (0.02, 0.01, -0.3)  # the mass hung on it is heavier than stated

BRISTLES = {"static_up": 0.5, "static_down": 0.4, "stribeck_velocity": 0.05, "bristle_stiffness": 900.0,
            "bristle_damping": 2.0}  # fmt: skip
FRICTION = {
    name: {"viscous": viscous, "coulomb_up": coulomb, "coulomb_down": coulomb, **BRISTLES}
    for name, (*_, viscous, coulomb) in arm.THETA.items()
}
TRUTH = {
    "friction": {"matched": FRICTION},
    "log": [{"name": "felt", "stiffness": STIFFNESS}, {"name": "roll", "family": "matched"}],
}


def write_study(folder: Path) -> Path:
    """Nine logs of three joints."""
    folder.mkdir(parents=True)
    arm.write_robot(folder)
    logs = [
        _stopped("roll"), _uneven("uneven"), _resting("slide"), _without_period("pitch"), _broken("check"),
        _pushed("push"), _sensed("sensed"), _hung("hung"), _felt("felt"),
    ]  # fmt: skip
    for name, signals, extra, _ in logs:
        arm.write_csv(folder / f"{name}.csv", signals, extra)
    tables = [SETTINGS, *(table for *_, table in logs)]
    (folder / "study.toml").write_text('title = "Faults"\nrobot = "arm.toml"\nsimulated = true\n' + "".join(tables))
    return folder


Log = tuple[str, Sequence[Signal], dict[str, np.ndarray], str]


def _at(signal: Signal, when: np.ndarray) -> Signal:
    """The signal with its samples in another order or number, on the same clock."""
    columns = {name: getattr(signal, name)[when] for name in ("q", "dq", "tau")}
    t = np.arange(len(when)) / signal.rate
    zeros = np.zeros(len(t), int)
    return replace(signal, t=t, segment=zeros, filled=zeros, **columns)


def _held(signal: Signal, start: float, seconds: float, seed: int) -> Signal:
    """The signal with a stop from a time on, in which only noise is left of its motion."""
    at, samples = round(start * signal.rate), round(seconds * signal.rate)
    held = _at(signal, np.r_[0:at, np.full(samples, min(at, len(signal) - 1)), at : len(signal)])
    stop = slice(at, at + samples)
    rng = np.random.default_rng(seed)
    q, dq = held.q.copy(), held.dq.copy()
    q[stop] += 1e-4 * rng.normal(size=samples)
    dq[stop] = 1e-3 * rng.normal(size=samples)
    return replace(held, q=q, dq=dq)


def _stopped(name: str) -> Log:
    """A stop before the motion, another after a gap of the clock, and a period that is stated wrongly."""
    roll = _held(_held(arm.signal("hand_roll", 1, 6, RATE, 2.0), 0.0, 1.5, 2), 13.5, 1.0, 2)
    paused = replace(roll, t=roll.t + np.where(roll.t >= 13.5, 0.8, 0.0))
    return name, [paused], {}, arm.log_table(name, f"{name}.csv", "identification", ["hand_roll"], "period = 2.02")


def _uneven(name: str) -> Log:
    """A clock that jitters, a position without a velocity, and an effort that is offset and late."""
    roll = arm.signal("hand_roll", 3, 5, RATE, 2.4)
    t = roll.t + 0.15 / RATE * np.random.default_rng(3).uniform(-1, 1, len(roll))
    late = replace(roll, t=t, tau=np.roll(roll.tau, 2) + 0.1)
    channels = arm.log_table(name, f"{name}.csv", "identification", ["hand_roll"])
    return name, [late], {}, channels.replace('"hand_roll.dq" = "hand_roll.dq"\n', "")


def _resting(name: str) -> Log:
    """A joint that moves, with a harmonic more than the analysis keeps, beside one that rests."""
    slide, pitch = arm.signal("instrument_slide", 4, 5, RATE, 2.0), arm.signal("hand_pitch", 4, 5, RATE, 2.0)
    w = 3 * 2 * np.pi  # the joint repeats every second
    slide = replace(slide, q=slide.q + 5e-4 * np.sin(w * slide.t), dq=slide.dq + 5e-4 * w * np.cos(w * slide.t))
    still = replace(pitch, q=np.full(len(pitch), 0.1), dq=np.zeros(len(pitch)))
    joints = ["instrument_slide", "hand_pitch"]
    return name, [slide, still], {}, arm.log_table(name, f"{name}.csv", "identification", joints)


def _without_period(name: str) -> Log:
    """A motion that never repeats: periods that become shorter."""
    parts = [arm.signal("hand_pitch", 5 + i, 1, RATE, period) for i, period in enumerate((4.0, 3.1, 2.3, 1.9))]
    columns = {n: np.concatenate([getattr(part, n) for part in parts]) for n in ("q", "dq", "tau")}
    zeros = np.zeros(len(columns["q"]), int)
    pitch = replace(parts[0], t=np.arange(len(zeros)) / RATE, segment=zeros, filled=zeros, **columns)
    return name, [pitch], {}, arm.log_table(name, f"{name}.csv", "identification", ["hand_pitch"])


def _broken(name: str) -> Log:
    """A stop, a gap, a slow stretch, a saturated drive, a velocity in a wrong unit and a controller that goes off."""
    roll = _held(arm.signal("hand_roll", 9, 5, RATE, 2.6), 5.0, 2.0, 9)
    kept = np.ones(len(roll), bool)
    kept[850:920] = False
    kept[1000:1200] = np.arange(200) % 5 == 0
    columns = {n: getattr(roll, n)[kept] for n in ("t", "q", "dq", "tau", "segment", "filled")}
    slow = np.convolve(columns["tau"], np.ones(9) / 9, "same")  # a drive that is saturated is so for a while
    limit = np.percentile(np.abs(slow), 97)
    tau = np.where(np.abs(slow) > limit, np.sign(slow) * 2 * limit, columns["tau"]) * (columns["t"] < roll.t[-40])
    columns |= {"tau": tau, "dq": 1.3 * columns["dq"]}
    return name, [replace(roll, **columns)], {}, arm.log_table(name, f"{name}.csv", "validation", ["hand_roll"])


def _pushed(name: str) -> Log:
    """Two contacts that the study does not state, one of them while the joint stands still, and free motion."""
    push = lambda t: triangle(t, 2.0, 4.0, 1.2) - triangle(t, 8.5, 9.5, 1.0)
    roll = _held(arm.signal("hand_roll", 10, 5, RATE, 2.6, external=push), 6.0, 1.5, 10)
    return name, [roll], {}, arm.log_table(name, f"{name}.csv", "contact", ["hand_roll"], "free = [[4.5, 5.5]]")


def _sensed(name: str) -> Log:
    """A push along the slide, as a sensor has it that only knows its size, and late."""
    push = lambda t: triangle(t, 3.0, 6.0, 9.0)
    slide = arm.signal("instrument_slide", 11, 5, RATE, 2.6, external=push)
    table = arm.log_table(name, f"{name}.csv", "contact", ["instrument_slide"], "contact = [[3.0, 6.0]]")
    return (
        name,
        [slide],
        {"force": push(slide.t - 0.04) + 0.05 * np.random.default_rng(11).normal(size=len(slide))},
        f'{table}force = "force"\n',
    )


def _hung(name: str) -> Log:
    """A mass on the slide, which loads three joints, without a tare; the current of one of them is measured."""
    joints = [joint.name for joint in arm.ARM.joints]
    free = [arm.signal(joint, 12 + i, 5, RATE, 3.0) for i, joint in enumerate(joints)]
    motion = np.stack([arm.excitation(joint, free[0].t, 3.0) for joint in joints], axis=-1)
    tau = MASS * unit_load(CHAIN, "6", PLACE, *motion)
    signals = [replace(s, tau=s.tau + tau[:, i]) for i, s in enumerate(free)]
    roll = arm.joint("hand_roll")
    current = signals[0].tau / (roll.gear_ratio * roll.torque_constant)
    table = arm.log_table(name, f"{name}.csv", "weight", joints, WEIGHT)
    return (
        name,
        signals,
        {"current": current},
        table.replace('"hand_roll.tau" = "hand_roll.tau"', '"hand_roll.i" = "current"'),
    )


def _felt(name: str) -> Log:
    """Tissue that the slide itself pushes into, at places that a tracker tells."""
    slide = arm.signal("instrument_slide", 16, 6, RATE, 2.5)
    depth = np.clip(slide.q - 0.03, 0.0, None)
    slide = replace(slide, tau=slide.tau + STIFFNESS * depth)
    places = {"tip_x": 0.02 * np.floor(slide.t / 2.5) % 3, "tip_y": 0.01 * np.floor(slide.t / 7.5), "tip_z": slide.q}
    table = arm.log_table(name, f"{name}.csv", "tissue", ["instrument_slide"])
    return name, [slide], places, table + "".join(f'{name} = "{name}"\n' for name in places)
