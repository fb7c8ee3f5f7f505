"""Finding what drifts, varies or stands out over a campaign: three tests a number, all of them taken together."""

from collections.abc import Sequence

import numpy as np

from davinci_forces.maths.estimation.drift import holm, scatter, stands_out, trend
from davinci_forces.report.campaign.studies import DAY, Campaigned, Findings, Place, Series, Slope, place

CHANCE = 0.05  # of any false alarm on the whole page
Test = tuple[str, Place, int]  # what is asked, of which series, and of which of its studies


def findings(every: Sequence[Series], studies: Sequence[Campaigned], by_date: bool) -> Findings:
    """What the series tell beyond their standard errors, of those that state them."""
    time = times(studies, by_date)
    slopes: dict[Place, Slope] = {}
    tests: dict[Test, float] = {}
    for one in every:
        if len(one.value) < 2 or not (np.isfinite(one.value).all() and np.isfinite(one.std).all()):
            continue
        line = trend(np.array([time[study.name] for study in one.studies]), one.value, one.std)
        if line is not None:
            slopes[place(one)] = Slope(line.slope, line.std)
            tests["drift", place(one), 0] = line.p
        tests["scatter", place(one), 0] = scatter(one.value, one.std)
        tests |= {("outlier", place(one), i): p for i, p in enumerate(stands_out(one.value, one.std).tolist())}
    told = [test for test, tells in zip(tests, holm([*tests.values()], CHANCE).tolist(), strict=True) if tells]
    drifting, varying = ({where for what, where, _ in told if what == wanted} for wanted in ("drift", "scatter"))
    odd = {where: tuple(i for w, at, i in told if w == "outlier" and at == where) for _, where, _ in told}
    return Findings(
        tuple(every), by_date, time, {where: slopes[where] for where in drifting}, frozenset(varying), odd, len(tests),
        CHANCE,
    )  # fmt: skip


def times(studies: Sequence[Campaigned], by_date: bool) -> dict[str, float]:
    """When each study was [days from the first], or which one it is in order."""
    first = studies[0].when if studies else None
    return {
        study.name: (study.when - first).total_seconds() / DAY
        if by_date and first is not None and study.when is not None
        else float(i)
        for i, study in enumerate(studies, 1)
    }
