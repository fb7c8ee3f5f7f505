"""A study as data: what was recorded and how it is analysed, as study.toml gives it."""

import math
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from davinci_forces.haptics.scenario import HapticScenario as HapticScenario
from davinci_forces.logs.log import Options as Options
from davinci_forces.maths.constants import PUSH_DELAY
from davinci_forces.robots.robot import Joint, Robot

WHOLE_LOG = ((0.0, math.inf),)  # the windows of a log that is in contact throughout


@dataclass(frozen=True)
class Settings:
    """How a study is analysed.  Stages name the settings they use as keyword arguments."""

    lowpass: float = 17.0  # [Hz] zero-phase low-pass where velocities and accelerations are differences
    harmonics: int = 0  # of the position, to keep; 0: the robot's, and more where the motion has more
    fit: str = "chosen"  # the Fit that the filter runs with
    q_tau: float = 0.0  # random walk of the external effort [effort/s^0.5]; 0: the smallest that follows a push
    delay: float = PUSH_DELAY  # [s] by which the filter may show a push late, where q_tau is not stated
    effort: dict[str, float] = field(default_factory=dict)  # external effort to be detected on each joint [effort]


@dataclass(frozen=True)
class Source:
    """The channel that feeds one quantity of a log, and how its values become SI."""

    quantity: str  # "hand_roll.q", "time", ...
    channel: str | int
    measures: str
    unit: str | None = None
    sign: int = 1
    offset: float = 0.0
    scale: float = 1.0

    @property
    def joint(self) -> str:
        """The joint of the quantity, or "" for a quantity of the whole log."""
        return self.quantity.rpartition(".")[0]

    @property
    def symbol(self) -> str:
        """The quantity without its joint."""
        return self.quantity.rpartition(".")[2]


@dataclass(frozen=True)
class AttachedMass:
    """A mass attached to the arm, at a point fixed to a link.  Section 7.5

    `position` is in metres from the remote centre, in axes of the link that are the base's at q = 0; None is the tip.
    """

    moves_with: str  # a joint, for the link that turns about the remote centre with it, or a link; "" is the tip's
    position: tuple[float, float, float] | None
    mass: float | None = None  # [kg] where it is known


@dataclass(frozen=True)
class Weighing:
    """A weight log: its mass, and the log that is subtracted from it."""

    log: str
    weight: AttachedMass
    tare: str  # the log to be subtracted, or ""


@dataclass(frozen=True)
class Weighings:
    """All weight logs of a study that give the position of the mass."""

    each: tuple[Weighing, ...]


@dataclass(frozen=True)
class LogEntry:
    """One [[log]] of a study."""

    name: str
    files: tuple[str, ...]  # relative to the study
    role: str
    channels: tuple[Source, ...]
    join: bool = False  # True: files with different channels; False: consecutive parts
    period: float | None = None
    rate: float | None = None
    skip: float = 0.0
    until: float | None = None
    contact: tuple[tuple[float, float], ...] = ()  # [s] known windows; WHOLE where all samples are of contact
    free: tuple[tuple[float, float], ...] = ()
    weight: AttachedMass | None = None
    tare: str = ""  # the log of the same path that is subtracted from a weight log
    options: Options = field(default_factory=Options)  # how its files are read

    @property
    def has_known_free_motion(self) -> bool:
        """Whether the log has samples that are known to be free of contact."""
        return self.role in ("identification", "validation") or (self.role == "contact" and self.possible_contact != ())

    @property
    def possible_contact(self) -> tuple[tuple[float, float], ...]:
        """The windows [s] of contact; where a contact log states free windows, the time between these."""
        if self.role != "contact" or not self.free:
            return self.contact
        edges = (-math.inf, *(edge for window in sorted(self.free) for edge in window), math.inf)
        return tuple(zip(edges[::2], edges[1::2], strict=True))

    @property
    def joints(self) -> tuple[str, ...]:
        """The joints that the log has channels of, in the order of the file."""
        return tuple(dict.fromkeys(source.joint for source in self.channels if source.joint))

    @property
    def needs_clock(self) -> bool:
        """Whether its analysis needs times; pushes of depth and force do not."""
        return self.role != "tissue" or bool(self.joints)


@dataclass(frozen=True)
class Study:
    """A study, validated."""

    folder: Path
    title: str
    robot: Robot
    simulated: bool
    settings: Settings
    logs: tuple[LogEntry, ...]
    changed: dict[str, Any] = field(default_factory=dict)  # properties of the robot that the study changes
    truth: dict[str, Any] = field(default_factory=dict)  # ground truth of a simulated study: its truth.toml
    haptics: HapticScenario = field(default_factory=HapticScenario)  # the simulated hand that feels the tissue
    haptics_file: str = ""  # that describes them, in the study's folder
    baseline: str = ""  # the results.json in the study's folder that the report is compared with, if there is one
    lines: dict[str, int] = field(default_factory=dict, compare=False)  # of study.toml, by the file of a log they name
    remarks: tuple[str, ...] = field(default=(), compare=False)  # warnings for the author, each with its line

    @property
    def name(self) -> str:
        """The folder's name."""
        return self.folder.resolve().name

    @property
    def joints_by_current(self) -> tuple[Joint, ...]:
        """The joints whose motor currents become efforts by gear ratio and torque constant."""
        measured = {source.joint for entry in self.logs for source in entry.channels if source.symbol == "i"}
        return tuple(joint for joint in self.robot.joints if joint.name in measured and not joint.effort)

    def log(self, name: str) -> LogEntry:
        """The log of that name."""
        return next(entry for entry in self.logs if entry.name == name)

    @property
    def weighings(self) -> Weighings:
        """The weight logs."""
        each = (Weighing(e.name, e.weight, e.tare) for e in self.logs if e.weight and e.role == "weight")
        return Weighings(tuple(each))

    @property
    def files(self) -> int:
        """The number of files of its logs."""
        return sum(len(entry.files) for entry in self.logs)

    def absent(self) -> tuple[str, ...]:
        """Files of logs that do not exist."""
        return tuple(file for entry in self.logs for file in entry.files if not (self.folder / file).exists())
