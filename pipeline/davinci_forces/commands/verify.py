"""Check that files are what they were when they were made, that nothing is missing, and make the report anew."""

from pathlib import Path
from typing import Annotated

import typer


def run(
    study: Annotated[Path, typer.Argument(help="Folder of a study: raw/<study>, which holds study.toml.")],
    processed: Annotated[Path | None, typer.Option(help="Folder for processed files, where not beside raw/.")] = None,
    reports: Annotated[Path | None, typer.Option(help="Folder for reports, where not beside raw/.")] = None,
    wanted: Annotated[
        str, typer.Option("--id", help="The report ID on a printed page that these files have to have.")
    ] = "",
) -> None:
    """Verify a study; what differs is named, and the exit code is 1."""
    from davinci_forces.runner import runs, verification
    from davinci_forces.study import reading

    found = verification.verify(
        reading.read(study), runs.folders(study, processed, reports), "".join(wanted.split()).lower()
    )
    typer.echo(
        f"{study}: {found.raw} raw, {found.processed} processed and {found.reports} report files are unchanged, all "
        f"{found.numbers} numbers of results.json are those of their records, and the report made anew is the same; "
        f"its ID is {found.identity}"
    )
