"""Read the reports of many studies, and write the page of a campaign."""

import json
import os
from collections.abc import Sequence
from datetime import datetime
from pathlib import Path
from typing import Any
from urllib.parse import quote

import numpy as np

from davinci_forces.errors import BadRequest, MissingRecord
from davinci_forces.files import read_bytes, write_bytes
from davinci_forces.maths.arrays import Array
from davinci_forces.maths.estimation import drift
from davinci_forces.report.campaign.page import render_campaign
from davinci_forces.report.campaign.studies import FLOORS, CampaignStudy, Findings, JointVerdict, Series, every_series
from davinci_forces.report.verdicts import WORDS
from davinci_forces.runner import runs
from davinci_forces.runner.results import stated

DAY = 86400.0  # [s]
FALSE_ALARM_PROBABILITY = 0.05  # for all tests of a page together
IN_CONTROL = 0.9973  # share of values in control that keep the limits: three standard deviations, if normal


def write(studies: Sequence[Path], reports: Path | None, out: Path | None) -> tuple[list[Path], list[str]]:
    """Write the page of these studies; return its files, and the studies that are left out without results.

    Raises MissingRecord if no study has results, or one has no summary.json; BadRequest if two studies have the same
    name, or the results of one cannot be read.
    """
    folders = [runs.folders(study, None, reports).reports for study in studies]
    finished = [folder for folder in folders if (folder / "results.json").is_file()]
    left_out = [str(s) for s, folder in zip(studies, folders, strict=True) if folder not in finished]
    if not finished:
        names = ", ".join(left_out) or "none was named"
        raise MissingRecord(f"no study has results ({names}); run `davinci-forces all` on them first")
    if len({folder.name for folder in finished}) < len(finished):
        raise BadRequest(f"two studies have the same name: {', '.join(map(str, finished))}; rename one of the folders")
    place = out or finished[0].parent
    summaries = [read_study(folder, place) for folder in finished]
    by_date = all(study.when is not None for study in summaries)
    ordered = sorted(summaries, key=lambda study: study.started) if by_date else summaries
    files = render_campaign(ordered, left_out, findings([*every_series(ordered)], ordered, by_date))
    for name, content in files.items():
        write_bytes(place / name, content)
    return [place / name for name in files], left_out


def read_study(folder: Path, place: Path) -> CampaignStudy:
    """Read a study from the files of its report; `place` is the folder of the page that links to it."""
    numbers, about = stated.read(folder / "results.json"), read_summary(folder / "summary.json")
    joints = {
        str(joint["joint"]): JointVerdict(joint["verdict"], bool(joint["same_path"]), {n: joint[n] for n in FLOORS})
        for joint in about["joints"]
    }
    return CampaignStudy(
        folder.name, link_to(folder / "report.html", place), about["robot"], bool(about["simulated"]),
        about["started"], joints, numbers,
    )  # fmt: skip


def link_to(file: Path, place: Path) -> str:
    """The link to a file from a page in a folder."""
    try:
        return quote(Path(os.path.relpath(file.resolve(), place.resolve())).as_posix())
    except ValueError:  # on another drive of Windows
        return quote(file.resolve().as_posix())


def read_summary(file: Path) -> dict[str, Any]:
    """Read a summary.json; raises MissingRecord if there is none, and BadRequest if it is not as a report wrote it."""
    again = "`davinci-forces report` writes it again"
    try:
        content = json.loads(read_bytes(file))
        texts = [content[name] for name in ("title", "robot", "started")]
        odd = [joint["joint"] for joint in content["joints"] if joint["verdict"] not in WORDS]
        if odd or not all(isinstance(text, str) for text in texts):
            raise ValueError(f"verdicts of {odd}" if odd else "a text is missing")
    except FileNotFoundError:
        raise MissingRecord(f"{file} does not exist, since an earlier version wrote the report; {again}") from None
    except (OSError, ValueError, TypeError, LookupError) as error:
        raise BadRequest(f"{file} is not as the report wrote it ({error!r}); {again}") from None
    return dict(content)


def findings(series: Sequence[Series], studies: Sequence[CampaignStudy], by_date: bool) -> Findings:
    """Drifts, variations and outliers beyond the standard errors, in series in which every value has one."""
    time = {study.name: float(i) for i, study in enumerate(studies, 1)}
    if by_date:  # [days since 1970]
        time = {s.name: (s.when - datetime(1970, 1, 1)).total_seconds() / DAY for s in studies if s.when is not None}
    complete = [row for row in series if len(row.value) > 1 and np.isfinite([row.value, row.std]).all()]
    times = {row.key: np.array([time[study.name] for study in row.studies]) for row in complete}
    lines = {row.key: line for row in complete if (line := drift.trend(times[row.key], row.value, row.std)) is not None}
    # By kind of test, its series, and the number of the study in it.
    tests = {("drift", key, 0): line.p for key, line in lines.items()}
    tests |= {("scatter", row.key, 0): drift.scatter(row.value, row.std) for row in complete}
    for row in complete:
        probabilities = drift.outlier_probabilities(row.value, row.std).tolist()
        tests |= {("outlier", row.key, i): p for i, p in enumerate(probabilities)}
    rejections = drift.holm([*tests.values()], FALSE_ALARM_PROBABILITY).tolist()
    significant = [test for test, rejected in zip(tests, rejections, strict=True) if rejected]
    drifting, varying = ({where for kind, where, _ in significant if kind == k} for k in ("drift", "scatter"))
    odd = {where: tuple(i for k, at, i in significant if k == "outlier" and at == where) for _, where, _ in significant}
    limits = {row.key: limit for row in series if (limit := limits_of(row, odd.get(row.key, ())))}
    slopes = {where: (lines[where].slope, lines[where].std) for where in drifting}
    return Findings(
        tuple(series), by_date, time, slopes, frozenset(varying), odd, limits, IN_CONTROL, len(tests),
        FALSE_ALARM_PROBABILITY,
    )  # fmt: skip


def limits_of(row: Series, odd: tuple[int, ...]) -> tuple[float, Array] | None:
    """The control limits of a series, without the studies that stand out; None if too few have standard errors."""
    value, std = (np.delete(column, odd) for column in (row.value, row.std))
    if len(value) < drift.MIN_VALUES_TREND or not np.isfinite([value, std]).all():
        return None
    return drift.control_limits(value, std, IN_CONTROL)
