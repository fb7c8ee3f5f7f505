"""Pinocchio reads the same URDF as the same arm, where it is installed."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from davinci_forces.maths.mechanics import kinematics, rigid_body
from davinci_forces.robots.davinci import ROBOT as DAVINCI
from davinci_forces.robots.urdf import writing
from tests.robot.test_urdf import GRIPPER, motions, robot

pin = pytest.importorskip("pinocchio", reason="Pinocchio is not installed: a rival of benchmarks, not a dependency")


def agrees(text: str, names: dict[str, tuple[str, float, float]], arm, tip: str) -> None:
    """Whether M, C dq, G and the tip are Pinocchio's; `names` are, by joint of the file, what moves it, its sign and
    its bias.
    """
    model = pin.buildModelFromXML(text)
    data, n = model.createData(), arm.chain.n
    E, bias = np.zeros((model.nv, n)), np.zeros(model.nv)
    for k in range(1, model.njoints):
        by, sign, start = names.get(model.names[k], (model.names[k], 1.0, 0.0))
        v = model.joints[k].idx_v
        E[v, arm.coordinates.index(by)], bias[v] = sign, start
    for q, dq, _ in motions(n).swapaxes(0, 1):
        moved, rates = E @ q + bias, E @ dq
        at = pin.integrate(model, pin.neutral(model), moved)
        upper = np.triu(pin.crba(model, data, at))
        M = E.T @ (upper + np.triu(upper, 1).T) @ E
        G = E.T @ pin.computeGeneralizedGravity(model, data, at)
        V = E.T @ pin.nonLinearEffects(model, data, at, rates) - G
        pin.framesForwardKinematics(model, data, at)
        close = {"rtol": 0, "atol": 1e-10}
        assert_allclose(rigid_body.mass_matrix(arm.chain, arm.bodies, q), M, **close)
        assert_allclose(rigid_body.gravity(arm.chain, arm.bodies, q), G, **close)
        assert_allclose(rigid_body.coriolis(arm.chain, arm.bodies, q, dq), V, **close)
        theirs = data.oMf[model.getFrameId(tip)].translation
        assert_allclose(kinematics.tip(arm.chain, q), theirs, **close)


def test_pinocchio_reads_what_is_written_of_the_davinci():
    shared = {f"hand_pitch of {link}": ("hand_pitch", 1.0, 0.0) for link in "45"}
    agrees(writing.text(DAVINCI), shared, DAVINCI, "tip")


def test_pinocchio_reads_the_gripper_as_we_do():
    own = {"Turn 1": ("turn_1", 1.0, 0.0), "d": ("c", -1.0, 0.25)}
    agrees(GRIPPER, own, robot(GRIPPER), "left")


def test_pinocchio_reads_a_real_arm_as_we_do(data):
    text = (data / "ur10e" / "ur10e.urdf").read_text()
    agrees(text, {}, robot(text), "tool0")
    agrees(writing.text(robot(text)), {}, robot(text), "tip")
