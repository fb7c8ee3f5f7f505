"""What drifts, varies or stands out over a campaign, as it was found of all numbers of a page together."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np

from davinci_forces.maths.arrays import Array
from davinci_forces.report.campaign.studies import Series

DAY = 86400.0  # [s]
Place = tuple[str, str, str]  # joint, name and unit of a series


class Slope(NamedTuple):
    """By how much a number drifts a day, or a study, with its standard error."""

    value: float
    std: float


@dataclass(frozen=True)
class Findings:
    """What of all series drifts, varies beyond its errors or stands out, many tests taken together."""

    every: tuple[Series, ...]
    by_date: bool
    time: Mapping[str, float]  # of each study [days from the first], or which one it is in order
    slopes: Mapping[Place, Slope] = field(default_factory=dict)  # of what drifts
    varying: frozenset[Place] = frozenset()
    outliers: Mapping[Place, tuple[int, ...]] = field(default_factory=dict)  # studies, by their place in the series
    tests: int = 0
    chance: float = 0.0  # that any of them tells falsely

    def times(self, one: Series) -> Array:
        """When the studies of a series were."""
        return np.array([self.time[study.name] for study in one.studies])

    @property
    def unit(self) -> str:
        """What a slope is by."""
        return "day" if self.by_date else "study"

    def stand_out(self, one: Series) -> tuple[int, ...]:
        """Which of its studies stand out from the others."""
        return self.outliers.get(place(one), ())

    def tell(self, one: Series) -> bool:
        """Whether there is anything to say of it."""
        return place(one) in self.slopes or place(one) in self.varying or bool(self.stand_out(one))


def place(one: Series) -> Place:
    """What tells a series from the others."""
    return one.joint, one.name, one.unit
