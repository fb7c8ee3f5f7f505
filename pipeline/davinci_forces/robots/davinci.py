"""The first-generation da Vinci arm of the thesis: hand roll, hand pitch and instrument slide.

The thesis prints its excitation trajectories, the parameters of its joints, and the control studies of chapter 5.
Misprints are listed with the parameters.
"""

from dataclasses import replace
from math import pi

from davinci_forces.maths.models.terms import coulomb, gravity_cos, gravity_sin, inertia, lifted_mass, viscous
from davinci_forces.robots.davinci_chain import BODIES, CHAIN, PITCH_PARTS, ROLL_PARTS, SLIDE_PARTS, WRIST_COORDINATES
from davinci_forces.robots.robot import ControlStudy, Joint, Kind, Limits, PrintedColumn, Robot

HAND = Limits(q=(-0.6, 0.6), dq=(-1.2, 1.2), ddq=(-1.2, 1.2))  # Table 6.2
SLIDE = Limits(q=(-0.0672, 0.1097), dq=(-2.0, 2.0), ddq=(-3.0, 3.0))
TORQUE_CONSTANT = 0.0438  # [N m/A] of every motor; this and the gear ratios are from Table 6.3
# Hand roll (6.8), hand pitch (6.11) and instrument slide (6.13), without the values that the thesis prints.
ROLL = Joint(
    "hand_roll", "Hand roll", Kind.REVOLUTE, (inertia, gravity_sin, viscous, coulomb), HAND, 200.0, TORQUE_CONSTANT
)
PITCH_TERMS = (inertia, gravity_sin, gravity_cos, viscous, coulomb)
PITCH = Joint("hand_pitch", "Hand pitch", Kind.REVOLUTE, PITCH_TERMS, HAND, 200.0, TORQUE_CONSTANT)
SLIDE_TERMS = (lifted_mass, inertia, viscous, coulomb)
INSERTION = Joint("instrument_slide", "Instrument slide", Kind.PRISMATIC, SLIDE_TERMS, SLIDE, 1340.0, TORQUE_CONSTANT)

# Table 6.1 as printed.  The roll's b1 and the slide's a0 are misprints: with them, a row does not give its printed
# objective, or exceeds its limits.
ROLL_PUBLISHED = (
    ("table-6.1", (10.0, -0.1848, 0.0260, 0.0813, 0.0609, -0.4261)),
    ("table-6.1-corrected", (10.0, -0.1848, 0.0260, -0.2783, 0.0609, -0.4261)),
)
PITCH_PUBLISHED = (("table-6.1", (10.0, -0.1912, 0.2861, -0.0639, 0.1741, 0.3701)),)
SLIDE_PUBLISHED = (
    ("table-6.1", (5.0, -0.0164, 0.0001, 0.0002, -0.1632, -0.1350)),
    ("table-6.1-corrected", (5.0, 0.0200, 0.0001, 0.0002, -0.1632, -0.1350)),
)

# The parameters that the thesis prints, Tables 6.4 to 6.6.
ROLL_PRINTED = (
    PrintedColumn("", (0.3843, 0.194, 1.0, 1.0), 1.3899),
    PrintedColumn("wlse", (0.4521, 0.0110, 0.3707, 0.2203), 0.0199),
    PrintedColumn("lse", (0.4528, 0.0103, 0.3706, 0.21968), 0.0197),
    PrintedColumn("pso", (0.4528, 0.0103, 0.3705, 0.2197), 0.0197),
)
PITCH_PRINTED = (
    PrintedColumn("", (0.2961, 1.9475, 0.115, 1.0, 0.1), 2.9145),
    PrintedColumn("wlse", (0.2381, 0.1350, 0.064, 0.9110, 0.4151), 0.0461),
    PrintedColumn("lse", (0.2384, 0.1343, 0.0705, 0.9064, 0.4155), 0.0460),
    PrintedColumn("pso", (0.2406, 0.1345, 0.0704, 0.9061, 0.4156), 0.0460),
)
SLIDE_PRINTED = (
    PrintedColumn("", (0.141, 1e-6, 1.0, 3.0), 8.8435),
    PrintedColumn("wlse", (2.4610, -0.0750, 3.2723, 3.9842), 1.8100),
    PrintedColumn("lse", (2.5626, -0.0712, 3.2723, 3.9840), 1.8101),
    PrintedColumn("pso", (2.485, 0.0003, 3.1939, 3.9975), 2.2986),
)

# Tables 5.1 and 5.4: hand roll, hand pitch, instrument slide, instrument roll, pitch and yaw.
K_P = (500.0, 500.0, 500.0, 10.0, 10.0, 1.0)
K_D = (50.0, 50.0, 40.0, 2.0, 0.2, 0.02)
K_I = (50.0, 50.0, 40.0, 2.0, 1.0, 0.1)
ZERO = (0.0,) * 6
# Tables 5.2 and 5.3.  The slide starts at 0.2 m, beyond its limit in Table 6.2; the simulation has no such limit.
POSE = (-pi / 8, pi / 8, 0.2, -pi / 4, -pi / 4, -pi / 4)
# The thesis does not state the friction of its simulation; these are the initial guesses of Tables 6.4-6.6.
VISCOUS = (1.0, 1.0, 1.0, 0.0, 0.0, 0.0)
LIGHT = "gravity compensated with 0.9 of the masses"
EXACT = "PD with gravity compensation, from"
CONTROL = tuple(
    ControlStudy(name, title, start, target, K_P, K_D, integral, VISCOUS, known_masses, duration)
    for name, title, start, target, integral, known_masses, duration in (
        ("pd-to-zero", f"{EXACT} the pose to zero", POSE, ZERO, ZERO, 1.0, 3.0),
        ("pd-to-pose", f"{EXACT} zero to the pose", ZERO, POSE, ZERO, 1.0, 3.0),
        ("pd-light", f"PD, {LIGHT}", ZERO, POSE, ZERO, 0.9, 60.0),
        ("pid-light", f"PID, {LIGHT}", ZERO, POSE, K_I, 0.9, 60.0),
    )
)

ROBOT = Robot(
    name="davinci",
    title="da Vinci arm, first generation",
    joints=(
        replace(ROLL, published=ROLL_PUBLISHED, physical=ROLL_PARTS, printed=ROLL_PRINTED),
        replace(PITCH, published=PITCH_PUBLISHED, physical=PITCH_PARTS, printed=PITCH_PRINTED),
        replace(INSERTION, published=SLIDE_PUBLISHED, physical=SLIDE_PARTS, printed=SLIDE_PRINTED),
    ),
    chain=CHAIN,
    bodies=BODIES,
    wrist=WRIST_COORDINATES,
    control=CONTROL,
)
