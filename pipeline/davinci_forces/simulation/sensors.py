"""What the sensors record of a motion: motor angles, motor speeds and currents, in steps and with noise."""

from dataclasses import dataclass

import numpy as np
from scipy.signal import lfilter

from davinci_forces.maths.arrays import Array
from davinci_forces.simulation.motion import SimulatedMotion
from davinci_forces.simulation.scenario.scenario import ForceSensor, SensorNoise, SimulatedJoint


@dataclass(frozen=True)
class SimulatedChannel:
    """One recorded channel, and the quantity of the study that it feeds."""

    quantity: str  # "time", "hand_roll.i", ...
    name: str
    unit: str
    samples: Array


def record(
    simulated: SimulatedJoint,
    motion: SimulatedMotion,
    noise: SensorNoise,
    rate: float,
    current_unit: str,
    random: np.random.Generator,
) -> list[SimulatedChannel]:
    """The motor angle (6.28), the motor speed and the motor current (6.29) of one joint."""
    joint, N = simulated.joint, len(motion.q)
    angle, speed = (true + random.normal(0.0, sigma, N) for true, sigma in ((motion.q, noise.q), (motion.dq, noise.dq)))
    effort = motion.tau + random.normal(0.0, noise.tau, N) + drift(noise, rate, N, random)
    current = stepped(effort / (joint.gear_ratio * joint.torque_constant), simulated.current_step)
    size = 1e3 if current_unit == "mA" else 1.0
    return [
        SimulatedChannel(f"{joint.name}.theta_m", f"{simulated.label} motor angle", "rad",
                stepped(joint.gear_ratio * angle, simulated.encoder_step)),
        SimulatedChannel(f"{joint.name}.dtheta_m", f"{simulated.label} motor speed", "rad/s", joint.gear_ratio * speed),
        SimulatedChannel(f"{joint.name}.i", f"{simulated.label} current", current_unit, size * current),
    ]  # fmt: skip


def record_force(sensor: ForceSensor, t: Array, force: Array, random: np.random.Generator) -> list[SimulatedChannel]:
    """What a sensor shows of the force (N, 3) of the tip at the times t (N,), base axes: late, and with noise."""
    late = np.stack([np.interp(t - sensor.lag, t, along) for along in force.T], axis=-1)
    shown = late + random.normal(0.0, sensor.noise, force.shape)
    return [SimulatedChannel(f"force_{a}", f"Force {a}", "N", shown[:, i].copy()) for i, a in enumerate("xyz")]


def generator(seed: int, log: str, joint: str) -> np.random.Generator:
    """The source of the noise of one joint in one log; it depends on nothing else, so logs may come and go."""
    return np.random.default_rng([seed, *f"{log}/{joint}".encode()])


def stepped(values: Array, step: float) -> Array:
    """Values as a converter gives them: whole numbers of its step.  A step of 0 leaves them as they are."""
    return step * np.round(values / step) if step else values


def drift(noise: SensorNoise, rate: float, samples: int, random: np.random.Generator) -> Array:
    """Coloured noise (N,): a first-order autoregressive process, stationary from its first sample."""
    pole = np.exp(-1 / (rate * noise.correlation))
    steps = random.normal(0.0, noise.drift * np.sqrt(1 - pole**2), samples)
    first = [pole * random.normal(0.0, noise.drift)]
    return np.asarray(lfilter([1.0], [1.0, -pole], steps, zi=first)[0])
