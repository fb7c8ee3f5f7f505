"""The same arm with the controllers of the da Vinci Research Kit, which log joint efforts in N m and N.

The chain has the published geometry.  The base frame is at the pivot of the back link, with z up and y along the yaw
axis.  The remote centre is on the yaw axis, at (0, L2, 0); at q = 0 the tool passes through it along -z.  Two bars stay
parallel to the yaw axis and carry the end link, which turns about the remote centre without a bearing there.  Masses
are not published.

Wang et al., A convex optimization-based dynamic model identification package for the da Vinci Research Kit, 2019.
"""

from dataclasses import replace
from math import pi

from davinci_forces.maths.mechanics.chain import TableRow, modified_denavit_hartenberg
from davinci_forces.robots import davinci
from davinci_forces.robots.robot import Robot, Tool

L1, L2, L3 = 0.096, 0.516, 0.04009  # [m] lengths of the bars and the back link
H1, H2 = 0.14454, 0.03808  # [m] from the back link's corner to the lower bar, and from the lower to the upper bar
CARRIAGE = 0.04009  # [m] distance of the carriage from the end link's axis
REACH = 0.4318  # [m] from the remote centre to the carriage at q3 = 0, along the tool
TOOL, WRIST = 0.4162, 0.0091  # [m] length of the tool's shaft, and from the wrist's pitch axis to its yaw axis

Q_ROLL, Q_PITCH, Q_SLIDE, Q_TOOL_ROLL, Q_WRIST_PITCH, Q_WRIST_YAW = range(6)

PSM_CHAIN = modified_denavit_hartenberg(
    [
        TableRow("yaw", "0", pi / 2, 0.0, 0.0, pi / 2, Q_ROLL),  # turns about -y
        TableRow("back_link", "yaw", -pi / 2, 0.0, 0.0, -pi / 2, Q_PITCH),  # turns about -x
        TableRow("back_link_corner", "back_link", 0.0, L3, 0.0, pi / 2),
        TableRow("lower_bar", "back_link_corner", 0.0, H1, 0.0, pi / 2, Q_PITCH, sign=-1),
        TableRow("upper_bar", "back_link_corner", 0.0, H1 + H2, 0.0, pi / 2, Q_PITCH, sign=-1),
        TableRow("end_link", "lower_bar", 0.0, L2, 0.0, 0.0, Q_PITCH),
        TableRow("front_link", "lower_bar", 0.0, L1, 0.0, pi, Q_PITCH),
        TableRow("carriage", "end_link", -pi / 2, CARRIAGE, H1 - REACH, 0.0, Q_SLIDE, slides=True),
        TableRow("counterweight", "back_link", -pi / 2, L3, 0.0, 0.0, Q_SLIDE, slides=True),
        TableRow("tool_roll", "carriage", 0.0, 0.0, TOOL, 0.0, Q_TOOL_ROLL),
        TableRow("wrist_pitch", "tool_roll", pi / 2, 0.0, 0.0, pi / 2, Q_WRIST_PITCH),
        TableRow("wrist_yaw", "wrist_pitch", -pi / 2, WRIST, 0.0, pi / 2, Q_WRIST_YAW),
    ],
    tip="wrist_yaw",
)


# Ends of yaw, pitch and insertion [rad, m], as psm.urdf.xacro of WPI-AIM's dvrk_env states them.  Its rates are no
# limits of the drives; those of Table 6.2 stay.
POSITIONS = ((-1.605, 1.5994), (-0.93556, 0.94249), (0.0, 0.24))
HARMONICS = 6  # in the excitation trajectories of the public identification data.  Wang et al. 2019

ROBOT = Robot(
    name="dvrk_psm",
    title="da Vinci Research Kit, patient-side manipulator",
    joints=tuple(
        replace(joint, limits=replace(joint.limits, q=q), gear_ratio=1.0, torque_constant=1.0, harmonics=HARMONICS)
        for joint, q in zip((davinci.ROLL, davinci.PITCH, davinci.INSERTION), POSITIONS, strict=True)
    ),
    chain=PSM_CHAIN,
    wrist=("instrument_roll", "instrument_pitch", "instrument_yaw"),
    tool=Tool("tool_roll", TOOL),
)
