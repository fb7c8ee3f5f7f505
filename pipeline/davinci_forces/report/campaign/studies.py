"""The studies of a campaign, each number of a joint over all of them, and what drifts or stands out."""

import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from datetime import datetime
from typing import NamedTuple

import numpy as np

from davinci_forces.maths.arrays import Array
from davinci_forces.report.changes import StatedValue
from davinci_forces.report.content import Level, literal

FIT = "independent.lse"  # the fit whose parameters mean the same in every study; the model in use may be another
ABOUT_THE_FIT = ("mse", "r2", "condition", "samples", "periods", "hac_lags")
FLOORS = {"model_error": "model error", "detection_level": "detection level", "coverage": "coverage of the 95 % band"}


@dataclass(frozen=True)
class JointVerdict:
    """The verdict of a report on one joint, with the keys of its numbers."""

    verdict: Level
    same_path: bool
    keys: Mapping[str, str | None]


@dataclass(frozen=True)
class CampaignStudy:
    """One study of a campaign: its name, its report beside the page, when it was recorded, and its numbers."""

    name: str
    report: str
    robot: str
    simulated: bool
    started: str
    joints: Mapping[str, JointVerdict]
    numbers: Mapping[str, StatedValue]

    @property
    def when(self) -> datetime | None:
        """Start of the first log; None if no log states its start."""
        try:
            return datetime.fromisoformat(self.started[:19])
        except ValueError:
            return None

    @property
    def link(self) -> str:
        """Name of the study as a link to its report."""
        words = literal(self.name).replace("]", "\\]")
        return f"[{words}]({self.report})"

    def terms_in_use(self, joint: str) -> dict[str, str]:
        """Names, by key, of a joint's friction and gravity in the model that its error is of; none if that is FIT."""
        error, slug = self.joints[joint].keys["model_error"] if joint in self.joints else "", joint.replace("-", "_")
        fit = re.sub(rf".*\.{joint}\.(.*?)(_by_log)?\.model_error", r"\1", error or "")
        # The key of a chosen model's error names no estimator: it is not that of the consistent parameters beside it.
        name = rf"([^.]*friction|gravity_(co)?sine)(_of_{slug})?"
        pattern = rf"fit\.({joint}|arm)\.{re.escape(fit)}(\.(?!consistent)\w+)?\.{name}"
        return {key: m[3] for key in self.numbers if fit != FIT and (m := re.fullmatch(pattern, key))}


Place = tuple[str, str, str, str]  # robot, joint, name and unit of a series


class Series(NamedTuple):
    """One number of a robot's joint over the studies that have it, with the standard errors."""

    robot: str
    joint: str
    name: str
    unit: str
    studies: tuple[CampaignStudy, ...]
    keys: tuple[str, ...]
    value: Array
    std: Array  # NaN where none is stated

    @property
    def key(self) -> Place:
        """Robot, joint, name and unit, which identify a series."""
        return self[:4]


def by_robot(studies: Sequence[CampaignStudy]) -> dict[str, list[CampaignStudy]]:
    """The studies of each robot, in order."""
    return {robot: [s for s in studies if s.robot == robot] for robot in dict.fromkeys(s.robot for s in studies)}


def joints_of(studies: Sequence[CampaignStudy]) -> list[str]:
    """The joints with a verdict in any study, in order."""
    return list(dict.fromkeys(joint for study in studies for joint in study.joints))


def every_series(studies: Sequence[CampaignStudy]) -> Iterator[Series]:
    """Every number of every joint, robot by robot: joints of two robots have nothing in common but a name."""
    for same in by_robot(studies).values():
        for joint in joints_of(same):
            yield from series_of(same, joint)


def series_of(studies: Sequence[CampaignStudy], joint: str) -> Iterator[Series]:
    """Parameters, friction and gravity of the model in use, and measures of trust of a joint, by unit."""
    keyed: dict[tuple[str, str], list[tuple[CampaignStudy, str]]] = {}
    prefix = f"fit.{joint}.{FIT}."
    used = [study.terms_in_use(joint) for study in studies]
    newest = next(filter(None, reversed(used)), {})
    for study, terms in zip(studies, used, strict=True):
        named = [(key.removeprefix(prefix), key) for key in study.numbers if key.startswith(prefix)]
        results = study.joints.get(joint)
        floors = [(title, results.keys.get(name)) for name, title in FLOORS.items()] if results else []
        in_use = terms if terms == newest else {}  # else another model, in other terms
        for name, key in [*named, *((f"{name} of the model in use", key) for key, name in in_use.items()), *floors]:
            if key is not None and key in study.numbers and name not in ABOUT_THE_FIT and ".std_" not in name:
                keyed.setdefault((name, study.numbers[key].unit), []).append((study, key))
    for (name, unit), places in keyed.items():
        numbers = [study.numbers[key] for study, key in places]
        value = np.array([number.number if number.number is not None else np.nan for number in numbers])
        std = np.array([number.std or np.nan for number in numbers])
        those, keys = zip(*places, strict=True)
        yield Series(studies[0].robot, joint, name, unit, those, keys, value, std)


@dataclass(frozen=True)
class Findings:
    """The series that drift, vary beyond their errors or stand out, corrected for the number of tests."""

    every: tuple[Series, ...]
    by_date: bool
    time: Mapping[str, float]  # of each study [days since 1970], or its number in order
    slopes: Mapping[Place, tuple[float, float]] = field(default_factory=dict)  # with errors, of the series that drift
    varying: frozenset[Place] = frozenset()
    outliers: Mapping[Place, tuple[int, ...]] = field(default_factory=dict)  # studies, by their place in the series
    # The weighted mean of the studies that do not stand out, and the distance of the control limits at each; of the
    # series of three such studies or more.
    limits: Mapping[Place, tuple[float, Array]] = field(default_factory=dict)
    inside: float = 0.0  # share of further values in control that keep the limits
    tests: int = 0
    chance: float = 0.0  # that any test gives a false alarm
