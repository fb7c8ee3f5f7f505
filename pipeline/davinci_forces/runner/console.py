"""Output of a run: lines, on a terminal also a progress bar, and at the end the answer, times and files."""

import atexit
import sys
from collections.abc import Callable, Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING, Any, ClassVar, Literal

import typer

from davinci_forces.files import table as table
from davinci_forces.files import visible

if TYPE_CHECKING:
    from rich.progress import Progress

Verbosity = Literal["quiet", "normal", "verbose"]


@dataclass
class Console:
    """Functions that print the lines, the warnings and the progress of a run."""

    say: Callable[..., None]  # a line and its style
    warn: Callable[[str], None]
    progress: Callable[[str, int, int], None] = lambda stage, done, total: None
    is_verbose: bool = False  # also print the time of each task as it ends


def console(verbosity: Verbosity) -> Console:
    """Console of a verbosity.  Warnings are always printed; only a terminal gets the progress bar."""
    bar = Bar() if verbosity == "normal" and sys.stderr.isatty() else None

    def say(line: str, **style: Any) -> None:
        if verbosity != "quiet":
            echo(line, **style)

    warn = partial(echo, err=True, fg="yellow")
    return Console(say, warn, bar.show) if bar else Console(say, warn, is_verbose=verbosity == "verbose")


class Bar:
    """Progress bar of a stage on the last line of a terminal, removed when the stage is done."""

    _progress: "Progress | None" = None

    def show(self, stage: str, done: int, total: int) -> None:
        """Draw the bar of a stage, and remove it with its last task."""
        if self._progress is None:
            from rich.console import Console as Terminal
            from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn

            columns = (TextColumn("{task.description:14s}"), BarColumn(), MofNCompleteColumn(), TimeRemainingColumn())
            self._progress = Progress(*columns, console=Terminal(stderr=True), transient=True)
            self._progress.add_task(stage, total=total)
            self._progress.start()
            atexit.register(self._progress.stop)  # restores the cursor if the run is stopped
        self._progress.update(self._progress.task_ids[0], completed=done)
        if done == total:
            self._progress.stop()
            self._progress = None


def durations(seconds: dict[str, float]) -> str:
    """Total time of a run and of each stage that took at least 0.1 s."""
    long = [f"{name} {duration:.1f} s" for name, duration in seconds.items() if duration >= 0.1]
    return f"took {sum(seconds.values()):.1f} s" + (f": {', '.join(long)}" if long else "")


def echo(text: str, err: bool = False, **style: Any) -> None:
    """Print a text, with control characters escaped and `?` for characters that the terminal's encoding lacks."""
    text, encoding = visible(text, "\n\t"), (sys.stderr if err else sys.stdout).encoding or "utf-8"
    with suppress(LookupError):
        text = text.encode(encoding, "replace").decode(encoding)
    typer.secho(text, err=err, **style)


def shorten(names: Sequence[str], most: int = 3) -> str:
    """The first of many names, and the number of the others."""
    return ", ".join(names[:most]) + (f" and {len(names) - most} more" if len(names) > most else "")


def show_markdown(text: str) -> None:
    """Print Markdown, laid out for the width of the terminal, with code as it is; a pipe gets it without colours."""
    from rich.console import Console as Terminal
    from rich.markdown import CodeBlock, Markdown, TableElement
    from rich.syntax import Syntax

    class Folded(TableElement):
        """A table that is too wide breaks its words instead of cutting them."""

        def __rich_console__(self, *about: Any) -> Iterator[Any]:
            for element in super().__rich_console__(*about):
                for column in element.columns:  # type: ignore[union-attr]
                    column.overflow = "fold"
                yield element

    class Whole(CodeBlock):
        """Code whose lines are not broken, as a broken comment would be code."""

        def __rich_console__(self, *about: Any) -> Iterator[Any]:
            code = Syntax("", self.lexer_name, theme=self.theme).highlight(str(self.text).rstrip())
            code.no_wrap, code.overflow = True, "ignore"
            yield code

    class Page(Markdown):
        elements: ClassVar = Markdown.elements | {"table_open": Folded, "fence": Whole, "code_block": Whole}

    Terminal().print(Page(visible(text, "\n\t")), crop=False)
