"""What identification logs say of a robot's joints, and which of their fits describes a joint under a setting."""

from collections.abc import Collection, Iterable

import numpy as np

from davinci_forces.errors import PipelineError
from davinci_forces.maths.models.model import Model
from davinci_forces.maths.periods.shift import SAME_PATH as LIKE
from davinci_forces.maths.periods.shift import likeness
from davinci_forces.maths.signals.smoothing import segments
from davinci_forces.records import Choice, CrossFit, Fit, FittedPaths, Motion
from davinci_forces.records.prediction import ANOTHER_PATH, CHOSEN, SAME_PATH
from davinci_forces.robots.models import ARM, described
from davinci_forces.robots.robot import Robot

FALLBACK = "independent.lse"  # of joints that the chosen model does not describe


def follows(motion: Motion, paths: FittedPaths) -> bool:
    """Whether the longest segment of a recording is like one of the paths."""
    part = max(segments(motion.segment), key=lambda s: s.stop - s.start)
    each = [np.flatnonzero(paths.source == log) for log in dict.fromkeys(paths.source)]
    likenesses = [
        likeness(motion.t[part], motion.q_measured[part], paths.q[rows], float(paths.period[rows[0]])) for rows in each
    ]
    return max(likenesses) > LIKE


class Identified:
    """The fits of a robot's joints, refits without some logs, the choice among models, and the paths that were fitted.

    Of these records those that a stage has.
    """

    def __init__(self, robot: Robot, records: Iterable[Fit | CrossFit | Choice | FittedPaths]) -> None:
        every = list(records)
        self.robot, self._models = robot, dict[tuple[str, ...], Model]()
        self.fits = [r for r in every if isinstance(r, Fit)]
        self.cross_fits = [r for r in every if isinstance(r, CrossFit)]
        self._choices = [r for r in every if isinstance(r, Choice)]
        self._paths = {r.joint: r for r in every if isinstance(r, FittedPaths)}

    def model(self, fit: Fit) -> Model:
        """The model that a fit's parameters are of."""
        if fit.key not in self._models:
            scales, names = fit.scale.tolist(), [str(name) for name in fit.parameter]
            self._models[fit.key] = described(self.robot, fit.model, fit.group, names, scales)
        return self._models[fit.key]

    def describing(self, joint: str) -> list[Fit]:
        """The fits that give the effort of a joint: its own, and those of the arm that it is a part of."""
        return [f for f in self.fits if f.group == joint or (f.group == ARM and joint in self.model(f).efforts)]

    def used(self, joint: str, setting: str) -> Fit | None:
        """The fit that describes a joint under a setting; the chosen one's stand-in is `FALLBACK`."""
        by_name = {f"{f.model}.{f.estimator}": f for f in self.describing(joint)}
        if setting != CHOSEN:
            return by_name.get(setting)
        names = [f"{choice.model}.{choice.estimator}" for choice in self._choices if choice.group in (joint, ARM)]
        return next((by_name[name] for name in (*names, FALLBACK) if name in by_name), None)

    def used_along(self, joint: str, setting: str, held: Collection[str]) -> tuple[Fit, str]:
        """The fit of a joint under a setting, along a log that holds these joints, and why another stands in for it.

        Raises
        ------
        PipelineError
            If there is no fit of that name.
        """
        fit, stand_in = self.used(joint, setting), self.used(joint, FALLBACK)
        if fit is None:
            names = ", ".join(f"{f.model}.{f.estimator}" for f in self.describing(joint))
            raise PipelineError(f"{joint}: there is no fit {setting!r}; set fit in [settings] to one of {names}")
        if stand_in is None or set(self.model(fit).joints) <= set(held):
            return fit, ""
        needs = f"the log does not hold the other joints that {fit.model}.{fit.estimator} needs"
        return stand_in, f"{needs}, so {FALLBACK} is used; add their channels"

    def path(self, motion: Motion) -> str:
        """Whether a recording follows a path that was fitted."""
        paths = self._paths.get(motion.joint)
        return SAME_PATH if paths is not None and follows(motion, paths) else ANOTHER_PATH
