"""Scenarios: the robot, the motions, the contacts and the sensors of a simulated study."""

from dataclasses import dataclass, field

import numpy as np

from davinci_forces.errors import PipelineError
from davinci_forces.maths.arrays import Array
from davinci_forces.maths.excitation.fourier import Fourier, motion
from davinci_forces.maths.simulation.actuators import Cascade, Motors, Regulator
from davinci_forces.maths.simulation.step import Friction
from davinci_forces.maths.simulation.surroundings import SHAPES, Path
from davinci_forces.robots.robot import Joint, Robot


class BadScenario(PipelineError):
    """A scenario is invalid; the message lists every problem with its place."""


@dataclass(frozen=True)
class SensorNoise:
    """Standard deviations of white noise, in the joint's units, and of a slow drift of the effort."""

    q: float = 0.0
    dq: float = 0.0
    tau: float = 0.0
    drift: float = 0.0  # standard deviation of the drift of the effort
    correlation: float = 1.0  # [s] correlation time of the drift


@dataclass(frozen=True)
class ForceSensor:
    """A sensor of the force at the tip: the standard deviation of its noise [N], and its delay [s]."""

    noise: float
    lag: float


@dataclass(frozen=True)
class SimulatedPush:
    """An effort, or a force of the tip, that the robot exerts on its surroundings from start to end [s].  (7.8)"""

    shape: str  # a key of SHAPES
    start: float
    end: float
    peak: float  # [effort], or [N]
    direction: tuple[float, float, float] | None = None  # direction of a force of the tip, base frame, of length 1

    def effort_at(self, t: Array) -> Array:
        """The push at the times t (N,) [s]."""
        return np.asarray(SHAPES[self.shape](t, self.start, self.end, self.peak))


@dataclass(frozen=True)
class Tissue:
    """A spring with a damper; its surface is at the height of the tip when the slide is at `surface`.  (8.1)"""

    surface: float  # [m] position of the slide
    stiffness: float  # [N/m]
    damping: float  # [N s/m]


@dataclass(frozen=True)
class SimulatedJoint:
    """A joint with its true parameters, and the resolution and noise of its sensors."""

    joint: Joint
    label: str  # the joint's name in the laboratory's channels
    encoder_step: float  # [rad] at the motor
    current_step: float  # [A]
    stops: tuple[float, float]  # lower and upper end stop
    noise: SensorNoise = field(default_factory=SensorNoise)
    theta: tuple[float, ...] = ()  # parameters of the joint's terms, if the joint follows its model exactly


@dataclass(frozen=True)
class Family:
    """One behaviour of the arm: its friction, and its noise by joint."""

    friction: Friction
    noise: dict[str, SensorNoise]


@dataclass(frozen=True)
class SimulatedArm:
    """The motors and controllers of the arm in closed loop."""

    tick: float  # [s] period of the motor drivers
    rotors: Array  # J_m (n,) [kg m^2]
    motors: Motors
    control: Cascade | Regulator
    families: dict[str, Family]


@dataclass(frozen=True)
class SimulatedLog:
    """One recording: motions of moving joints, positions of resting joints, and all contacts."""

    name: str
    file: str
    role: str
    duration: float  # [s]
    moves: dict[str, Fourier | Path]
    held: dict[str, float]
    external: dict[str, tuple[SimulatedPush, ...]]
    current_unit: str
    clock: str  # "channel", or "header" if the header of the file states the sampling time
    family: str = ""
    lead: float = 0.0  # [s] of motion before the recording starts
    skip: float = 0.0  # [s] initial time that the study omits
    tip: tuple[SimulatedPush, ...] = ()
    mass: float = 0.0  # [kg] mass attached to the tip
    tissue: Tissue | None = None
    sensor: ForceSensor | None = None  # sensor of the force at the tip

    @property
    def joints(self) -> tuple[str, ...]:
        """The recorded joints."""
        return (*self.moves, *self.held)

    @property
    def windows(self) -> list[tuple[float, float]]:
        """The time windows of all pushes [s], in order."""
        pushes = [push for joint_pushes in self.external.values() for push in joint_pushes]
        return sorted({(push.start, push.end) for push in [*pushes, *self.tip]})

    def position(self, joint: str, t: Array) -> Array:
        """The reference position of a joint at the times t (N,) [s]; zero for joints that are not recorded."""
        move = self.moves.get(joint)
        if move is None:
            return np.full_like(t, self.held.get(joint, 0.0))
        return move.position(t) if isinstance(move, Path) else motion(move, t)[0]


@dataclass(frozen=True)
class Scenario:
    """A simulated study, either of joints that follow their models exactly or of the whole arm in closed loop."""

    name: str
    title: str
    robot: Robot
    seed: int
    rate: float  # [Hz] of the controller and the recorder
    started: str  # date and time of the recordings, ISO 8601
    joints: dict[str, SimulatedJoint]
    logs: tuple[SimulatedLog, ...]
    arm: SimulatedArm | None = None
    clock_jitter: float = 0.0  # [s] standard deviation of the instants of the samples
    harmonics: int = 0  # of the excitation, for the settings of the study; 0 takes the robot's
