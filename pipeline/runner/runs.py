"""Runs of the stages on studies: where their folders are, which of them can run, and how a run speaks."""

import sys
from collections.abc import Iterator, Sequence
from pathlib import Path

import typer

from pipeline.errors import BadStudy
from pipeline.runner.ledger import Folders
from pipeline.runner.runner import Console, Runner
from pipeline.study import Study, reading


def folders(study: Path, processed: Path | None, reports: Path | None) -> Folders:
    """The folders of a study: processed/ and reports/ are beside the folder that holds it."""
    home = study.resolve().parent.parent
    name = study.resolve().name
    return Folders(study, (processed or home / "processed") / name, (reports or home / "reports") / name)


def studies(named: Sequence[Path]) -> Iterator[Path]:
    """The studies named, or every one in raw/ whose logs are there.

    Raises
    ------
    BadStudy
        If none is named and raw/ holds none.
    """
    if named:
        yield from named
        return
    found = sorted(file.parent for file in Path("raw").glob("*/study.toml"))
    if not found:
        raise BadStudy("raw/ holds no study; `davinci-forces new` writes one from a log")
    for folder in found:
        try:
            study = reading.read(folder)
        except BadStudy:  # its run says what is wrong with it
            yield folder
            continue
        absent = study.absent()
        if len(absent) == study.files:
            typer.echo(f"{folder}: skipped, its logs are not here ({absent[0]} ...); study.toml says where to get them")
        else:
            yield folder


def load(folder: Path) -> Study:
    """Read a study, and say which files of its logs are not there; those logs will fail, and no other.

    Raises
    ------
    BadStudy
        With every problem at once; that no file at all is there is one.
    """
    study = reading.read(folder)
    absent = study.absent()
    lines = [f"{folder / 'study.toml'}: file {name!r} is not in {folder}" for name in absent]
    if len(absent) == study.files:
        raise BadStudy("\n".join(lines))
    for line in lines:
        typer.secho(f"warning: {line}", fg="yellow", err=True)
    return study


def run(
    folder: Path, names: Sequence[str], processed: Path | None, reports: Path | None, force: bool, jobs: int
) -> bool:
    """Run stages on one study and say what was done; whether every task succeeded."""
    study = load(folder)
    runner = Runner(study, folders(folder, processed, reports), console(), force, jobs)
    typer.secho(f"{folder}: {study.title}{' (SIMULATED)' if study.simulated else ''}", bold=True)
    good = runner.run(names)
    if not runner.ran:
        typer.echo(f"{folder}: nothing to do, every stage is current")
    for file in ("report.html", "report.pdf"):
        made = runner.folders.reports / file
        if "report" in names and made.exists():
            typer.echo(f"{folder}: see {made}")
    if not good:
        typer.secho(f"{folder}: {runner.failures} of {runner.ran} tasks failed", fg="red", err=True)
    return good


def console() -> Console:
    """Lines for a log; on a terminal, a bar as well."""

    def progress(stage: str, done: int, total: int) -> None:
        if sys.stderr.isatty():
            width = 30
            full = width * done // total
            end = "\n" if done == total else ""
            sys.stderr.write(f"\r{stage:14s} [{'#' * full}{'.' * (width - full)}] {done}/{total}{end}")
            sys.stderr.flush()

    return Console(typer.echo, lambda line: typer.secho(line, fg="yellow", err=True), progress)
