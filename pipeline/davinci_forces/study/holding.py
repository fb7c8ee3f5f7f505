"""What the channels of a log hold, as `new` guesses it."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace

from davinci_forces.maths.contact.unexplained import Course
from davinci_forces.robots.robot import Robot
from davinci_forces.study.timing import TimeGuess

BY_NUMBER = "by the number in its name"
BY_FILE = "by the joint in its file's name"
POSITIONS, VELOCITIES, EFFORTS = ("q", "theta_m"), ("dq", "dtheta_m"), ("tau", "i")
SYMBOLS = (*POSITIONS, *VELOCITIES, *EFFORTS)


@dataclass(frozen=True)
class Meaning:
    """What one channel holds: a symbol of a joint, counted from 0, the reason, and the unit usual with its recorder."""

    symbol: str
    joint: int
    reason: str
    unit: str = ""


@dataclass(frozen=True)
class Holding:
    """What the channels of a log hold, by name, and how its joints move."""

    meanings: dict[str, Meaning] = field(default_factory=dict)
    joints: int = 0
    labels: tuple[str, ...] = ()  # of the joints, where names have words for them
    robot: Robot | None = None  # whose joints the names name
    timing: TimeGuess = field(default_factory=TimeGuess)
    moving: tuple[int, ...] = ()  # joints, counted from 0
    repeating: float = 0.0  # [s] of the motion in whole periods; 0 if most of it does not repeat
    steady: bool = False
    ranges: dict[int, tuple[float, float]] = field(default_factory=dict)  # of the positions, by joint
    units: dict[str, str] = field(default_factory=dict)  # that the log states, by name
    courses: dict[int, Course] = field(default_factory=dict, compare=False)  # of the moving joints

    def joints_with(self, symbols: Sequence[str] = SYMBOLS) -> set[int]:
        """The joints that have a channel of one of these symbols."""
        return {meaning.joint for meaning in self.meanings.values() if meaning.symbol in symbols}

    def with_joints(self, joints: Sequence[int]) -> "Holding":
        """The same with other numbers of the joints: `joints[k]` instead of k."""
        return replace(
            self, joints=max(joints) + 1,
            meanings={name: replace(m, joint=joints[m.joint]) for name, m in self.meanings.items()},
            moving=tuple(sorted(joints[k] for k in self.moving)),
            ranges={joints[k]: span for k, span in self.ranges.items()},
            courses={joints[k]: course for k, course in self.courses.items()},
        )  # fmt: skip

    def to_check(self, what: str = "") -> "Holding":
        """The same with each channel to be checked, and what of it."""
        mark = f"CHECK: {what}; " if what else "CHECK: "
        return self.with_reasons(lambda reason: mark + reason.removeprefix("CHECK: "))

    def with_reasons(self, reason_of: Callable[[str], str]) -> "Holding":
        """The same with other reasons."""
        meanings = {name: replace(m, reason=reason_of(m.reason)) for name, m in self.meanings.items()}
        return replace(self, meanings=meanings)

    @property
    def has_named_joints(self) -> bool:
        """Whether names tell the joints."""
        by_name = {meaning.reason for meaning in self.meanings.values()} & {BY_FILE, BY_NUMBER}
        return self.robot is not None or any(self.labels) or bool(by_name)

    @property
    def is_complete(self) -> bool:
        """Whether a joint has a position and an effort."""
        return bool(self.joints_with(POSITIONS) & self.joints_with(EFFORTS))
