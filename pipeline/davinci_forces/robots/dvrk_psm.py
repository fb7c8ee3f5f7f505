"""The same arm driven by the da Vinci Research Kit, which logs effort at the joint, already in N m and N."""

from dataclasses import replace

from davinci_forces.robots import davinci
from davinci_forces.robots.dvrk_psm_chain import CHAIN, TOOL
from davinci_forces.robots.robot import Robot, Tool

# Excitation trajectories of the public identification data have six harmonics (Wang et al. 2019).
HARMONICS = 6

ROBOT = Robot(
    name="dvrk_psm",
    title="da Vinci Research Kit, patient-side manipulator",
    joints=tuple(
        replace(
            joint, gear_ratio=1.0, torque_constant=1.0, harmonics=HARMONICS, published=(), physical=None, printed=None
        )
        for joint in davinci.ROBOT.joints
    ),
    chain=CHAIN,
    wrist=("instrument_roll", "instrument_pitch", "instrument_yaw"),
    tool=Tool("tool_roll", TOOL),
)
