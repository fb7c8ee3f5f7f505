"""An excitation trajectory for people: its properties and its plot."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from davinci_forces.errors import BadRequest
from davinci_forces.maths.arrays import Array
from davinci_forces.maths.excitation.criterion import CRITERIA, condition
from davinci_forces.maths.excitation.fourier import Fourier, motion, observation, ranges
from davinci_forces.maths.excitation.joint import ExcitationProblem, design
from davinci_forces.robots.robot import Joint, Kind

PERIODS = {Kind.REVOLUTE: 10.0, Kind.PRISMATIC: 5.0}  # [s] of Table 6.1
PLOTS = (".svg", ".png", ".pdf")


@dataclass(frozen=True)
class ExcitationTrajectory:
    """A trajectory of one joint, and the problem that it solves or is judged by."""

    joint: Joint
    problem: ExcitationProblem
    series: Fourier
    optima: tuple[float, ...] = ()  # the criterion that each start of a search for it has come to

    @property
    def objective(self) -> float:
        """The criterion: -log10 det(F^T F), or log10 of the condition number.  (6.20)"""
        return float(CRITERIA[self.problem.criterion](self._F()))

    @property
    def condition(self) -> float:
        """The condition number of F."""
        return float(10 ** condition(self._F()))

    @property
    def broken(self) -> list[str]:
        """The limits that the trajectory does not keep, one a line."""
        names = zip(("q", "dq", "ddq"), ("", "/s", "/s^2"), ranges(self.series), self.problem.limits, strict=True)
        unit = self.joint.unit("{position}")
        return [
            f"{name} goes from {lowest:.4f} to {highest:.4f} {unit}{per}, its limits are {low:g} and {high:g}"
            for name, per, (lowest, highest), (low, high) in names
            if lowest < low or highest > high
        ]

    def facts(self) -> dict[str, Any]:
        """All of its properties, in JSON's types."""
        x, names = self.series.x.tolist(), coefficient_names(len(self.series.a))
        symbols = ("q", "dq", "ddq")
        return {
            "joint": self.joint.name,
            "criterion": self.problem.criterion,
            "objective": finite(self.objective),
            "condition": finite(self.condition),
            "coefficients": dict(zip(names, x, strict=True)),
            "period": self.series.period,
            "samples": self.problem.samples,
            "ranges": {s: list(r) for s, r in zip(symbols, ranges(self.series), strict=True)},
            "limits": {s: list(r) for s, r in zip(symbols, self.problem.limits, strict=True)},
            "within_limits": not self.broken,
            **({"starts": spread(self.optima)} if self.optima else {}),
        }

    def _F(self) -> Array:
        return observation(self.problem.terms, self.series, self.problem.samples)


def spread(optima: Sequence[float]) -> dict[str, float | int | None]:
    """How far the starts of a search agree: their number, and the best, the median and the worst optimum."""
    ordered = [finite(value) for value in sorted(optima)]
    best, median, worst = ordered[0], ordered[(len(ordered) - 1) // 2], ordered[-1]
    return {"number": len(optima), "best": best, "median": median, "worst": worst}


def finite(value: float) -> float | None:
    """The number, or JSON's null where it is infinite because the trajectory does not tell the terms apart."""
    return value if math.isfinite(value) else None


def coefficient_names(harmonics: int) -> list[str]:
    """a0, a1, b1, a2, b2, ..."""
    return ["a0", *(f"{letter}{k}" for k in range(1, harmonics + 1) for letter in "ab")]


def problem_of(
    joint: Joint, period: float | None, harmonics: int | None, criterion: str, samples: int
) -> ExcitationProblem:
    """What the excitation of a joint is asked for, with its own limits."""
    limits = (joint.limits.q, joint.limits.dq, joint.limits.ddq)
    period = period or PERIODS[joint.kind]
    return ExcitationProblem(joint.terms, limits, period, harmonics or joint.harmonics, criterion, samples)


def designed(joint: Joint, problem: ExcitationProblem, starts: int, seed: int) -> ExcitationTrajectory:
    """The best trajectory found.

    Raises
    ------
    BadRequest
        If the limits of the joint cannot be kept, or no trajectory tells its parameters apart.
    """
    try:
        found = design(problem, starts, seed)
        return ExcitationTrajectory(joint, problem, found.series, tuple(found.optima.tolist()))
    except ValueError as error:
        raise BadRequest(f"{joint.name}: {error}") from None


def plot(excitations: Sequence[ExcitationTrajectory], path: Path) -> None:
    """Position, velocity and acceleration over one period, between their limits.  Fig 6.5

    Raises
    ------
    BadRequest
        If the file's name does not end in a format that can be drawn.
    """
    if path.suffix not in PLOTS:
        raise BadRequest(f"{path}: a plot ends in {', '.join(PLOTS)}")
    import matplotlib as mpl
    from matplotlib.figure import Figure

    with mpl.rc_context({"svg.hashsalt": "davinci-forces"}):
        figure = Figure(figsize=(4.5 * len(excitations), 6.5), layout="constrained")
        for axes, excitation in zip(figure.subplots(3, len(excitations), squeeze=False).T, excitations, strict=True):
            _draw(axes, excitation)
        metadata = {".svg": {"Date": None}, ".pdf": {"CreationDate": None}}.get(path.suffix, {})
        figure.savefig(path, metadata=metadata, dpi=150)


def _draw(axes: Any, excitation: ExcitationTrajectory) -> None:
    t = np.linspace(0.0, excitation.series.period, 1001)
    unit = excitation.joint.unit("{position}")
    labels = (f"position [{unit}]", f"velocity [{unit}/s]", f"acceleration [{unit}/s²]")
    for ax, values, limits, label in zip(
        axes, motion(excitation.series, t), excitation.problem.limits, labels, strict=True
    ):
        ax.plot(t, values, color="#0072b2")
        for limit in limits:
            ax.axhline(limit, color="#d55e00", linestyle="--", linewidth=1.0)
        ax.set(ylabel=label, xlim=(0.0, t[-1]))
        ax.grid(alpha=0.3)
    axes[0].set_title(f"{excitation.joint.title}: objective {excitation.objective:.4f}", fontsize=10)
    axes[-1].set_xlabel("t [s]; dashed: the limits")
