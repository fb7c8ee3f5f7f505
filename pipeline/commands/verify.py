"""Check that raw files, processed files and every number of the report are what they were when it was made."""

from pathlib import Path
from typing import Annotated

import typer


def run(
    study: Annotated[Path, typer.Argument(help="Folder of a study: raw/<study>, which holds study.toml.")],
    processed: Annotated[Path | None, typer.Option(help="Folder for processed files, where not beside raw/.")] = None,
    reports: Annotated[Path | None, typer.Option(help="Folder for reports, where not beside raw/.")] = None,
) -> None:
    """Verify a study; what differs is named, and the exit code is 1."""
    from pipeline.runner import runs, verification

    counts = verification.verify(runs.folders(study, processed, reports))
    typer.echo(
        f"{study}: {counts.raw} raw, {counts.processed} processed and {counts.reports} report files are unchanged, and "
        f"all {counts.numbers} numbers of results.json are those of their sources"
    )
