"""Scenarios of haptic feedback: hand, device, link, arm, filter, tissue and plan, read from a TOML file.

The defaults are the experiment of section 8.4; body, noise and tissue may come from a study instead.
"""

import math
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from typing import NamedTuple

import numpy as np

from davinci_forces import toml
from davinci_forces.errors import PipelineError
from davinci_forces.haptics.maths.bimodal import THESIS_HAND, THESIS_TISSUE, Hand
from davinci_forces.maths.constants import PUSH_DELAY
from davinci_forces.maths.simulation.actuators import Cascade, Device, Motors
from davinci_forces.robots.from_toml import NAME
from davinci_forces.toml import TomlTable

MAX_TICKS = 2_000_000  # ticks of one simulation
MAX_DELAY = 5.0  # [s] largest delay of positions or forces on the link

Pair = tuple[float, float]


class BadHaptics(PipelineError):
    """A haptic scenario is invalid; the message lists every problem with its place."""


class Body(NamedTuple):
    """The sliding body and its friction."""

    inertia: float  # [kg]
    gravity: float  # [N] effort that holds its weight
    viscous: float  # [N s/m]
    coulomb: Pair  # [N] upwards, downwards
    static: Pair
    stribeck_velocity: float = 0.01  # [m/s]
    bristle_stiffness: float = 0.0  # [N/m]; 0 for none
    bristle_damping: float = 0.0  # [N s/m]


class AxisNoise(NamedTuple):
    """Standard deviations of the measurement noise."""

    q: float  # [m]
    dq: float  # [m/s]
    tau: float  # [N]


# The default is the instrument slide of the demonstration study: the links of Tables 4.1 and 4.2 with the friction and
# the noise of Table 6.6.
SLIDE = Body(2.0036, -2.04048, 3.2723, (3.984, 3.984), (3.984, 3.984))
SLIDE_NOISE = AxisNoise(5e-7, 5e-4, 1.3454)
MOTOR = Motors(*(np.array([x]) for x in (1340.0, 0.0438, 2.0, 3e-4, 5.0, 48.0, 9.587379924285257e-5)))
LAW = Cascade(*(np.array([x]) for x in (30.0, 7.5, 0.0160, 4.02, 0.6, 2000.0, 4e-4)))
DEVICE = Device(motion=1.0, force=1.0, strongest=math.inf, step=0.0)
FIRM = Hand(1.0, 40.0, 500.0)  # a tensed arm
# Section 8.4: fast in and out for 8 s, fast away from the tissue until 15 s, then slowly in.
PLAN = (
    (0.0, -0.04), (1.0, 0.03), (2.0, -0.04), (3.0, 0.035), (4.0, -0.04), (5.0, 0.025), (6.0, -0.04), (7.0, 0.03),
    (8.0, -0.09), (8.7, -0.01), (9.4, -0.09), (10.1, -0.01), (10.8, -0.09), (11.5, -0.01), (12.2, -0.09),
    (12.9, -0.01), (13.6, -0.09), (15.0, -0.04), (22.0, 0.04), (29.0, -0.04), (30.0, -0.04),
)  # fmt: skip


@dataclass(frozen=True)
class HapticScenario:
    """A simulated experiment; a study replaces the fields that are None."""

    title: str = "Section 8.4: in and out of tissue"
    seed: int = 8
    hands: tuple[tuple[str, Hand], ...] = (("relaxed", THESIS_HAND), ("firm", FIRM))
    device: Device = DEVICE
    reach: float = 0.15  # [m] reach of the device on either side of the tissue's surface
    link_rate: float = 100.0  # [Hz] rate of messages, chapter 9
    position_delay: float = 0.0  # [s] delay on the link, in addition to the wait for a message
    force_delay: float = 0.0  # [s] likewise
    tick: float = 5e-4  # [s] period of the motor drivers
    rate: float = 100.0  # [Hz] rate of controller, sensors and filter
    exact: bool = False  # whether the arm follows its reference without error
    motor: Motors = MOTOR
    law: Cascade = LAW
    stops: tuple[float, float] = (-0.13, 0.09)  # [m] from the tissue's surface
    body: Body | None = None
    noise: AxisNoise | None = None
    assumed_body: Body | None = None  # body that the filter assumes
    filtered: bool = True  # whether the extended Kalman filter estimates the force; else the true force is sent
    q_tau: float = 0.0  # random walk of the external effort [N/s^0.5]; 0 selects the slowest that shows a push
    filter_delay: float = PUSH_DELAY  # [s] by which the filter may show a push late, from the settings of a study
    stiffness: float | None = None  # [N/m]
    damping: float = 5.0  # [N s/m]
    friction: float = 0.05  # friction force along the tool over pressing force
    plan: tuple[tuple[float, float], ...] = PLAN  # path without felt force: [s], [m] from the surface

    @property
    def duration(self) -> float:
        """The duration of the plan [s]."""
        return self.plan[-1][0] - self.plan[0][0]


@dataclass(frozen=True)
class FullScenario(HapticScenario):
    """A scenario without open fields, as it is simulated."""

    body: Body = SLIDE
    noise: AxisNoise = SLIDE_NOISE
    assumed_body: Body = SLIDE
    stiffness: float = THESIS_TISSUE


def read(file: Path) -> HapticScenario:
    """Read a scenario.

    Raises BadHaptics if the file has problems; the message lists each with its line.
    """
    table = toml.read(file, BadHaptics)
    scenario = scenario_of(table)
    table.file.refuse(BadHaptics)
    return scenario


def scenario_of(table: TomlTable) -> HapticScenario:
    """Build the scenario of a file, with problems noted."""
    default = HapticScenario()
    link, arm, tissue = table.table("link"), table.table("arm"), table.table("tissue")
    device, loop_filter = table.table("device"), table.table("filter")
    scenario = HapticScenario(
        title=table.text("title", default.title),
        seed=table.whole("seed", default.seed),
        hands=_hands(table) or default.hands,
        device=Device(
            device.number("motion_scale", DEVICE.motion, above=0.0),
            device.number("force_scale", DEVICE.force, low=0.0),
            device.number("strongest", above=0.0) if "strongest" in device else DEVICE.strongest,
            device.number("position_step", DEVICE.step, low=0.0),
        ),
        reach=device.number("reach", default.reach, above=0.0),
        link_rate=link.number("rate", default.link_rate, above=0.0),
        position_delay=_delay(link, "position_delay"),
        force_delay=_delay(link, "force_delay"),
        tick=arm.number("tick", default.tick, above=0.0),
        rate=arm.number("rate", default.rate, above=0.0),
        exact=arm.text("follows", "cascade", ("cascade", "exactly")) == "exactly",
        motor=Motors(*_joint_arrays(arm.table("motor"), default.motor)),
        law=Cascade(*_joint_arrays(arm.table("control"), default.law)),
        stops=read_stops(arm, default.stops),
        body=_body(arm.table("body")) if "body" in arm else None,
        noise=_noise(arm.table("noise")) if "noise" in arm else None,
        assumed_body=_body(loop_filter.table("body")) if "body" in loop_filter else None,
        filtered=loop_filter.text("use", "ekf", ("ekf", "none")) == "ekf",
        q_tau=loop_filter.number("q_tau", default.q_tau, low=0.0),
        stiffness=tissue.number("stiffness", above=0.0) if "stiffness" in tissue else None,
        damping=tissue.number("damping", default.damping, low=0.0),
        friction=tissue.number("friction", default.friction, low=0.0),
        plan=_plan(table),
    )
    if scenario.friction >= 1.0:
        tissue.problem(f"friction must be below 1, not {scenario.friction:g}, because tissue never pulls", "friction")
    table.close_all()
    _check_clocks(link, arm, scenario)
    if scenario.exact and scenario.filtered:
        message = 'an arm that follows exactly has no effort to estimate a force from; write use = "none" in [filter]'
        arm.problem(message, "follows")
    return scenario


def _hands(table: TomlTable) -> tuple[tuple[str, Hand], ...]:
    hands = []
    for entry in table.tables("hand"):
        name = entry.text("name")
        if not NAME.fullmatch(name):
            entry.problem(f"name must match [a-z0-9_-]+, not {name!r}", "name")
        values = (entry.number(key, above=0.0) for key in ("mass", "damping", "stiffness"))
        hands.append((name, Hand(*values)))
    table.unique("hand", "name", enumerate(name for name, _ in hands), "two hands have the name")
    return tuple(hands)


def _delay(table: TomlTable, key: str) -> float:
    delay = table.number(key, 0.0, low=0.0)
    if delay > MAX_DELAY:
        table.problem(f"{key} must be at most {MAX_DELAY:g} s, not {delay:g}; it is in seconds", key)
    return delay


def _joint_arrays(table: TomlTable, default: Motors | Cascade) -> list[np.ndarray]:
    """Read the numbers of one joint; numbers of a motor must be positive, except the encoder step."""
    positive = isinstance(default, Motors)
    least = {key: 0.0 if positive and key != "encoder_step" else -math.inf for key in default._fields}
    defaults = default._asdict().items()
    return [np.array([table.number(key, float(x[0]), low=0.0, above=least[key])]) for key, x in defaults]


def read_stops(table: TomlTable, default: tuple[float, float]) -> tuple[float, float]:
    """Read the lower and upper end stop of a joint."""
    low, high = table.numbers("stops", list(default), count=2) or default
    if low >= high:
        table.problem(f"stops must be lower and upper, not {low:g} and {high:g}", "stops")
    return low, high


def _body(table: TomlTable) -> Body:
    return Body(table.number("inertia", above=0.0), table.number("gravity", 0.0), *read_friction(table))


def read_friction(table: TomlTable) -> tuple[float, Pair, Pair, float, float, float]:
    """Read the friction of a joint: the fields of `Body` from `viscous` on."""
    coulomb = table.numbers("coulomb", count=2) or (1.0, 1.0)
    static = table.numbers("static", list(coulomb), count=2) or coulomb
    for key, values in (("coulomb", coulomb), ("static", static)):
        if min(values) < 0.0:
            table.problem(f"{key} must be two numbers that are not negative, up and down, but is {list(values)}", key)
    bristles = table.number("bristle_stiffness", 0.0, low=0.0)
    if bristles > 0.0 and min(coulomb) <= 0.0:
        table.problem("bristles need Coulomb friction greater than 0", "coulomb")
    velocity = table.number("stribeck_velocity", 0.01, above=0.0)
    damping = table.number("bristle_damping", 0.0, low=0.0)
    (up, down), (static_up, static_down) = coulomb, static
    return table.number("viscous", low=0.0), (up, down), (static_up, static_down), velocity, bristles, damping


def _noise(table: TomlTable) -> AxisNoise:
    return AxisNoise(*(table.number(key, above=0.0) for key in AxisNoise._fields))


def _plan(table: TomlTable) -> tuple[tuple[float, float], ...]:
    points = table.pairs("plan", "a list of two or more pairs of numbers", [list(p) for p in PLAN], least=2)
    if any(b[0] <= a[0] for a, b in pairwise(points)):
        table.problem("the times of plan must increase", "plan")
    if any(abs(x) > 1.0 for _, x in points):
        table.problem("plan goes further than 1 m from the tissue's surface; it is in metres", "plan")
    return points if len(points) > 1 else PLAN


def _check_clocks(link: TomlTable, arm: TomlTable, scenario: HapticScenario) -> None:
    """Note periods that are not a whole number of ticks, and a simulation that is too long."""
    ticks = scenario.duration / scenario.tick
    if ticks > MAX_TICKS:
        arm.problem(f"{ticks:.3g} ticks are too many to simulate; use at most {MAX_TICKS}", "tick")
    for table, rate in ((link, scenario.link_rate), (arm, scenario.rate)):
        turn = 1.0 / rate / scenario.tick if rate * scenario.tick > 0.0 else math.nan
        if math.isfinite(turn) and (abs(turn - round(turn)) > 1e-6 or round(turn) < 1):
            message = f"the period at {rate:g} Hz must be a whole number of ticks of {scenario.tick:g} s, not {turn:g}"
            table.problem(message, "rate")
