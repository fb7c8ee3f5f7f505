"""Sensor signals of a motion: motor angles, motor speeds and currents, quantised and with noise.

The files are TDMS and LVM as LabVIEW writes them; their headers say that the data are simulated.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from io import StringIO
from pathlib import Path

import numpy as np
from nptdms import ChannelObject, GroupObject, RootObject, TdmsWriter
from scipy.signal import lfilter

from davinci_forces.maths.arrays import Array
from davinci_forces.simulation.motion import SimulatedMotion
from davinci_forces.simulation.scenario import ForceSensor, SensorNoise, SimulatedJoint

GROUP = "Motors"
DESCRIPTION = "SIMULATED data, not a recording of a robot"


@dataclass(frozen=True)
class SimulatedChannel:
    """One recorded channel, and the quantity of the study that it provides."""

    quantity: str  # "time", "hand_roll.i", ...
    name: str
    unit: str
    samples: Array


def record(
    simulated: SimulatedJoint, motion: SimulatedMotion, noise: SensorNoise, rate: float, current_unit: str,
    random: np.random.Generator,
) -> list[SimulatedChannel]:  # fmt: skip
    """Record the motor angle (6.28), the motor speed and the motor current (6.29) of one joint."""
    joint, N = simulated.joint, len(motion.q)
    angle, speed = (true + random.normal(0.0, sigma, N) for true, sigma in ((motion.q, noise.q), (motion.dq, noise.dq)))
    effort = motion.tau + random.normal(0.0, noise.tau, N) + drift(noise, rate, N, random)
    current = quantise(effort / joint.effort_per_ampere, simulated.current_step)
    scale = 1e3 if current_unit == "mA" else 1.0
    return [
        SimulatedChannel(f"{joint.name}.theta_m", f"{simulated.label} motor angle", "rad",
                quantise(joint.gear_ratio * angle, simulated.encoder_step)),
        SimulatedChannel(f"{joint.name}.dtheta_m", f"{simulated.label} motor speed", "rad/s", joint.gear_ratio * speed),
        SimulatedChannel(f"{joint.name}.i", f"{simulated.label} current", current_unit, scale * current),
    ]  # fmt: skip


def record_force(sensor: ForceSensor, t: Array, force: Array, random: np.random.Generator) -> list[SimulatedChannel]:
    """Record the force (N, 3) of the tip at the times t (N,), base axes, with the delay and the noise of the sensor."""
    delayed = np.stack([np.interp(t - sensor.lag, t, component) for component in force.T], axis=-1)
    measured = delayed + random.normal(0.0, sensor.noise, force.shape)
    return [SimulatedChannel(f"force_{a}", f"Force {a}", "N", measured[:, i].copy()) for i, a in enumerate("xyz")]


def generator(seed: int, log: str, joint: str) -> np.random.Generator:
    """The random generator for the noise of one joint in one log; its noise does not depend on other logs."""
    return np.random.default_rng([seed, *f"{log}/{joint}".encode()])


def quantise(values: Array, step: float) -> Array:
    """Round values to whole steps of a converter; a step of 0 leaves them unchanged."""
    return step * np.round(values / step) if step else values


def drift(noise: SensorNoise, rate: float, samples: int, random: np.random.Generator) -> Array:
    """Draw coloured noise (N,): a first-order autoregressive process, stationary from its first sample."""
    pole = np.exp(-1 / (rate * noise.correlation))
    steps = random.normal(0.0, noise.drift * np.sqrt(1 - pole**2), samples)
    return np.asarray(lfilter([1.0], [1.0, -pole], steps, zi=[pole * random.normal(0.0, noise.drift)])[0])


def write(path: Path, channels: Sequence[SimulatedChannel], rate: float, started: str) -> None:
    """Write the channels in the format of the suffix; without `time` at first, the header states the sampling time."""
    {".tdms": tdms, ".lvm": lvm}[path.suffix](path, channels, rate, started)


def channel_name(path: Path, channel: SimulatedChannel) -> str:
    """The name by which a study refers to a channel of the file."""
    if path.suffix == ".tdms":
        return f"{GROUP}/{channel.name}"
    return "X_Value" if channel.quantity == "time" else channel.name


def tdms(path: Path, channels: Sequence[SimulatedChannel], rate: float, started: str) -> None:
    """Write a TDMS file of one group."""
    step = {} if channels[0].quantity == "time" else {"wf_start_offset": 0.0, "wf_increment": 1 / rate}
    root = RootObject({"name": path.stem, "description": DESCRIPTION, "started": started})
    objects = [
        ChannelObject(GROUP, c.name, np.ascontiguousarray(c.samples), {"unit_string": c.unit, **step}) for c in channels
    ]
    with TdmsWriter(str(path)) as writer:
        writer.write_segment([root, GroupObject(GROUP), *objects])


def lvm(path: Path, channels: Sequence[SimulatedChannel], rate: float, started: str) -> None:
    """Write an LVM file of one file segment, as the express block "Write To Measurement File" does."""
    timed = channels[0].quantity == "time"
    columns = channels[1:] if timed else channels
    names = ["X_Value", *(c.name for c in columns), "Comment"]
    x = channels[0].samples[:, None] if timed else np.empty((len(columns[0].samples), 0))
    text = StringIO()
    np.savetxt(text, np.column_stack([x, *(c.samples for c in columns)]), "%.6f", delimiter="\t", newline="\r\n")
    rows = text.getvalue() if timed else "".join(f"\t{row}" for row in text.getvalue().splitlines(keepends=True))
    date, _, time = started.replace("-", "/").partition("T")
    of_file = {
        "Writer_Version": "2", "Reader_Version": "2", "Separator": "Tab", "Decimal_Separator": ".",
        "Multi_Headings": "No", "X_Columns": "One" if timed else "No", "Time_Pref": "Relative",
        "Operator": "simulation", "Description": DESCRIPTION, "Date": date, "Time": f"{time}.000000",
        "***End_of_Header***": "",
    }  # fmt: skip
    of_segment = {
        "Samples": str(len(columns[0].samples)), "Date": date, "Time": f"{time}.000000", "Y_Unit_Label": "",
        "X_Dimension": "Time", "X0": "0.0000000000000000E+0", "Delta_X": f"{1 / rate:.6f}", "***End_of_Header***": "",
    }  # fmt: skip
    lines = ["LabVIEW Measurement\t", *(f"{key}\t{value}" for key, value in of_file.items()), "\t"]
    lines.append(f"Channels\t{len(columns)}" + "\t" * len(columns))
    for key, value in of_segment.items():
        cells = [c.unit for c in columns] if key == "Y_Unit_Label" else [value] * len(columns)
        lines.append("\t".join([key, *cells, ""]))
    path.write_bytes(("\r\n".join([*lines, "\t".join(names)]) + "\r\n" + rows).encode())
