"""The reports of many studies, as a campaign shows them, and where its page goes."""

import json
import os
from collections.abc import Sequence
from pathlib import Path
from typing import Any
from urllib.parse import quote

import numpy as np

from davinci_forces.errors import BadRequest, MissingRecord
from davinci_forces.files import read_bytes, write_bytes
from davinci_forces.maths.estimation.drift import holm, scatter, stands_out, trend
from davinci_forces.report.campaign.page import page
from davinci_forces.report.campaign.studies import (
    DAY,
    FLOORS,
    Campaigned,
    Findings,
    JointVerdict,
    Place,
    Series,
    Slope,
    joints_of,
    place,
    series_of,
)
from davinci_forces.report.verdicts import WORDS
from davinci_forces.runner import runs
from davinci_forces.runner.results import stated

CHANCE = 0.05  # of any false alarm on the whole page


def write(studies: Sequence[Path], reports: Path | None, out: Path | None) -> tuple[list[Path], list[str]]:
    """Write the page of these studies; its files, and the studies that have no results and are left out.

    Raises
    ------
    BadRequest
        If no study has results, two have one name, or what one has cannot be read.
    """
    folders = [runs.folders(study, None, reports).reports for study in studies]
    there = [folder for folder in folders if (folder / "results.json").is_file()]
    left_out = [str(s) for s, folder in zip(studies, folders, strict=True) if folder not in there]
    if not there:
        names = ", ".join(left_out) or "none was named"
        raise MissingRecord(f"no study has results ({names}); run `davinci-forces all` on them first")
    if len({folder.name for folder in there}) < len(there):
        raise BadRequest(f"two studies are called alike: {', '.join(map(str, there))}; a campaign tells them by name")
    place = out or there[0].parent
    every = [campaigned(folder, place) for folder in there]
    by_date = all(study.when is not None for study in every)
    ordered = sorted(every, key=lambda study: study.started) if by_date else every
    series = [one for joint in joints_of(ordered) for one in series_of(ordered, joint)]
    files = page(ordered, left_out, findings(series, ordered, by_date))
    for name, content in files.items():
        write_bytes(place / name, content)
    return [place / name for name in files], left_out


def campaigned(folder: Path, place: Path) -> Campaigned:
    """One study, by the files of its report; `place` is the folder of the page that leads there."""
    numbers, about = stated.read(folder / "results.json"), digest(folder / "summary.json")
    joints = {
        str(joint["joint"]): JointVerdict(
            joint["verdict"],
            bool(joint["same_path"]),
            {n: joint[n] for n in FLOORS},
        )
        for joint in about["joints"]
    }
    return Campaigned(
        folder.name, leads_to(folder / "report.html", place), about["robot"], bool(about["simulated"]),
        about["started"], joints, numbers,
    )  # fmt: skip


def leads_to(file: Path, place: Path) -> str:
    """The address of a file from a page in a folder."""
    try:
        return quote(Path(os.path.relpath(file.resolve(), place.resolve())).as_posix())
    except ValueError:  # on another drive of Windows
        return quote(file.resolve().as_posix())


def digest(file: Path) -> dict[str, Any]:
    """The content of a summary.json.

    Raises
    ------
    BadRequest
        If it is not there or not as a report wrote it.
    """
    again = "`davinci-forces report` makes it anew"
    try:
        content = json.loads(read_bytes(file))
        texts = [content[name] for name in ("title", "robot", "started")]
        odd = [joint["joint"] for joint in content["joints"] if joint["verdict"] not in WORDS]
        if odd or not all(isinstance(text, str) for text in texts):
            raise ValueError(f"verdicts of {odd}" if odd else "a text is none")
    except FileNotFoundError:
        raise MissingRecord(f"{file} is not there, as an earlier version made that report; {again}") from None
    except (OSError, ValueError, TypeError, LookupError) as error:
        raise BadRequest(f"{file} is not as the report wrote it ({error!r}); {again}") from None
    return dict(content)


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
