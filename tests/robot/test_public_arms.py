"""Public descriptions of arms, hands and legs are read, and Pinocchio computes the same dynamics, where both are."""

from importlib.metadata import PackageNotFoundError, files
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pytest
from numpy.testing import assert_allclose

from davinci_forces.maths.constants import GRAVITY
from davinci_forces.maths.mechanics import rigid_body
from davinci_forces.robots.urdf import reading
from tests.robot.test_urdf import motions

pin = pytest.importorskip("pinocchio", reason="Pinocchio is not installed: `make oracles` installs it where it is")
try:
    PUBLIC = files("example-robot-data") or []
except PackageNotFoundError:
    pytest.skip("example-robot-data is not installed: `make oracles` installs it", allow_module_level=True)

# Arms, hands and legs, on a fixed base, of makers and laboratories.
ROBOTS = (
    "ur_description/urdf/ur3_robot", "ur_description/urdf/ur5_robot", "ur_description/urdf/ur10_robot",
    "panda_description/urdf/panda", "xarm_description/urdf/xarm7", "kinova_description/robots/kinova",
    "baxter_description/urdf/baxter", "so100", "so101",
    "z1_description/urdf/z1", "finger_edu_description/robots/finger_edu", "talos_data/robots/talos_left_arm",
    "icub_description/robots/icub", "romeo_description/urdf/romeo", "tiago_description/robots/tiago",
    "allegro_hand_description/urdf/allegro_right_hand", "double_pendulum_description/urdf/double_pendulum",
)  # fmt: skip


def file_of(name: str) -> Path:
    return Path(next(file for file in PUBLIC if str(file).endswith(f"/{name}.urdf")).locate())


def shared(model, file: Path, moving: list[str]):
    """Velocities (nv, n) and positions at 0 (nv,) of Pinocchio's joints, of which `mimic` moves some with others."""
    E, bias = np.zeros((model.nv, len(moving))), np.zeros(model.nv)
    mimics = {joint.get("name"): joint.find("mimic") for joint in ElementTree.parse(file).findall("joint")}
    for k in range(1, model.njoints):
        mimic, i = mimics[model.names[k]], model.joints[k].idx_v
        by = model.names[k] if mimic is None else mimic.get("joint")
        E[i, moving.index(by)] = 1.0 if mimic is None else float(mimic.get("multiplier", 1.0))
        bias[i] = 0.0 if mimic is None else float(mimic.get("offset", 0.0))
    return E, bias


@pytest.mark.parametrize("name", ROBOTS)
def test_a_public_robot_has_pinocchios_dynamics(name):
    arm, notes = reading.read_with_problems(file_of(name))
    assert arm is not None, notes.problems()
    model = pin.buildModelFromUrdf(str(file_of(name)))
    data, (E, bias) = model.createData(), shared(model, file_of(name), [joint.title for joint in arm.joints])
    for up in ((0.0, 0.0, 1.0), (0.6, 0.0, 0.8)):
        chain = arm.with_base((0.0, -np.arcsin(up[0]), 0.0)).chain
        assert_allclose(chain.up, up, rtol=0, atol=1e-12)
        model.gravity.linear = -GRAVITY * np.array(up)
        for q, dq, ddq in motions(chain.n)[:, :5].swapaxes(0, 1):
            at = pin.integrate(model, pin.neutral(model), E @ q + bias)
            theirs = E.T @ pin.rnea(model, data, at, E @ dq, E @ ddq)
            ours = rigid_body.inverse_dynamics(chain, arm.bodies, q, dq, ddq)
            assert_allclose(ours, theirs, rtol=0, atol=1e-10 * max(1.0, abs(theirs).max()))
