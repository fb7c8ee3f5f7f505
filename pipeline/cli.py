"""Contact forces of a da Vinci arm from its motor currents, without a force sensor: from logs to a report."""

import ast
import sys
from collections.abc import Callable, Iterator
from concurrent.futures import BrokenExecutor
from contextlib import contextmanager
from functools import wraps
from importlib import import_module
from pathlib import Path
from typing import Annotated, Any

import typer

from pipeline.commands import COMMANDS
from pipeline.errors import PipelineError
from pipeline.stages import STAGES

app = typer.Typer(
    no_args_is_help=True,
    add_completion=False,
    help=__doc__,
    context_settings={"help_option_names": ["-h", "--help"]},
    pretty_exceptions_enable=False,
    rich_markup_mode="markdown",  # the default swallows units in square brackets
)

StudyFolder = Annotated[Path, typer.Argument(help="Folder of a study: raw/<study>, which holds study.toml.")]
Studies = Annotated[list[Path] | None, typer.Argument(help="Folders of studies; all in raw/ where none is named.")]
Processed = Annotated[Path | None, typer.Option(help="Folder for processed files, instead of processed/ beside raw/.")]
Reports = Annotated[Path | None, typer.Option(help="Folder for reports, instead of reports/ beside raw/.")]
Force = Annotated[bool, typer.Option("--force", help="Run what is current, too.")]
Jobs = Annotated[int, typer.Option(min=1, help="Processes to spread the work over.")]


def main() -> None:
    """Run the command line."""
    for stream in (sys.stdout, sys.stderr):
        if hasattr(stream, "reconfigure"):  # names in logs need not fit the console's encoding
            stream.reconfigure(errors="replace")
    app()


@contextmanager
def messages() -> Iterator[None]:
    """Print what the pipeline raises on purpose, and what the machine refuses, as a message; leave with exit code 1."""
    try:
        yield
    except BrokenPipeError:  # whoever read the output has gone, and needs no message
        raise
    except (PipelineError, OSError) as error:
        typer.secho(f"error: {error}", fg="red", err=True)
        raise typer.Exit(1) from None
    except BrokenExecutor:
        says = "a process of this run was ended from outside, perhaps for want of memory; run again with fewer --jobs"
        typer.secho(f"error: {says}: what was finished is kept", fg="red", err=True)
        raise typer.Exit(1) from None


def guarded(run: Callable[..., Any]) -> Callable[..., Any]:
    """A command that ends in a message where it cannot go on."""

    @wraps(run)
    def command(*args: Any, **kwargs: Any) -> Any:
        with messages():
            return run(*args, **kwargs)

    return command


def run_stages(
    study: Path, names: tuple[str, ...], processed: Path | None, reports: Path | None, force: bool, jobs: int
) -> bool:
    """Run stages on one study; whether all went well.  Why they could not run at all is printed."""
    from pipeline.runner import runs

    try:
        with messages():
            return runs.run(study, names, processed, reports, force, jobs)
    except typer.Exit:
        return False


def add_stage(name: str) -> None:
    """Make a stage a command of the same name, explained by its own docstring."""

    @app.command(name, help=docstring(f"stages/{name}"), rich_help_panel="Stages, in order")
    @guarded
    def command(
        study: StudyFolder,
        processed: Processed = None,
        reports: Reports = None,
        force: Force = False,
        jobs: Jobs = 1,
    ) -> None:
        if not run_stages(study, (name,), processed, reports, force, jobs):
            raise typer.Exit(1)


@app.command("all", rich_help_panel="Stages, in order")
@guarded
def run_all(
    studies: Studies = None,
    processed: Processed = None,
    reports: Reports = None,
    force: Force = False,
    jobs: Jobs = 1,
) -> None:
    """Run every stage, on the studies named or on all in raw/ whose logs are there."""
    from pipeline.runner import runs

    good = [run_stages(study, STAGES, processed, reports, force, jobs) for study in runs.studies(studies or [])]
    if not all(good):
        raise typer.Exit(1)


def docstring(module: str) -> str:
    """What a module says of itself, without importing it."""
    file = Path(__file__).parent / f"{module}.py"
    return ast.get_docstring(ast.parse(file.read_text(encoding="utf-8"))) or ""


for stage in STAGES:
    add_stage(stage)
for other in COMMANDS:
    module = import_module(f"pipeline.commands.{other}")
    app.command(other, help=module.__doc__, rich_help_panel="Other commands")(guarded(module.run))
