"""How a run speaks: lines for a log, on a terminal a bar as well, and at its end the answer, times and files."""

import atexit
import sys
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Literal

import typer

from davinci_forces.files import visible

if TYPE_CHECKING:
    from rich.progress import Progress

Verbosity = Literal["quiet", "normal", "verbose"]


@dataclass
class Console:
    """How a run speaks: a line at a time, and how far it is."""

    say: Callable[..., None]  # a line, and how it looks
    warn: Callable[[str], None]
    progress: Callable[[str, int, int], None] = lambda stage, done, total: None


def console(verbosity: Verbosity) -> Console:
    """Lines for a log; on a terminal, a bar as well.  Warnings are never left out."""
    bar = Bar() if verbosity == "normal" and sys.stderr.isatty() else None

    def say(line: str, **looks: Any) -> None:
        if verbosity != "quiet":
            echo(line, **looks)

    def warn(line: str) -> None:
        echo(line, err=True, fg="yellow")

    return Console(say, warn, bar.show) if bar else Console(say, warn)


class Bar:
    """How far a stage is, on the last line of a terminal; gone when the stage is done."""

    def __init__(self) -> None:
        self._progress: Progress | None = None

    def show(self, stage: str, done: int, total: int) -> None:
        """Draw the bar of a stage, and take it away with its last task."""
        if self._progress is None:
            self._progress = self._new(stage, total)
        self._progress.update(self._progress.task_ids[0], completed=done)
        if done == total:
            self._progress.stop()
            self._progress = None

    @staticmethod
    def _new(stage: str, total: int) -> "Progress":
        from rich.console import Console as Terminal
        from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn

        columns = (TextColumn("{task.description:14s}"), BarColumn(), MofNCompleteColumn(), TimeRemainingColumn())
        progress = Progress(*columns, console=Terminal(stderr=True), transient=True)
        progress.add_task(stage, total=total)
        progress.start()
        atexit.register(progress.stop)  # which gives the cursor back where a run is stopped
        return progress


def durations(seconds: dict[str, float]) -> str:
    """How long each stage took, those of under a tenth of a second left out."""
    long = [f"{name} {took:.1f} s" for name, took in seconds.items() if took >= 0.1]
    return f"took {sum(seconds.values()):.1f} s" + (f": {', '.join(long)}" if long else "")


def echo(text: str, err: bool = False, **looks: Any) -> None:
    """Print a text as this terminal can show it: what it would obey written out, and letters where it has no marks."""
    text, encoding = visible(text, "\n\t"), (sys.stderr if err else sys.stdout).encoding or "utf-8"
    with suppress(LookupError):
        text = text.encode(encoding, "replace").decode(encoding)
    typer.secho(text, err=err, **looks)
