"""Put many studies on one page, HTML and PDF: parameters over time, floors, verdicts, and what drifts or stands out."""

from pathlib import Path
from typing import Annotated

import typer

from davinci_forces.runner.console import echo


def run(
    studies: Annotated[
        list[Path] | None, typer.Argument(help="Folders of studies; all in raw/ where none is named.")
    ] = None,
    reports: Annotated[Path | None, typer.Option(help="Folder for reports, where not beside raw/.")] = None,
    out: Annotated[
        Path | None, typer.Option(help="Folder for campaign.html and campaign.pdf; else that of reports.")
    ] = None,
) -> None:
    """Write campaign.html and campaign.pdf from the reports that there are; studies without one are named."""
    from davinci_forces.runner import runs
    from davinci_forces.runner.results import campaign

    files, left_out = campaign.write(list(runs.studies(studies or [])), reports, out)
    for study in left_out:
        echo(f"{study}: left out, as it has no results; run `davinci-forces all {study}`", fg="yellow", err=True)
    for file in files:
        echo(f"see {file}")
