"""The first-generation da Vinci arm of the thesis: hand roll, hand pitch and instrument slide.

Tables 3.1, 4.1 and 4.2 are data here: z0 points up, the hand rolls about +y0, and at q = 0 the tool points along -z0.
The thesis prints its excitation trajectories, the parameters of its joints, and the control studies of chapter 5.
Misprints are listed with the parameters.

The joints have 12, 21 and 7 physical parameters.  The tables give their initial guesses, from which the thesis computed
the guesses in Tables 6.4-6.6.  The thesis does not print the bounds of its search.  The bounds here, one range for each
kind of parameter, contain all values that such a link or motor could have.
"""

import re
from dataclasses import replace
from math import pi

import numpy as np

from davinci_forces.maths.mechanics.bodies import Bodies, Drives, cylinder
from davinci_forces.maths.mechanics.chain import TableRow, denavit_hartenberg
from davinci_forces.maths.models.physical import Physical, PhysicalTable, Quality
from davinci_forces.maths.models.terms import coulomb, gravity_cos, gravity_sin, inertia, lifted_mass, viscous
from davinci_forces.robots.robot import ControlStudy, Joint, Kind, Limits, PrintedColumn, Robot

# Table 3.1: name, parent frame, alpha [rad], a [m], d [m], theta [rad], coordinate (index in q).
CHAIN = denavit_hartenberg(
    [
        TableRow("1", "0", -pi / 2, 0.0, 0.161, 0.0),  # base
        TableRow("2", "1", -pi / 2, 0.0, -0.035, -pi / 2, 0),  # pivot plate
        TableRow("3", "2", pi, 0.190, 0.0, 0.03, 1),  # parallelogram base
        TableRow("4", "3", pi, 0.515, 0.0, 0.03 + pi / 2, 1),  # parallelogram upper bar
        TableRow("5", "4", pi / 2, 0.040, 0.0, 0.0, 1),  # instrument holder
        TableRow("6", "5", 0.0, 0.0, 0.282, 0.0, 2, slides=True),  # needle driver house
        TableRow("7", "6", pi / 2, 0.0, 0.0, 0.0, 3),  # needle driver neck
        TableRow("8", "7", pi / 2, 0.009, 0.0, pi / 2, 4),  # needle driver head
        TableRow("9L", "8", 0.0, 0.009, 0.0, 0.0, 5),  # left jawbone
        TableRow("9R", "8", 0.0, 0.009, 0.0, 0.0, 6),  # right jawbone
    ],
    tip="9L",
)

# Table 4.2, links 2 to 9R: mass [kg], height [m], radius [m]; then the cylinder's axis and the centre of mass as a
# distance [m] along an axis of the link's frame of Table 3.1 (Table 4.1, Eq 4.17).  Fig 4.3 shows the axes of links 3
# and 4; the other axes are chosen to reproduce Eq 6.7 and 6.10.  Link 6's centre is along -z; the printed [0, -lc6, 0]
# is 0.4 m to the side.
X, Y, Z = 0, 1, 2
CYLINDERS = (
    (0.5, 0.22, 0.035, Y, Y, 0.0),
    (4.0, 0.19, 0.1, X, X, -0.34),
    (0.7, 0.515, 0.07, X, X, -0.257),
    (0.7, 0.26, 0.035, Z, Z, -0.3),
    (0.079, 0.1, 0.07, Z, Z, -0.4),
    (0.079, 0.4, 0.035, Y, Y, -0.252),
    (0.04, 0.009, 0.005, X, X, -0.0045),
    (0.01, 0.009, 0.005, X, X, -0.0045),
    (0.01, 0.009, 0.005, X, X, -0.0045),
)
HOLDER = CHAIN.links.index("5")
GUESSED_LC5 = 0.2  # [m] in the initial guesses of Tables 6.4-6.6; Table 4.1 prints 0.3
# Gear ratios are from Table 6.3, friction from the initial guesses of Tables 6.4-6.6.  The thesis gives no friction of
# the wrist, and neglects the inertia of the motors (4.29).
DRIVES = Drives(
    gear_ratio=np.array([200.0, 200.0, 1340.0, 7.5, 12.4, 12.0, 12.0]),
    motor_inertia=np.zeros(7),
    viscous=np.array([1.0, 1.0, 1.0, 0.0, 0.0, 0.0, 0.0]),
    coulomb=np.array([1.0, 0.1, 3.0, 0.0, 0.0, 0.0, 0.0]),
)
BOX = {
    Quality.MASS: (0.0, 5.0),  # [kg]
    Quality.CENTRE: (0.0, 0.6),  # [m]; the longest bar measures 0.515 m
    Quality.MOMENT: (0.0, 0.1),  # [kg m^2]
    Quality.ROTOR: (0.0, 5e-5),  # [kg m^2]
    Quality.VISCOUS: (0.0, 20.0),
    Quality.COULOMB: (0.0, 20.0),
}


def in_table_frames(lc5: float = -CYLINDERS[HOLDER][5]) -> Bodies:
    """The links as cylinders in the frames of Table 3.1; the holder's centre is `lc5` [m] from its frame's origin."""
    centres = np.array([np.where(np.arange(3) == axis, distance, 0.0) for *_, axis, distance in CYLINDERS])
    centres[HOLDER, Z] = -lc5
    inertias = [cylinder(mass, height, radius, axis) for mass, height, radius, axis, _, _ in CYLINDERS]
    # With six coordinates or fewer there is one jaw.
    counts_from = np.array([7 if name == "9R" else 0 for name in CHAIN.links])
    return Bodies(np.array([body[0] for body in CYLINDERS]), centres, np.array(inertias), counts_from)


BODIES = in_table_frames().in_frames(CHAIN.of_links)  # in the frames of the dynamics
GUESSED = in_table_frames(GUESSED_LC5)


def motor(joint: int) -> tuple[Physical, ...]:
    """Inertia of a joint's rotor, and friction of motor and joint together."""
    guesses = (
        (f"Jm{joint + 1}", Quality.ROTOR, DRIVES.motor_inertia),
        (f"v{joint + 1}", Quality.VISCOUS, DRIVES.viscous),
        (f"c{joint + 1}", Quality.COULOMB, DRIVES.coulomb),
    )
    return tuple(Physical(name, quality, float(x[joint]), *BOX[quality]) for name, quality, x in guesses)


def part(name: str) -> Physical:
    """A mass of a link such as m3, the distance lc3 of its centre from its frame's origin, or a moment such as Iy3."""
    kind, letter, link = re.fullmatch("(m|lc|I)([xyz]?)(.+)", name).groups()  # type: ignore[union-attr]
    i = CHAIN.links.index(link)
    if kind == "m":
        return Physical(name, Quality.MASS, float(GUESSED.masses[i]), *BOX[Quality.MASS], link)
    if kind == "I":
        axis = "xyz".index(letter)
        return Physical(name, Quality.MOMENT, float(GUESSED.inertias[i, axis, axis]), *BOX[Quality.MOMENT], link, axis)
    axis = int(np.abs(GUESSED.centres[i]).argmax())
    return Physical(name, Quality.CENTRE, float(-GUESSED.centres[i, axis]), *BOX[Quality.CENTRE], link, axis)


def table(joint: int, names: str) -> PhysicalTable:
    """The physical parameters of one of the arm's three joints: those of its motor, and of links."""
    return PhysicalTable(CHAIN, joint, (*motor(joint), *map(part, names.split())))


# (6.7) omits links 6 to 9.
ROLL_PARTS = table(0, "m3 m4 m5 lc3 lc5 Iy2 Iy3 Ix4 Ix5")
# (6.10) omits Iz7, which only adds to Iy6.  The signs printed there do not matter: the chain determines them.
PITCH_PARTS = table(1, "m3 m4 m5 m6 m7 m8 m9L lc3 lc5 lc6 lc7 lc8 lc9L Iz3 Iy5 Iy6 Iy8 Iy9L")
SLIDE_PARTS = table(2, "m6 m7 m8 m9L")

HAND = Limits(q=(-0.6, 0.6), dq=(-1.2, 1.2), ddq=(-1.2, 1.2))  # Table 6.2
SLIDE = Limits(q=(-0.0672, 0.1097), dq=(-2.0, 2.0), ddq=(-3.0, 3.0))
TORQUE_CONSTANT = 0.0438  # [N m/A] of every motor; this and the gear ratios are from Table 6.3
# Hand roll (6.8), hand pitch (6.11) and instrument slide (6.13), without the values that the thesis prints.
ROLL_TERMS = (inertia, gravity_sin, viscous, coulomb)
ROLL = Joint("hand_roll", "Hand roll", Kind.REVOLUTE, ROLL_TERMS, HAND, 200.0, TORQUE_CONSTANT)
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
CONTROL = tuple(
    ControlStudy(name, title, start, target, K_P, K_D, integral, VISCOUS, known_masses, duration)
    for name, title, start, target, integral, known_masses, duration in (
        ("pd-to-zero", "PD with gravity compensation, from the pose to zero", POSE, ZERO, ZERO, 1.0, 3.0),
        ("pd-to-pose", "PD with gravity compensation, from zero to the pose", ZERO, POSE, ZERO, 1.0, 3.0),
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
    wrist=("instrument_roll", "instrument_pitch", "instrument_yaw", "grip"),
    control=CONTROL,
)
