"""The first-generation da Vinci arm of the thesis: hand roll, hand pitch and instrument slide."""

from davinci_forces.maths.models.terms import coulomb, gravity_cos, gravity_sin, inertia, lifted_mass, viscous
from davinci_forces.robots import davinci_physical, davinci_printed
from davinci_forces.robots.davinci_chain import BODIES, CHAIN, DRIVES, WRIST
from davinci_forces.robots.davinci_control import CONTROL
from davinci_forces.robots.robot import Joint, Kind, Limits, Robot

TORQUE_CONSTANT = 0.0438  # [N m/A], of every motor.  Table 6.3
# Table 6.1 as printed; the roll's b1 and the slide's a0 are misprints, for their rows do not give their objectives or
# break their limits.
ROLL = (
    ("table-6.1", (10.0, -0.1848, 0.0260, 0.0813, 0.0609, -0.4261)),
    ("table-6.1-corrected", (10.0, -0.1848, 0.0260, -0.2783, 0.0609, -0.4261)),
)
PITCH = (("table-6.1", (10.0, -0.1912, 0.2861, -0.0639, 0.1741, 0.3701)),)
INSERTION = (
    ("table-6.1", (5.0, -0.0164, 0.0001, 0.0002, -0.1632, -0.1350)),
    ("table-6.1-corrected", (5.0, 0.0200, 0.0001, 0.0002, -0.1632, -0.1350)),
)
HAND = Limits(q=(-0.6, 0.6), dq=(-1.2, 1.2), ddq=(-1.2, 1.2))  # Table 6.2
SLIDE = Limits(q=(-0.0672, 0.1097), dq=(-2.0, 2.0), ddq=(-3.0, 3.0))

ROBOT = Robot(
    name="davinci",
    title="da Vinci arm, first generation",
    joints=(
        Joint(
            name="hand_roll",
            title="Hand roll",
            kind=Kind.REVOLUTE,
            terms=(inertia, gravity_sin, viscous, coulomb),  # (6.8)
            limits=HAND,
            gear_ratio=200.0,
            torque_constant=TORQUE_CONSTANT,
            published=ROLL,
            physical=davinci_physical.ROLL,
            printed=davinci_printed.ROLL,
        ),
        Joint(
            name="hand_pitch",
            title="Hand pitch",
            kind=Kind.REVOLUTE,
            terms=(inertia, gravity_sin, gravity_cos, viscous, coulomb),  # (6.11)
            limits=HAND,
            gear_ratio=200.0,
            torque_constant=TORQUE_CONSTANT,
            published=PITCH,
            physical=davinci_physical.PITCH,
            printed=davinci_printed.PITCH,
        ),
        Joint(
            name="instrument_slide",
            title="Instrument slide",
            kind=Kind.PRISMATIC,
            terms=(lifted_mass, inertia, viscous, coulomb),  # (6.13)
            limits=SLIDE,
            gear_ratio=1340.0,
            torque_constant=TORQUE_CONSTANT,
            published=INSERTION,
            physical=davinci_physical.SLIDE,
            printed=davinci_printed.SLIDE,
        ),
    ),
    chain=CHAIN,
    bodies=BODIES,
    wrist=WRIST,
    drives=DRIVES,
    control=CONTROL,
)
