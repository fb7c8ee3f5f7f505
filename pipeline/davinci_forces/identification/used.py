"""The fits of a robot's joints, and the fit that a setting names for a joint."""

from collections.abc import Collection, Iterable

import numpy as np

from davinci_forces.errors import PipelineError
from davinci_forces.maths.arrays import Booleans
from davinci_forces.maths.models.model import Model
from davinci_forces.maths.periods.shift import SAME_PATH as LIKE
from davinci_forces.maths.periods.shift import likeness
from davinci_forces.maths.signals.smoothing import segments
from davinci_forces.records import Choice, Fit, FittedPaths, Motion
from davinci_forces.records.prediction import ANOTHER_PATH, CHOSEN, SAME_PATH
from davinci_forces.robots.models import ARM, model_of
from davinci_forces.robots.robot import Robot

FALLBACK = "independent.lse"  # for joints that the chosen model does not cover
STATIC_FRICTION = ("Coulomb friction", "Stribeck friction")  # parameters that add up at standstill


class Identified:
    """The fits of a robot's joints, chosen models and fitted paths.

    `records` are those of these kinds that a stage has read.
    """

    def __init__(self, robot: Robot, records: Iterable[Fit | Choice | FittedPaths]) -> None:
        records = list(records)
        self.robot, self._models = robot, dict[tuple[str, ...], Model]()
        self.fits = [r for r in records if isinstance(r, Fit)]
        self._choices = [r for r in records if isinstance(r, Choice)]
        self._paths = {r.joint: r for r in records if isinstance(r, FittedPaths)}

    def model(self, fit: Fit) -> Model:
        """Return the model of a fit."""
        if fit.key not in self._models:
            scales, names = fit.scale.tolist(), [str(name) for name in fit.parameter]
            self._models[fit.key] = model_of(self.robot, fit.structure, fit.model, fit.group, names, scales)
        return self._models[fit.key]

    def cutoff_and_lag(self, fit: Fit, joint: str) -> tuple[float, float]:
        """Return the cutoff [Hz] of a fit's motion and the lag [s] of the effort, for the effort of a joint."""
        i = self.model(fit).efforts.index(joint)
        return fit.cutoff[i], fit.effort_lag[i]

    def is_friction(self, fit: Fit, joint: str) -> Booleans:
        """Select the parameters (p,) of a joint's friction that are efforts and add up at standstill."""
        suffix = f" of {joint}" if len(self.model(fit).efforts) > 1 else ""
        effort = self.robot.joint(joint).unit("{effort}")
        names_and_units = zip(map(str, fit.parameter), map(str, fit.unit), strict=True)
        return np.array(
            [
                name.startswith(STATIC_FRICTION) and name.endswith(suffix) and unit == effort
                for name, unit in names_and_units
            ]
        )

    def static_friction(self, fit: Fit, joint: str) -> float:
        """Return the largest friction of a joint at standstill: its friction parameters that are efforts, unsigned."""
        return float(np.abs(fit.theta[self.is_friction(fit, joint)]).sum())

    def fits_of(self, joint: str) -> list[Fit]:
        """Return the fits of a joint's effort: its own, and those of its arm."""
        return [f for f in self.fits if f.group == joint or (f.group == ARM and joint in self.model(f).efforts)]

    def fit_of(self, joint: str, setting: str) -> Fit | None:
        """Return the fit named by the setting `fit`, or `FALLBACK` if the chosen model does not cover the joint."""
        by_name = {f"{f.model}.{f.estimator}": f for f in self.fits_of(joint)}
        if setting != CHOSEN:
            return by_name.get(setting)
        names = [f"{choice.model}.{choice.estimator}" for choice in self._choices if choice.group in (joint, ARM)]
        return next((by_name[name] for name in (*names, FALLBACK) if name in by_name), None)

    def fit_along(self, joint: str, setting: str, held: Collection[str]) -> tuple[Fit, str]:
        """Return the fit of a joint along a log with the joints `held`, and why it replaces the fit of the setting.

        Raises PipelineError if there is no fit of that name.
        """
        fit, stand_in = self.fit_of(joint, setting), self.fit_of(joint, FALLBACK)
        if fit is None:
            names = ", ".join(f"{f.model}.{f.estimator}" for f in self.fits_of(joint))
            raise PipelineError(f"{joint}: there is no fit {setting!r}; set fit in [settings] to one of {names}")
        if stand_in is None or set(self.model(fit).joints) <= set(held):
            return fit, ""
        needs = f"the log does not hold the other joints that {fit.model}.{fit.estimator} needs"
        return stand_in, f"{needs}, so {FALLBACK} is used; add their channels"

    def path(self, motion: Motion) -> str:
        """Return whether a recording follows a path fitted in other logs, as `SAME_PATH` or `ANOTHER_PATH`."""
        return SAME_PATH if self.path_new(motion) < 1.0 - LIKE**2 else ANOTHER_PATH

    def path_new(self, motion: Motion) -> float:
        """Return the share of a position's variance that no path of another log explains: 1 - r^2, r the likeness.

        It is 1 if no other log's path is known.
        """
        paths = self._paths.get(motion.joint)
        if paths is None:
            return 1.0
        part = max(segments(motion.segment), key=lambda s: s.stop - s.start)
        periods = dict(zip(paths.source.tolist(), paths.period.tolist(), strict=True))
        likenesses = [
            likeness(motion.t[part], motion.q_measured[part], paths.q[paths.source == log], period)
            for log, period in periods.items()
            if log != motion.log
        ]
        return 1.0 - max([0.0, *likenesses]) ** 2
