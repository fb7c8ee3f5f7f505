"""Simulate a study: logs as the laboratory would have recorded them, and their ground truth."""

from pathlib import Path
from typing import Annotated

import typer

from davinci_forces.runner.console import echo


def run(
    scenario: Annotated[str, typer.Argument(help="A shipped scenario by its name, or the path of a .toml file.")],
    out: Annotated[Path, typer.Argument(help="The folder of the study to be made.")],
    force: Annotated[bool, typer.Option("--force", help="Replace a simulated study that is there already.")] = False,
) -> None:
    """Simulate a scenario and write the study folder OUT: study.toml, the logs, and truth.toml."""
    from davinci_forces.errors import BadRequest
    from davinci_forces.simulation import study_folder
    from davinci_forces.simulation.scenario.reading import load

    study_folder.check(out, force)
    try:
        study_folder.write(load(scenario), out, force, echo)
    except OSError as error:
        raise BadRequest(f"{error.filename}: {error.strerror}") from None
