"""What drifts, varies or stands out over a campaign, all tests of a page taken together."""

from collections.abc import Sequence

import numpy as np

from pipeline.maths.arrays import Array
from pipeline.maths.estimation.drift import Trend, holm, scatter, stands_out, trend
from pipeline.report.campaign.studies import Campaigned, Series

CHANCE = 0.05  # of any false alarm on the whole page
DAY = 86400.0  # [s]


class Findings:
    """What of all series drifts, varies beyond its errors or stands out, many tests taken together."""

    def __init__(self, every: Sequence[Series], studies: Sequence[Campaigned], by_date: bool) -> None:
        self.by_date, self.every = by_date, list(every)
        first = studies[0].when if studies and by_date else None
        self.time = {
            study.name: (study.when - first).total_seconds() / DAY if first and study.when else float(i + 1)
            for i, study in enumerate(studies)
        }
        known = [s for s in self.every if len(s.value) > 1 and np.isfinite(s.value).all() and np.isfinite(s.std).all()]
        self.trends: dict[int, Trend] = {}
        tests: list[tuple[int, str, int]] = []
        p: list[float] = []
        for one in known:
            line = trend(self.times(one), one.value, one.std)
            if line is not None:
                self.trends[id(one)] = line
            for what, chance in (("drift", line.p if line else 1.0), ("scatter", scatter(one.value, one.std))):
                tests.append((id(one), what, 0))
                p.append(chance)
            for i, chance in enumerate(stands_out(one.value, one.std).tolist()):
                tests.append((id(one), "outlier", i))
                p.append(chance)
        self.tell = {test for test, told in zip(tests, holm(p, CHANCE).tolist(), strict=True) if told}
        self.tests = len(tests)

    def times(self, one: Series) -> Array:
        """When its studies were [days from the first], or which one in order."""
        return np.array([self.time[study.name] for study in one.studies])

    @property
    def unit(self) -> str:
        """What a slope is by."""
        return "day" if self.by_date else "study"

    def drifts(self, one: Series) -> bool:
        """Whether it has a trend beyond its errors."""
        return (id(one), "drift", 0) in self.tell

    def varies(self, one: Series) -> bool:
        """Whether it scatters beyond its errors."""
        return (id(one), "scatter", 0) in self.tell

    def outliers(self, one: Series) -> list[int]:
        """Which of its studies stand out from the others."""
        return [i for i in range(len(one.value)) if (id(one), "outlier", i) in self.tell]
