"""Which fit describes a joint: the one that the settings name, or the one that was chosen."""

from collections.abc import Iterable, Sequence

from davinci_forces.maths.models.model import Model
from davinci_forces.records import Choice, Fit
from davinci_forces.records.predict import CHOSEN
from davinci_forces.robots.models import ARM, described
from davinci_forces.robots.robot import Robot

FALLBACK = "independent.lse"  # of joints that the chosen model does not describe


def model_of(robot: Robot, fit: Fit) -> Model:
    """The model that a fit's parameters are of."""
    return described(robot, fit.model, fit.group, [str(name) for name in fit.parameter], fit.scale.tolist())


def describing(robot: Robot, fits: Iterable[Fit], joint: str) -> list[Fit]:
    """The fits that give the effort of a joint: its own, and those of the arm that it is a part of."""
    return [f for f in fits if f.group == joint or (f.group == ARM and joint in model_of(robot, f).efforts)]


def used(robot: Robot, fits: Sequence[Fit], choices: Sequence[Choice], joint: str, setting: str) -> Fit | None:
    """The fit that describes a joint under a setting; the chosen one's stand-in is `FALLBACK`."""
    by_name = {f"{f.model}.{f.estimator}": f for f in describing(robot, fits, joint)}
    if setting != CHOSEN:
        return by_name.get(setting)
    names = [f"{choice.model}.{choice.estimator}" for choice in choices if choice.group in (joint, ARM)]
    return next((by_name[name] for name in (*names, FALLBACK) if name in by_name), None)
