"""Records of what is known of a robot before anything is recorded: geometry, control studies, excitation."""

from dataclasses import dataclass

from pipeline.records.record import Column, Counts, Labels, Record


@dataclass(frozen=True, eq=False)
class Links(Record):
    """The links of a robot: Denavit-Hartenberg parameters and masses.  Tables 3.1 and 4.2"""

    KEY = ("robot",)

    robot: str
    worst_condition: float
    link: Labels
    parent: Labels
    alpha: Column
    a: Column
    d: Column
    offset: Column
    moved_by: Counts
    mass: Column


@dataclass(frozen=True, eq=False)
class Pose(Record):
    """Where the frames of a robot's chain are at one configuration."""

    KEY = ("robot", "pose")

    robot: str
    pose: str
    link: Labels
    parent: Labels
    x: Column
    y: Column
    z: Column


@dataclass(frozen=True, eq=False)
class Workspace(Record):
    """Places that the tip can reach within the limits, and how well efforts tell the force there."""

    KEY = ("robot",)

    robot: str
    x: Column
    y: Column
    z: Column
    condition: Column


@dataclass(frozen=True, eq=False)
class Control(Record):
    """One joint in a simulated control study of chapter 5."""

    KEY = ("controller", "joint")

    controller: str
    joint: str
    start: float
    reference: float
    error_10: float
    error_20: float
    error_end: float
    t: Column
    q: Column
    dq: Column


@dataclass(frozen=True, eq=False)
class Lyapunov(Record):
    """The Lyapunov function along a simulated control study.  (5.9)"""

    KEY = ("controller",)

    controller: str
    V_rise: float
    t: Column
    V: Column


@dataclass(frozen=True, eq=False)
class Excitation(Record):
    """One period of an excitation trajectory, published or designed, with what it is worth and what it exceeds."""

    KEY = ("joint", "source")

    joint: str
    source: str
    period: float
    objective: float
    condition: float
    coefficients: tuple[float, ...]
    excess_q: float
    excess_dq: float
    excess_ddq: float
    t: Column
    q: Column
    dq: Column
    ddq: Column
