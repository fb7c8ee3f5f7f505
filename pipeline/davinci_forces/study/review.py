"""Reviewers' ratings of a report: `raw/<study>/review.toml`, as the report's page exports it."""

import re
from dataclasses import dataclass
from pathlib import Path

from davinci_forces import toml
from davinci_forces.errors import BadStudy
from davinci_forces.toml.lines import MAX_TABLES

FILE = "review.toml"
VERDICTS = ("accept", "doubt", "reject")
SUBJECTS = ("figure", "run")  # subjects of a rating: a figure by its label, or a log by its name
STUDY = "study"  # subject of the verdict on the whole study


@dataclass(frozen=True)
class Rating:
    """One reviewer's rating of a figure, a run or the study, and the SHA-256 of the results.json that was seen."""

    subject: str  # of SUBJECTS, or STUDY
    name: str
    verdict: str  # of VERDICTS
    comment: str
    reviewer: str
    date: str
    results: str


def read(file: Path) -> tuple[Rating, ...]:
    """Read the ratings of a file, and last its verdict on the study; raises BadStudy with the line of each problem."""
    table = toml.read(file, BadStudy)
    ratings = tuple(_rating(entry) for entry in table.tables("rating", most=MAX_TABLES))
    if "verdict" in table:
        ratings = (*ratings, _content(STUDY, "", table.table("verdict")))
    table.close()
    table.file.refuse(BadStudy)
    return ratings


def _rating(table: toml.TomlTable) -> Rating:
    subjects = [subject for subject in SUBJECTS if subject in table]
    if len(subjects) != 1:
        table.problem('give what is rated, as either figure = "<its label>" or run = "<its log>"')
    subject = subjects[0] if subjects else SUBJECTS[0]
    return _content(subject, table.text(subject, "" if not subjects else None), table)


def _content(subject: str, name: str, table: toml.TomlTable) -> Rating:
    verdict = table.text("verdict", choices=VERDICTS)
    texts = [table.text(key, "") for key in ("comment", "reviewer", "date", "results")]
    rating = Rating(subject, name, verdict, *texts)
    if not re.fullmatch(r"[0-9a-f]{64}", rating.results):
        must = "results must be the SHA-256 of the rated results.json, as the page exports it"
        table.problem(f"{must}, not {rating.results!r}", "results")
    table.close()
    return rating
