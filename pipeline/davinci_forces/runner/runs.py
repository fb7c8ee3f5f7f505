"""Run the stages on studies: find their folders and logs, run, and print the results."""

from collections.abc import Iterator, Sequence
from contextlib import suppress
from functools import partial
from glob import glob
from pathlib import Path

from davinci_forces.errors import BadRequest, BadStudy, MissingRecord
from davinci_forces.files import read_bytes, text_of
from davinci_forces.records.record import first_of_each_kind
from davinci_forces.report import REPORT
from davinci_forces.runner.console import Verbosity, console, durations, echo
from davinci_forces.runner.ledger import Folders
from davinci_forces.runner.processes.workers import WorkerPool, pool, prepare
from davinci_forces.runner.runner import Runner
from davinci_forces.study import Study, reading

MAX_REPEATED = 10  # warnings that are printed once more at the end of a run


def folders(study: Path, processed: Path | None, reports: Path | None) -> Folders:
    """The folders of a study; by default, processed/ and reports/ are next to the folder that contains the study."""
    home = study.resolve().parent.parent
    name = study.resolve().name
    return Folders(study, (processed or home / "processed") / name, (reports or home / "reports") / name)


def studies(names: Sequence[Path], verbosity: Verbosity = "normal") -> Iterator[Path]:
    """The folders of the named studies, patterns expanded; without names, of all studies in raw/ that have logs.

    Raises BadStudy if there is no name and no study in raw/, or a pattern matches no folder.
    """
    if names:
        yield from (folder for name in names for folder in expand_pattern(name))
        return
    folders = sorted(file.parent for file in Path("raw").glob("*/study.toml"))
    if not folders:
        raise BadStudy("raw/ holds no study; write one with `davinci-forces new raw/<study>/<log>`")
    skipped: dict[str, list[Path]] = {}
    for folder in folders:
        with suppress(BadStudy):  # its run prints the error
            study = reading.read(folder)
            if len(study.absent()) == study.files:
                skipped.setdefault(_source(study), []).append(folder)
    for source, absent in skipped.items() if verbosity != "quiet" else ():
        whose = "their" if absent[1:] else "its"
        echo(f"{', '.join(map(str, absent))}: skipped, as none of {whose} logs is here; {source}")
    yield from (folder for folder in folders if not any(folder in absent for absent in skipped.values()))


def _source(study: Study) -> str:
    """Where the logs of a study come from: a shipped scenario of its name, or what its study.toml says."""
    from davinci_forces.simulation.scenario.reading import shipped_scenarios

    name = study.folder.name
    if study.simulated and name in shipped_scenarios():
        return f"`davinci-forces simulate {name} {study.folder}` writes them"
    return "the study.toml of each says where to get them"


def expand_pattern(name: Path) -> list[Path]:
    """The folders that a name with * or ? matches, or that of any other name; raises BadStudy if none matches."""
    if name.exists() or not set("*?") & set(str(name)):
        return [name]
    folders = [Path(match) for match in sorted(glob(str(name))) if Path(match).is_dir()]
    if not folders:
        raise BadStudy(f"{name}: no folder matches; a study is a folder that holds study.toml")
    return folders


def single_study(name: Path) -> Path:
    """The folder of the one study that a name or pattern matches; raises BadStudy if it matches none or several."""
    folders = expand_pattern(name)
    if len(folders) > 1:
        names = ", ".join(map(str, folders))
        raise BadStudy(f"{name} matches {len(folders)} studies, {names}: name one of them; `all` takes several")
    return folders[0]


def results_of(name: Path, reports: Path | None = None) -> Path:
    """The results.json of a name, report folder or study; raises MissingRecord if a study has none, or BadRequest."""
    if name.exists() and not name.is_dir():
        return name
    folder = single_study(name)
    if (folder / "study.toml").is_file():
        file = folders(folder, None, reports).reports / "results.json"
        if not file.is_file():
            raise MissingRecord(f"{file} does not exist; run `davinci-forces all {folder}`")
        return file
    if (folder / "results.json").is_file():
        return folder / "results.json"
    if folder.is_dir():
        raise BadRequest(f"{folder} holds neither study.toml nor results.json; name a study or a results.json")
    raise BadRequest(f"{name} does not exist; name a study, as raw/<study>, or a results.json")


def load(folder: Path) -> Study:
    """Read a study, and warn of outdated settings and missing files; the logs of missing files will fail.

    Raises BadStudy with all problems at once, or if all files are missing.
    """
    study = reading.read(folder)
    absent = study.absent()
    lines = [f"{folder / 'study.toml'}:{study.lines[name]}: file {name!r} is not in {folder}" for name in absent]
    if len(absent) == study.files:
        raise BadStudy("\n".join(lines))
    for line in (*study.remarks, *lines):
        echo(f"warning: {line}", fg="yellow", err=True)
    return study


def run(
    folder: Path, names: Sequence[str], processed: Path | None = None, reports: Path | None = None,
    force: bool = False, jobs: int = 1, verbosity: Verbosity = "normal", dry_run: bool = False, cluster: str = "",
) -> bool:  # fmt: skip
    """Run stages of one study and the stages that they need, or preview the run; return whether all tasks succeeded."""
    study = load(folder)
    terminal = console(verbosity)
    places = folders(folder.resolve() if cluster else folder, processed, reports)
    others = WorkerPool(partial(pool, jobs), jobs, prepare) if jobs > 1 else None
    runner = Runner(study, places, terminal, force, others)
    terminal.say(f"{folder}: {study.title}{' (SIMULATED)' if study.simulated else ''}", bold=True)
    if dry_run:
        for line in runner.preview(names):
            terminal.say(line)
        return True
    if cluster:
        from davinci_forces.runner.processes.cluster import connect, perform_there

        with connect(cluster, places) as (executor, hands, terms):
            runner.others, runner.perform = WorkerPool(lambda: executor, hands), partial(perform_there, terms)
            succeeded = runner.run(names)
    else:
        succeeded = runner.run(names)
    if not runner.ran:
        terminal.say(f"{folder}: nothing to do, all stages are up to date")
    if REPORT in names:
        print_results(runner, folder)
    if not succeeded:
        echo(f"{folder}: {runner.failures} of {runner.ran} tasks failed", fg="red", err=True)
    return succeeded


def print_results(runner: Runner, folder: Path) -> None:
    """Print the answer of the report, the times and the report's files; after a failed report only the times."""
    report = runner.ledger.entry(REPORT, REPORT)
    files = report.outputs if report and not report.failed else {}
    if "reports/summary.txt" in files:
        runner.console.say(text_of(read_bytes(runner.folders.reports / "summary.txt")).rstrip())
    if runner.ran:
        runner.console.say(durations(runner.seconds))
    earlier = [line for line in runner.warnings if not line.startswith(f"{REPORT}: ")]  # those are right above
    if len(earlier) > 1:
        kinds = "warnings and errors" if any(": error: " in line for line in earlier) else "warnings"
        runner.console.warn(f"the {kinds} of this run once more, one of each kind:")
        remarks = ((": ".join(stage), text) for *stage, text in (line.split(": ", 2) for line in earlier))
        lines = [f"  {stage}: {text}" for stage, text in first_of_each_kind(remarks)]
        more = [f"  and {len(lines) - MAX_REPEATED} more, above"] if lines[MAX_REPEATED:] else []
        for line in (*lines[:MAX_REPEATED], *more):
            runner.console.warn(line)
    for file in ("report.html", "report.pdf", "robot.html", "results.json"):
        if f"reports/{file}" in files:
            runner.console.say(f"{folder}: see {runner.folders.reports / file}")
