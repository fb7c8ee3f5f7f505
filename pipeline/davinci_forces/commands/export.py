"""Export the identified model for an arm's controller: a file of numbers, with its errors and its range of validity.

Research use, not a medical device: try at reduced effort with the stop in hand. Nothing here connects to a robot.
"""

from pathlib import Path
from typing import Annotated

import typer

from davinci_forces.exports import FORMATS
from davinci_forces.runner.console import echo


def run(
    study: Annotated[Path, typer.Argument(help="Folder of a study: raw/<study>, with its study.toml.")],
    to: Annotated[str, typer.Option("--to", metavar="FORMAT", help=f"Format: {', '.join(FORMATS)}.")],
    out: Annotated[Path | None, typer.Option(help="Folder to write, instead of ./<study>-<format>.")] = None,
    joint: Annotated[
        list[str] | None, typer.Option(help="Export this joint only; may be repeated. Default: all with a model.")
    ] = None,
    replace: Annotated[bool, typer.Option("--replace", help="Replace the folder of an earlier export.")] = False,
    despite_verdict: Annotated[
        bool, typer.Option("--despite-verdict", help="Export a joint with the verdict Problem, or a rejected study.")
    ] = False,
    processed: Annotated[
        Path | None, typer.Option(help="Folder for processed files, instead of processed/ next to raw/.")
    ] = None,
    reports: Annotated[Path | None, typer.Option(help="Folder for reports, instead of reports/ next to raw/.")] = None,
) -> None:
    """Run all stages that are not up to date, and write a folder of files, whole or not at all."""
    from davinci_forces.runner import exporting, runs

    raw = runs.single_study(study)
    folder = out or Path(f"{raw.resolve().name}-{to}")
    for file in exporting.export(
        runs.folders(raw, processed, reports), to, folder, joint or (), replace, despite_verdict
    ):
        echo(f"see {file}")
