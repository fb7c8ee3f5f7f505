"""The first-generation da Vinci arm of the thesis: hand roll, hand pitch and instrument slide."""

from pipeline.maths.terms import coulomb, gravity_cos, gravity_sin, inertia, lifted_mass, viscous
from pipeline.robots.robot import Joint, Kind, Limits, Robot

TORQUE_CONSTANT = 0.0438  # [N m/A], of every motor.  Table 6.3
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
            q_tau=2.0,
        ),
        Joint(
            name="hand_pitch",
            title="Hand pitch",
            kind=Kind.REVOLUTE,
            terms=(inertia, gravity_sin, gravity_cos, viscous, coulomb),  # (6.11)
            limits=HAND,
            gear_ratio=200.0,
            torque_constant=TORQUE_CONSTANT,
            q_tau=2.0,
        ),
        Joint(
            name="instrument_slide",
            title="Instrument slide",
            kind=Kind.PRISMATIC,
            terms=(lifted_mass, inertia, viscous, coulomb),  # (6.13)
            limits=SLIDE,
            gear_ratio=1340.0,
            torque_constant=TORQUE_CONSTANT,
            q_tau=10.0,
        ),
    ),
)
