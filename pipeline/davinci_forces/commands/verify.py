"""Check that files are what they were when they were made, that nothing is missing, and make the report anew."""

from pathlib import Path
from typing import Annotated

import typer

from davinci_forces.runner.console import echo


def run(
    study: Annotated[Path, typer.Argument(help="Folder of a study: raw/<study>, which holds study.toml.")],
    processed: Annotated[Path | None, typer.Option(help="Folder for processed files, where not beside raw/.")] = None,
    reports: Annotated[Path | None, typer.Option(help="Folder for reports, where not beside raw/.")] = None,
    wanted: Annotated[
        str, typer.Option("--id", help="The report ID on a printed page that these files have to have.")
    ] = "",
    again: Annotated[
        bool, typer.Option("--again", help="Recompute everything from raw/ in a temporary folder, and compare.")
    ] = False,
    jobs: Annotated[int, typer.Option(min=1, help="Processes to recompute with.")] = 1,
) -> None:
    """Verify a study; what differs is named, and the exit code is 1."""
    from davinci_forces.runner import recomputation, runs, verification
    from davinci_forces.study import reading

    folders = runs.folders(study, processed, reports)
    pages = not again or recomputation.has_same_environment(folders)
    verified = verification.verify(reading.read(study), folders, "".join(wanted.split()).lower(), pages)
    echo(
        f"{study}: {verified.raw} raw, {verified.processed} processed and {verified.reports} report files are "
        f"unchanged, all {verified.numbers} numbers of results.json are those of their records, and the "
        f"{'report' if pages else 'results.json'} made anew is the same; its ID is {verified.identity}"
    )
    if verified.unrelated:
        echo(f"{study}: not compared, since they are no part of the results: {', '.join(verified.unrelated)}")
    if again:
        for line in recomputation.recompute(folders, pages, jobs):
            echo(f"{study}: {line}")
