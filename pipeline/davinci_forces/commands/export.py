"""Export the identified model for an arm's controller, with its errors and its range of validity.

Research use, not a medical device: try it at reduced torque, with the emergency stop in hand. Nothing here
connects to a robot.
"""

from pathlib import Path
from typing import Annotated

from typer import Option

from davinci_forces.commands import Processed, Reports, StudyFolder
from davinci_forces.errors import BadRequest
from davinci_forces.exports import FORMATS
from davinci_forces.files import write_folder
from davinci_forces.runner.console import echo


def run(
    study: StudyFolder,
    to: Annotated[str, Option("--to", metavar="|".join(FORMATS), help=f"Needed: one of {', '.join(FORMATS)}.")] = "",
    out: Annotated[Path | None, Option(help="Folder to write, instead of ./<study>-<format>.")] = None,
    joint: Annotated[
        list[str] | None, Option(help="Export this joint only; may be repeated. Default: all with a model.")
    ] = None,
    replace: Annotated[bool, Option("--replace", help="Replace the folder of an earlier export.")] = False,
    despite_verdict: Annotated[
        bool, Option("--despite-verdict", help="Export a joint with the verdict Problem, or a rejected study.")
    ] = False,
    processed: Processed = None,
    reports: Reports = None,
) -> None:
    """Run all stages that are not up to date, and write a folder of files, whole or not at all."""
    from davinci_forces.exports import renderer
    from davinci_forces.runner import ALL, runs
    from davinci_forces.runner.results.exported import permitted_export

    folders = runs.folders(runs.single_study(study), processed, reports)
    place = out or Path(f"{folders.processed.name}-{to}")
    if to not in FORMATS:
        why = f"there is no format {to!r}" if to else "write --to and a format"
        raise BadRequest(f"{why}; there are {', '.join(FORMATS)}")
    for results in (folders.processed.parent, folders.reports.parent):
        if place.resolve().is_relative_to(results.resolve()):
            raise BadRequest(f"{place} is below {results}, which holds results only; choose another folder")
    if place.exists() and not replace:
        raise BadRequest(f"{place} exists; --replace replaces it, or --out names another folder")
    if not runs.run(folders.raw, ALL, processed, reports):
        raise BadRequest(f"{folders.raw}: a task failed, so nothing is exported; correct its log, or leave it out")
    files, remarks = renderer(to)(permitted_export(folders, joint or [], despite_verdict))
    for remark in remarks:
        echo(remark, err=True, fg="yellow")
    write_folder(place, {name: text.encode() for name, text in files.items()}, replace)
    for name in files:
        echo(f"see {place / name}")
