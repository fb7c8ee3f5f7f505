"""Estimate the contact forces of a da Vinci arm from its motor currents, without a force sensor."""

import atexit
import gc
import os
import re
import signal
import sys
import threading
from _thread import LockType, allocate_lock, start_new_thread
from collections.abc import Iterator
from concurrent.futures import BrokenExecutor
from contextlib import contextmanager
from copy import copy
from importlib import import_module
from inspect import cleandoc
from pathlib import Path
from time import sleep
from typing import Annotated, Any

import typer
from typer import Option
from typer.core import TyperCommand, TyperGroup

from davinci_forces.commands import COMMANDS, Processed, Reports, Studies, StudyFolder
from davinci_forces.errors import PipelineError
from davinci_forces.report import REPORT
from davinci_forces.runner import ALL
from davinci_forces.runner.console import Verbosity, echo
from davinci_forces.runner.processes import arithmetic
from davinci_forces.stages import GROUPS, module

STOP_SIGNALS = signal.SIGINT, signal.SIGTERM
STOP_TIMEOUT = 3.0  # [s] from a stop signal to the forced end of the process
STAGE = "stage"  # name of the command that is copied for every stage and group
FIRST_PANEL, LAST_PANEL = "Start here", "Other commands"  # panels of the help before and after those of the groups
FIRST_COMMANDS = ("all", "new", "inspect", "compare", REPORT, "guide")


class CommandLine(TyperGroup):
    """The command line, with its commands in panels.  The stages share one command under different names and help."""

    def __init__(self, *, commands: dict[str, Any], **attributes: Any) -> None:
        for command in commands.values():
            for element in (command, *command.params):
                if element.help:
                    element.help = escape_tags(element.help)
        stage = commands.pop(STAGE)
        commands[REPORT] = copy_command(stage, REPORT, "davinci_forces.report.report", FIRST_PANEL)
        for group, stages in GROUPS.items():
            if group not in stages:
                commands[group] = copy_command(stage, group, f"davinci_forces.stages.{group}.__init__", group)
            commands |= {name: copy_command(stage, name, module(name), group) for name in stages}
        names = [*FIRST_COMMANDS, *(name for name in commands if name not in COMMANDS), *COMMANDS]
        super().__init__(commands={name: commands[name] for name in names}, **attributes)


def copy_command(command: TyperCommand, name: str, module: str, panel: str) -> TyperCommand:
    """Copy a command into a panel under another name; its help is the docstring of a module.

    The docstring is read from the module's file, since importing all modules would take seconds.
    """
    file = Path(__file__).parent.joinpath(*module.split(".")[1:]).with_suffix(".py")
    docstring = cleandoc(file.read_text(encoding="utf-8").split('"""', 2)[1])
    copied = copy(command)
    copied.name, copied.help, copied.rich_help_panel = name, escape_tags(docstring), panel
    return copied


def escape_tags(text: str) -> str:
    """Escape `<` outside code, because Markdown takes <study> for an HTML tag and omits it."""
    return re.sub(r"(`[^`]*`)|<", lambda match: match[1] or r"\<", text)


app = typer.Typer(
    cls=CommandLine,
    no_args_is_help=True,
    context_settings={"help_option_names": ["-h", "--help"]},
    pretty_exceptions_enable=False,
    rich_markup_mode="markdown",  # the default omits units in square brackets
)

Force = Annotated[bool, Option("--force", help="Run the stages of this command even if they are up to date.")]
Jobs = Annotated[int, Option(min=1, help="Number of processes to run tasks in.")]
Cluster = Annotated[
    str, Option(metavar="ADDRESS", help="Run tasks on the Dask cluster of this scheduler: tcp://host:8786.")
]
DryRun = Annotated[bool, Option("--dry-run", help="Print what would run and why, and change nothing.")]
Quiet = Annotated[bool, Option("--quiet", "-q", help="Print warnings and errors only.")]
Verbose = Annotated[bool, Option("--verbose", "-v", help="Also print the time of each task as it ends.")]


def main() -> None:
    """Run the command line."""
    if sys.getfilesystemencoding() == "ascii" and os.environ.get("PYTHONUTF8") != "1":
        # ASCII cannot represent a file name with an umlaut.  Python restarts, and child processes start, in UTF-8 mode.
        os.execve(sys.executable, [sys.executable, *sys.orig_argv[1:]], os.environ | {"PYTHONUTF8": "1"})
    arithmetic.pin()  # numpy uses one thread, and the same kernels on every machine, here and in child processes
    for stream in (sys.stdout, sys.stderr):
        if hasattr(stream, "reconfigure"):  # the console's encoding may lack characters of names in logs
            stream.reconfigure(errors="replace")
    gc.set_threshold(5000)  # Python's own would search the many objects of the compiler 1000 times, for a second
    atexit.register(gc.freeze)  # or Python would search all objects for cycles as it ends, a tenth of a short command
    atexit.register(ignore_signals)  # a signal that arrives while Python ends would end it without a message
    for number in STOP_SIGNALS:
        if signal.getsignal(number) != signal.SIG_IGN:  # unless ignored already, as in the background of a script
            signal.signal(number, stop)
    try:
        app()
    except Stopped as stopped:
        stopped.say()
        sys.exit(stopped.code)


class Stopped(SystemExit):
    """A signal stopped the run."""

    is_printed = False

    @classmethod
    def say(cls) -> None:
        """Print the message, but only once."""
        if not cls.is_printed:
            cls.is_printed = True
            echo("stopped; run again to continue", err=True)


def ignore_signals() -> None:
    """Ignore further signals that stop a run."""
    for number in STOP_SIGNALS:
        signal.signal(number, signal.SIG_IGN)


def stop(number: int, _: object) -> None:
    """Raise `Stopped` once; if the process still runs after `STOP_TIMEOUT`, end it."""
    ignore_signals()
    sys.unraisablehook = lambda _: None  # a `Stopped` that a destructor raises would only be printed
    threading.excepthook = lambda _: None  # threads may raise because their worker processes end
    begins = allocate_lock()
    begins.acquire()
    start_new_thread(leave, (128 + number, begins))  # `threading.Thread` waits for a lock that this thread may hold
    begins.acquire(timeout=STOP_TIMEOUT)  # Python 3.11.2 crashes if it ends while a thread begins
    raise Stopped(128 + number)


def leave(code: int, begins: LockType) -> None:
    """Release the lock, and end this process after `STOP_TIMEOUT`, even if it waits for something."""
    begins.release()
    sleep(STOP_TIMEOUT)
    Stopped.say()
    os._exit(code)


@contextmanager
def errors_as_messages() -> Iterator[None]:
    """Print errors of the pipeline and of the system without a traceback, and exit with code 1."""
    try:
        yield
        return
    except BrokenPipeError:  # the reader of the output has closed the pipe
        raise
    except PipelineError as error:
        message = f"{error}"
    except OSError as error:
        message = f"{error.filename}: {error.strerror}" if error.filename else f"{error}"
    except UnicodeEncodeError as error:
        excerpt = error.object[max(error.start - 40, 0) : error.end + 40]
        message = f"a name is not in UTF-8: {excerpt!r}; rename the file or the folder"
    except BrokenExecutor:
        lost = "a worker process was killed, perhaps because memory ran out; finished tasks are kept"
        message = f"{lost}; run again with fewer --jobs"
    echo(f"error: {message}", fg="red", err=True)
    raise typer.Exit(1) from None


def print_version(is_requested: bool) -> None:
    """Print the version and exit, if the option is set."""
    if is_requested:
        from davinci_forces import __version__

        echo(f"davinci-forces {__version__}")
        raise typer.Exit


Version = Annotated[
    bool, Option("--version", callback=print_version, is_eager=True, help="Print the version and exit.")
]


@app.callback(help=__doc__)
def options(version: Version = False) -> None:
    """Declare the options of the program itself: only --version, which `print_version` handles."""


def verbosity(quiet: bool, verbose: bool) -> Verbosity:
    """Return the verbosity of a run; raises typer.BadParameter if both options are set."""
    if quiet and verbose:
        raise typer.BadParameter("a run cannot be both --quiet and --verbose; leave one out")
    return "quiet" if quiet else "verbose" if verbose else "normal"


def run_stages(study: Path, names: tuple[str, ...], *options: Any) -> bool:
    """Run stages on one study and return whether all tasks succeeded; errors are printed."""
    from davinci_forces.runner import runs

    try:
        with errors_as_messages():
            return runs.run(study, names, *options)
    except typer.Exit:
        return False


@app.command(STAGE)
@errors_as_messages()
def run_named(
    context: typer.Context, study: StudyFolder, processed: Processed = None, reports: Reports = None,
    force: Force = False, jobs: Jobs = 1, cluster: Cluster = "", quiet: Quiet = False, verbose: Verbose = False,
    dry_run: DryRun = False,
) -> None:  # fmt: skip
    """Run the stage or group that the command is named after, and the stages it needs."""
    from davinci_forces.runner import runs

    level = verbosity(quiet, verbose)
    names = (str(context.command.name),)
    if not run_stages(runs.single_study(study), names, processed, reports, force, jobs, level, dry_run, cluster):
        raise typer.Exit(1)


@app.command("all", rich_help_panel=FIRST_PANEL)
@errors_as_messages()
def run_all(
    studies: Studies = None, processed: Processed = None, reports: Reports = None, force: Force = False,
    jobs: Jobs = 1, cluster: Cluster = "", quiet: Quiet = False, verbose: Verbose = False, dry_run: DryRun = False,
) -> None:  # fmt: skip
    """Run all stages and write the report, for the named studies or for every study in raw/ whose logs exist."""
    from davinci_forces.runner import runs

    level = verbosity(quiet, verbose)
    folders = runs.studies(studies or [], level)
    successes = [run_stages(study, ALL, processed, reports, force, jobs, level, dry_run, cluster) for study in folders]
    if not all(successes):
        raise typer.Exit(1)


for name in COMMANDS:
    command_module = import_module(f"davinci_forces.commands.{name}")
    panel = FIRST_PANEL if name in FIRST_COMMANDS else LAST_PANEL
    command = app.command(name, help=command_module.__doc__, rich_help_panel=panel)
    command(errors_as_messages()(command_module.run))
