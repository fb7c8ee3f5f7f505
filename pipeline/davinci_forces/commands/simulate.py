"""Simulate a study: logs as a laboratory would record them, and their ground truth."""

from pathlib import Path
from typing import Annotated

from typer import Argument, Option

from davinci_forces.runner.console import echo


def run(
    scenario: Annotated[str, Argument(help="Name of a shipped scenario, or path of a .toml file.")],
    out: Annotated[Path, Argument(help="Folder of the new study.")],
    force: Annotated[bool, Option("--force", help="Replace an existing simulated study.")] = False,
) -> None:
    """Write study.toml, logs and truth.toml of a scenario; beside its own study.toml, only the logs and truth.toml."""
    from davinci_forces.simulation import study_folder
    from davinci_forces.simulation.scenario.reading import load

    study_folder.check(out, force)
    study_folder.write(load(scenario), out, force, echo)
