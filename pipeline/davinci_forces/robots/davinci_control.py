"""The control studies of chapter 5: gains, poses and what is left unknown of the masses, as data.

The thesis does not state the friction of its simulation; here it is the viscous friction of the initial guesses of
Tables 6.4-6.6.  Table 5.2 starts the slide at 0.2 m, beyond its limit of Table 6.2, which the simulation does not have.
"""

from math import pi

from davinci_forces.robots.robot import ControlStudy

# Tables 5.1 and 5.4: hand roll, hand pitch, instrument slide, instrument roll, pitch and yaw.
K_P = (500.0, 500.0, 500.0, 10.0, 10.0, 1.0)
K_D = (50.0, 50.0, 40.0, 2.0, 0.2, 0.02)
K_I = (50.0, 50.0, 40.0, 2.0, 1.0, 0.1)
NONE = (0.0,) * 6
POSE = (-pi / 8, pi / 8, 0.2, -pi / 4, -pi / 4, -pi / 4)  # Tables 5.2 and 5.3
VISCOUS = (1.0, 1.0, 1.0, 0.0, 0.0, 0.0)

LIGHT = "gravity compensated with 0.9 of the masses"

CONTROL = (
    ControlStudy(
        "pd-to-zero", "PD with gravity compensation, from the pose to zero",
        POSE, NONE, K_P, K_D, NONE, VISCOUS, known_masses=1.0, duration=3.0,
    ),
    ControlStudy(
        "pd-to-pose", "PD with gravity compensation, from zero to the pose",
        NONE, POSE, K_P, K_D, NONE, VISCOUS, known_masses=1.0, duration=3.0,
    ),
    ControlStudy(
        "pd-light", f"PD, {LIGHT}", NONE, POSE, K_P, K_D, NONE, VISCOUS, known_masses=0.9, duration=60.0,
    ),
    ControlStudy(
        "pid-light", f"PID, {LIGHT}", NONE, POSE, K_P, K_D, K_I, VISCOUS, known_masses=0.9, duration=60.0,
    ),
)  # fmt: skip
