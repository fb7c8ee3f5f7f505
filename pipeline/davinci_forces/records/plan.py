"""Records of a robot that need no logs: its chain, its controllers, and its excitation."""

from collections.abc import Iterator

from davinci_forces.records.record import Column, Counts, JointRecord, Labels, Published, Record, RobotRecord


class Links(RobotRecord):
    """The links of a robot: Denavit-Hartenberg parameters and masses.  Tables 3.1 and 4.2"""

    UNKNOWN = ("alpha", "a", "d", "offset", "mass")  # NaN for a link without these parameters
    ROWS = "link"
    PUBLISHED = ("robot: worst_condition", "robot.link.{name}: alpha a d offset mass")

    worst_condition: float  # largest condition number of the tip's Jacobian in the workspace
    link: Labels
    parent: Labels
    alpha: Column
    a: Column
    d: Column
    offset: Column
    moved_by: Counts  # number of the coordinate, from 1; 0 for a link that no coordinate moves
    mass: Column


class Pose(RobotRecord):
    """The positions of the frames of a robot's chain in one configuration."""

    KEY = ("robot", "pose")

    pose: str
    link: Labels
    parent: Labels
    x: Column
    y: Column
    z: Column


class Workspace(RobotRecord):
    """Reachable positions of the tip within the limits, with the condition number of its Jacobian."""

    x: Column
    y: Column
    z: Column
    condition: Column


class Control(Record):
    """The motion of one joint in a simulated control study of chapter 5."""

    KEY = ("controller", "joint")
    PUBLISHED = ("control.{controller}.{joint}: start reference settling_time overshoot error_10 error_20 error_end",)

    controller: str
    joint: str
    start: float  # initial position [rad or m]
    reference: float  # desired position [rad or m]
    settling_time: float  # NaN if the joint does not settle, or its reference has no step
    overshoot: float
    error_10: float  # position error after 10 s
    error_20: float
    error_end: float
    t: Column
    q: Column
    dq: Column


class Lyapunov(Record):
    """The Lyapunov function over time in a simulated control study.  (5.9)"""

    KEY = ("controller",)
    PUBLISHED = ("control.{controller}: V_rise V_0",)

    controller: str
    V_rise: float
    V_0: float
    t: Column
    V: Column


class Excitation(JointRecord):
    """One period of an excitation trajectory, of the thesis or designed, its criteria and its excess over limits."""

    KEY = ("joint", "source")
    PUBLISHED = ("excitation.{joint}.{source}: period objective condition excess_q excess_dq excess_ddq",)

    source: str
    period: float
    objective: float  # -log10 det(F'F), the criterion "determinant"
    condition: float  # condition number of the regressor F, not its logarithm
    coefficients: tuple[float, ...]
    excess_q: float  # [rad or m] beyond the limits of position; 0 within them; so for dq and ddq
    excess_dq: float
    excess_ddq: float
    t: Column
    q: Column
    dq: Column
    ddq: Column

    def published(self) -> Iterator[Published]:
        """The criteria, the excess over limits, and the coefficients under the names of Table 6.1."""
        yield from super().published()
        for i in range(len(self.coefficients)):
            letter = "a" if i == 0 or i % 2 else "b"
            yield Published(f"excitation.{self.joint}.{self.source}.{letter}{(i + 1) // 2}", "coefficients", row=i)
