"""Exports of models with every term, and motions to try them on; the parameters are those of some mechanism."""

from types import SimpleNamespace

import numpy as np

from davinci_forces.exports.identified import Export, ExportedJoint, ExportOrigin
from davinci_forces.filters.problem import NoiseModel
from davinci_forces.filters.stepping import covariances
from davinci_forces.identification.joint_models import Identified
from davinci_forces.identification.regression import parameter_columns
from davinci_forces.maths.mechanics.bodies import of_pseudo_inertias
from davinci_forces.maths.models.coupled import CoupledArm
from davinci_forces.maths.models.model import ArmMotion
from davinci_forces.maths.models.terms import OF_MOTION, TERMS, presliding_friction, smooth_sign, stribeck
from davinci_forces.records import Fit
from davinci_forces.records.catalogue import Catalogue
from davinci_forces.robots.models import coupled_arm, independent
from davinci_forces.robots.robot import Robot
from davinci_forces.study import Study

RATE = 100.0
NOISE = NoiseModel(1e-4, 1e-3, 0.0, 2e-2, 3e-2)
ADDED = (
    smooth_sign(0.1),
    stribeck(0.2),
    presliding_friction(2e-3, 1),
    presliding_friction(2e-2, 2),
    *OF_MOTION.values(),
)
ORIGIN = ExportOrigin(
    "0.2.0", "0123456789abcdef" * 2, {"hand_roll": "good", "hand_pitch": "bad"}, ("joint hand_pitch is bad",)
)


def motion(n: int, N: int = 600, seed: int = 0) -> ArmMotion:
    """A smooth motion of n joints, with reversals and a gap."""
    random, t = np.random.default_rng(seed), np.arange(N)[:, None] / RATE
    frequency, phase, size = random.uniform(0.5, 4.0, n), random.uniform(0, 6, n), random.uniform(0.1, 0.3, n)
    w = frequency * np.array([[1.0], [2.0]])[:, None]
    q, dq, ddq = (size * (a * np.sin(w * t + phase)).sum(axis=0) for a in (1 + 0 * w, w, -(w**2)))
    dq = size * (w * np.cos(w * t + phase)).sum(axis=0)
    return ArmMotion(q, dq, ddq, 1.0 / RATE, (np.arange(N) >= N // 2).astype(np.int64))


def coupled(robot: Robot) -> CoupledArm:
    """The model of all joints of a robot, with every friction."""
    rows = range(len(robot.joints))
    return coupled_arm(robot, rows, [ADDED] * len(rows))


def possible(model, seed: int = 0) -> np.ndarray:
    """Parameters that a mechanism can have."""
    random, mechanism = np.random.default_rng(seed), model.mechanism
    x = random.uniform(0.01, 0.2, mechanism.matrix.shape[1])
    roots = random.normal(size=(mechanism.links, 4, 4)) * (0.1, 0.1, 0.1, 1.0)
    if mechanism.links:
        J = roots.swapaxes(1, 2) @ roots
        x[: 10 * mechanism.links] = of_pseudo_inertias(J).ravel()
    return mechanism.matrix @ x


def fit_of(model, structure: str, theta: np.ndarray, estimator: str = "ridge") -> Fit:
    """The record of a fit."""
    m = len(model.efforts)
    std = 0.1 * np.abs(theta)
    return Fit(
        group=model.group, model=model.name, estimator=estimator, structure=structure, cutoff=(10.0,) * m,
        effort_lag=(0.0,) * m, logs=("one",), samples=1, periods=1, mse=0.0, mse_std=0.0, r2=1.0, r2_std=0.0,
        condition=1.0, correlated_lags=1,
        **parameter_columns(model), theta=theta, theta_std=std, theta_std_noise=std,
        theta_std_model=std, theta_std_classical=std,
    )  # fmt: skip


def export(robot: Robot, structure: str, simulated: bool = True) -> Export:
    """An export of all joints of a robot, as models of this structure with every term."""
    study = SimpleNamespace(name="mine", title='A "title" -- */', robot=robot, simulated=simulated)
    study.settings = SimpleNamespace(lowpass=17.0)
    measured = SimpleNamespace(joint=robot.joints[0].name, symbol="i")
    study.logs = [SimpleNamespace(channels=[measured])]
    study.joints_by_current = Study.joints_by_current.fget(study)
    R_q, R_dq, Q_qq, Q_qd, Q_dd, Q_tau = covariances(NOISE, 1.0 / RATE)
    band = {"edges": [0.1, 0.3, 0.6], "factor": [0.9, 1.0, 1.2, 1.4], "model_variance": 0.02}
    Q = [[Q_qq, Q_qd, 0.0], [Q_qd, Q_dd, 0.0], [0.0, 0.0, Q_tau]]
    online = {
        "rate": RATE,
        "R": [R_q, R_dq],
        "Q": Q,
        "least_velocity": 1e-3,
        "initial_std": 0.7,
        "band": band,
        "alarm_level": 0.02,
        "lag": 0.05,
    }
    online["static_friction"] = 0.3
    valid = {"position": [-2.0, 2.0], "velocity": [-9.0, 9.0], "effort": [-50.0, 60.0]}
    joints = []
    for number, joint in enumerate(robot.joints):
        if structure == "coupled":
            model = coupled(robot)
        else:
            terms = [term for term in TERMS.values() if term not in joint.terms]
            model = independent(joint, [*terms, *ADDED])
        fit = fit_of(model, structure, possible(model, 0 if structure == "coupled" else number))
        joints.append(ExportedJoint(joint.name, joint, fit, model, valid, online))
    return Export(study, Catalogue(lambda kind: ()), Identified(robot, []), tuple(joints), ORIGIN)


def motion_of(joint: ExportedJoint, moved: ArmMotion) -> ArmMotion:
    """The motion of a joint's model, from that of all joints of the arm."""
    columns = [
        i for i, name in enumerate(("hand_roll", "hand_pitch", "instrument_slide")) if name in joint.model.joints
    ]
    return moved._replace(**{x: getattr(moved, x)[:, columns] for x in ("q", "dq", "ddq")})
