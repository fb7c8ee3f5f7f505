"""Stage `whiteness`: which models of a joint a log is explained by."""

import numpy as np

from davinci_forces.identification.joint_models import Identified, LogModels
from davinci_forces.records import Fit, JointModel
from davinci_forces.robots import davinci
from davinci_forces.robots.models import coupled_arm, independent
from davinci_forces.stages.forces.whiteness import THIS_LOG, alternatives
from tests import arm

ROLL = davinci.ROBOT.joint("hand_roll")


def fit(model: str) -> Fit:
    """A fit of the roll, each of its parameters 1."""
    described = independent(ROLL) if model == "independent" else coupled_arm(davinci.ROBOT, [0], [()], group=ROLL.name)
    names = np.array([parameter.name for parameter in described.parameters], object)
    columns = dict.fromkeys(Fit.columns(), np.zeros(len(names))) | dict.fromkeys(
        ("parameter", "phi", "unit", "combination"), names
    )
    about = {"structure": model, "cutoff": (17.0,), "effort_lag": (0.0,)}
    about |= {"group": ROLL.name, "model": model, "estimator": "lse", "logs": ("a",), "theta": np.ones(len(names))}
    return Fit(**(dict.fromkeys(Fit.scalars(), 1) | columns | about))


def told_by(signals) -> list[str]:
    """What the roll of a log with these joints is explained by, where it was fitted alone and with the whole arm."""
    fits = [fit("independent"), fit("coupled")]
    along = LogModels(Identified(davinci.ROBOT, fits), [arm.motion(signal) for signal in signals])
    model = next(m for m in arm.models(signals, fits, robot=davinci.ROBOT) if isinstance(m, JointModel))
    return [name for name, _ in alternatives(model, along, np.ones(len(model), bool))]


def test_a_log_without_the_other_joints_is_explained_by_what_needs_them_not():
    signals = [arm.signal(joint.name, periods=2, period=5.0) for joint in davinci.ROBOT.joints]
    assert told_by(signals) == ["", THIS_LOG, "coupled"]
    assert told_by(signals[:1]) == ["", THIS_LOG]
