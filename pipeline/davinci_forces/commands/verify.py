"""Check that no file of a study was altered or is missing, and that its records give the same report again."""

from typing import Annotated

from typer import Option

from davinci_forces.commands import Processed, Reports, StudyFolder
from davinci_forces.runner.console import echo


def run(
    study: StudyFolder,
    processed: Processed = None,
    reports: Reports = None,
    report_id: Annotated[
        str, Option("--id", help="Check that the study has this report ID, as printed in its report.")
    ] = "",
    again: Annotated[
        bool, Option("--again", help="Recompute everything from raw/ in a temporary folder, and compare.")
    ] = False,
    jobs: Annotated[int, Option(min=1, help="Number of processes to recompute in.")] = 1,
    number: Annotated[
        str, Option("--number", metavar="KEY", help="Trace this number of results.json to its raw files, instead.")
    ] = "",
) -> None:
    """Verify a study; every difference is an error, with exit code 1."""
    from davinci_forces.runner import runs, verification
    from davinci_forces.runner.results.tracing import trace
    from davinci_forces.study import reading

    folders = runs.folders(study, processed, reports)
    if number:
        echo("\n".join(trace(folders, number)))
        return
    pages = not again or verification.has_same_environment(folders)
    verified = verification.verify(reading.read(study), folders, "".join(report_id.split()).lower(), pages)
    files = f"{verified.raw} raw, {verified.processed} processed and {verified.reports} report files are unchanged"
    numbers = f"all {verified.numbers} numbers of results.json agree with their records"
    content = f"writing the {'report' if pages else 'results.json'} again gives the same bytes"
    echo(f"{study}: {files}, {numbers}, and {content}; the report ID is {verified.identity}")
    if verified.unrelated:
        echo(f"{study}: not checked, since they are not part of the results: {', '.join(verified.unrelated)}")
    if again:
        for line in verification.recompute(folders, pages, jobs):
            echo(f"{study}: {line}")
