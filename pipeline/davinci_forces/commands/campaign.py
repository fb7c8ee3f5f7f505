"""Summarise many studies on one page, HTML and PDF: parameters over time, noise levels, verdicts, drifts, outliers."""

from pathlib import Path
from typing import Annotated

from typer import Option

from davinci_forces.commands import Reports, Studies
from davinci_forces.runner.console import echo


def run(
    studies: Studies = None,
    reports: Reports = None,
    out: Annotated[
        Path | None, Option(help="Folder for campaign.html and campaign.pdf, instead of the reports' folder.")
    ] = None,
) -> None:
    """Write campaign.html and campaign.pdf from the reports of studies, and name the studies that have none."""
    from davinci_forces.runner import runs
    from davinci_forces.runner.results import campaign

    files, left_out = campaign.write(list(runs.studies(studies or [])), reports, out)
    for study in left_out:
        echo(f"{study}: left out, it has no results; run `davinci-forces all {study}`", fg="yellow", err=True)
    for file in files:
        echo(f"see {file}")
