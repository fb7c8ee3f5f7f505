"""Contact forces of a da Vinci arm from its motor currents, without a force sensor: from logs to a report."""

import os
import re
import signal
import sys
import threading
from _thread import start_new_thread
from collections.abc import Callable, Iterator
from concurrent.futures import BrokenExecutor
from contextlib import contextmanager
from copy import copy
from functools import wraps
from importlib import import_module
from inspect import cleandoc
from pathlib import Path
from time import sleep
from typing import TYPE_CHECKING, Annotated, Any

import typer
from typer.core import TyperCommand, TyperGroup

from davinci_forces.commands import COMMANDS
from davinci_forces.errors import PipelineError
from davinci_forces.report import REPORT
from davinci_forces.runner import ALL
from davinci_forces.runner.console import echo
from davinci_forces.runner.processes import arithmetic
from davinci_forces.stages import GROUPS, module

if TYPE_CHECKING:
    from davinci_forces.runner.console import Verbosity

GRACE = 3.0  # [s] that a run which is stopped has to end by itself
STAGE = "stage"  # what the command that those of stages and groups are copies of is called until then
FIRST, OTHERS = "Start here", "Other commands"  # panels of the help, before those of the groups and after them
BEGIN = ("all", "new", "inspect", "compare", REPORT)


class Stages(TyperGroup):
    """Commands in panels.  Those that run stages differ in name and help only: what they take is read once."""

    def __init__(self, *, commands: dict[str, Any], **attributes: Any) -> None:
        stage = commands.pop(STAGE)
        commands[REPORT] = renamed(stage, REPORT, "davinci_forces.report.report", FIRST)
        for group, stages in GROUPS.items():
            if group not in stages:
                commands[group] = renamed(stage, group, f"davinci_forces.stages.{group}.__init__", group)
            commands |= {name: renamed(stage, name, module(name), group) for name in stages}
        names = [*BEGIN, *(name for name in commands if name not in COMMANDS), *COMMANDS]
        super().__init__(commands={name: commands[name] for name in names}, **attributes)


def renamed(command: TyperCommand, name: str, described: str, panel: str) -> TyperCommand:
    """A command by another name, with the help of a module, in a panel."""
    other = copy(command)
    other.name, other.help, other.rich_help_panel = name, as_written(docstring(described)), panel
    return other


def docstring(module: str) -> str:
    """What a module says of itself, which is what its file begins with; importing all would take seconds."""
    file = Path(__file__).parent.joinpath(*module.split(".")[1:]).with_suffix(".py")
    return cleandoc(file.read_text(encoding="utf-8").split('"""', 2)[1])


def as_written(words: str) -> str:
    """Help that shows `raw/<study>`, which Markdown takes for a tag of HTML and leaves out."""
    return re.sub(r"(`[^`]*`)|<", lambda match: match[1] or r"\<", words)


app = typer.Typer(
    cls=Stages,
    no_args_is_help=True,
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
Cluster = Annotated[
    str, typer.Option(metavar="ADDRESS", help="Scheduler of a Dask cluster to spread the work over: tcp://host:8786.")
]
DryRun = Annotated[bool, typer.Option("--dry-run", help="Say what would run and why, and change nothing.")]
Quiet = Annotated[bool, typer.Option("--quiet", "-q", help="Say only what went wrong, or may have.")]
Verbose = Annotated[bool, typer.Option("--verbose", "-v", help="Say of each task, too, when it is done and its time.")]


class ShownAsWritten(TyperCommand):
    """A command whose help is shown as it was written."""

    def __init__(self, *args: Any, **kwargs: Any) -> None:
        super().__init__(*args, **kwargs)
        for described in (self, *self.params):
            words = getattr(described, "help", None)
            if words and self.rich_markup_mode == "markdown":
                vars(described)["help"] = as_written(words)


def main() -> None:
    """Run the command line."""
    if sys.getfilesystemencoding() == "ascii" and os.environ.get("PYTHONUTF8") != "1":
        # Which names no file with an umlaut.  Anew, as children are, which get the environment.
        os.execve(sys.executable, [sys.executable, *sys.orig_argv[1:]], os.environ | {"PYTHONUTF8": "1"})
    arithmetic.pin()
    for stream in (sys.stdout, sys.stderr):
        if hasattr(stream, "reconfigure"):  # names in logs need not fit the console's encoding
            stream.reconfigure(errors="replace")
    for number in (signal.SIGINT, signal.SIGTERM):
        if signal.getsignal(number) != signal.SIG_IGN:  # as in the background of a script
            signal.signal(number, stop)
    try:
        app()
    except Stopped as stopped:
        stopped.say()
        sys.exit(stopped.code)


class Stopped(SystemExit):
    """A signal asked for the end of the run."""

    said = False

    @classmethod
    def say(cls) -> None:
        """Say so, once."""
        if not cls.said:
            cls.said = True
            echo("stopped; run again to go on", err=True)


def stop(number: int, _: object) -> None:
    """Raise `Stopped`, as often as it may be asked for; and end the process where that does not, or not in time."""
    for each in (signal.SIGINT, signal.SIGTERM):
        signal.signal(each, signal.SIG_IGN)
    sys.unraisablehook = lambda _: None  # where it was raised in vain, as in a destructor
    threading.excepthook = lambda _: None  # of threads whose processes end
    start_new_thread(leave, (128 + number,))  # one of `threading` waits for a lock that this thread may hold
    raise Stopped(128 + number)


def leave(code: int) -> None:
    """End this process after a while, whatever it waits for."""
    sleep(GRACE)
    Stopped.say()
    os._exit(code)


@contextmanager
def messages() -> Iterator[None]:
    """Print what the pipeline raises on purpose, and what the machine refuses, as a message; leave with exit code 1."""
    try:
        yield
    except BrokenPipeError:  # whoever read the output has gone, and needs no message
        raise
    except (PipelineError, OSError) as error:
        echo(f"error: {error}", fg="red", err=True)
        raise typer.Exit(1) from None
    except UnicodeEncodeError as error:
        near = error.object[max(error.start - 40, 0) : error.end + 40]
        echo(f"error: a name is not in UTF-8, near {near!r}; rename the file or the folder", fg="red", err=True)
        raise typer.Exit(1) from None
    except BrokenExecutor:
        says = "a process of this run was ended from outside, perhaps for want of memory; run again with fewer --jobs"
        echo(f"error: {says}: what was finished is kept", fg="red", err=True)
        raise typer.Exit(1) from None


def guarded(run: Callable[..., Any]) -> Callable[..., Any]:
    """A command that ends in a message where it cannot go on."""

    @wraps(run)
    def command(*args: Any, **kwargs: Any) -> Any:
        with messages():
            return run(*args, **kwargs)

    return command


def tell_version(asked: bool) -> None:
    """Print the version, where it is asked for, and leave."""
    if asked:
        from importlib.metadata import version

        echo(f"davinci-forces {version('davinci-forces')}")
        raise typer.Exit


Version = Annotated[
    bool, typer.Option("--version", callback=tell_version, is_eager=True, help="Print the version and leave.")
]


@app.callback(help=__doc__)
def options(version: Version = False) -> None:
    """What holds for every command; the option does its work by itself."""


def verbosity(quiet: bool, verbose: bool) -> "Verbosity":
    """How much a run says.

    Raises
    ------
    typer.BadParameter
        If it is to say both less and more.
    """
    if quiet and verbose:
        raise typer.BadParameter("a run cannot be both --quiet and --verbose; leave one out")
    return "quiet" if quiet else "verbose" if verbose else "normal"


def run_stages(study: Path, names: tuple[str, ...], *how: Any) -> bool:
    """Run stages on one study; whether all went well.  Why they could not run at all is printed."""
    from davinci_forces.runner import runs

    try:
        with messages():
            return runs.run(study, names, *how)
    except typer.Exit:
        return False


@app.command(STAGE, cls=ShownAsWritten)
@guarded
def run_named(
    context: typer.Context,
    study: StudyFolder,
    processed: Processed = None,
    reports: Reports = None,
    force: Force = False,
    jobs: Jobs = 1,
    cluster: Cluster = "",
    quiet: Quiet = False,
    verbose: Verbose = False,
    dry_run: DryRun = False,
) -> None:
    """Run the stage or group whose name the command has, and what it needs."""
    from davinci_forces.runner import runs

    says = verbosity(quiet, verbose)
    names = (str(context.command.name),)
    if not run_stages(runs.one(study), names, processed, reports, force, jobs, says, dry_run, cluster):
        raise typer.Exit(1)


@app.command("all", rich_help_panel=FIRST, cls=ShownAsWritten)
@guarded
def run_all(
    studies: Studies = None,
    processed: Processed = None,
    reports: Reports = None,
    force: Force = False,
    jobs: Jobs = 1,
    cluster: Cluster = "",
    quiet: Quiet = False,
    verbose: Verbose = False,
    dry_run: DryRun = False,
) -> None:
    """Run every stage and the report, on the studies named or on all in raw/ whose logs are there."""
    from davinci_forces.runner import runs

    says = verbosity(quiet, verbose)
    named = runs.studies(studies or [], says)
    good = [run_stages(study, ALL, processed, reports, force, jobs, says, dry_run, cluster) for study in named]
    if not all(good):
        raise typer.Exit(1)


for other in COMMANDS:
    code = import_module(f"davinci_forces.commands.{other}")
    panel = FIRST if other in BEGIN else OTHERS
    app.command(other, help=code.__doc__, rich_help_panel=panel, cls=ShownAsWritten)(guarded(code.run))
