"""Runs of the stages on studies: where their folders are, which of them can run, and how a run speaks."""

from collections.abc import Iterator, Sequence
from functools import partial
from glob import glob
from pathlib import Path

from davinci_forces.errors import BadRequest, BadStudy, MissingRecord
from davinci_forces.files import read_bytes, text_of
from davinci_forces.report import REPORT
from davinci_forces.runner.console import Verbosity, console, durations, echo
from davinci_forces.runner.execution import Outcome
from davinci_forces.runner.ledger import Folders
from davinci_forces.runner.processes.workers import Others, pool, prepare
from davinci_forces.runner.runner import Runner
from davinci_forces.runner.signature import stage_of
from davinci_forces.study import Study, reading


def folders(study: Path, processed: Path | None, reports: Path | None) -> Folders:
    """The folders of a study: processed/ and reports/ are beside the folder that holds it."""
    home = study.resolve().parent.parent
    name = study.resolve().name
    return Folders(study, (processed or home / "processed") / name, (reports or home / "reports") / name)


def studies(named: Sequence[Path], verbosity: Verbosity = "normal") -> Iterator[Path]:
    """The studies named, patterns expanded, or every one in raw/ whose logs are there.

    Raises
    ------
    BadStudy
        If none is named and raw/ holds none, or a pattern matches none.
    """
    if named:
        yield from (folder for name in named for folder in matching(name))
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
        if len(absent) < study.files:
            yield folder
        elif verbosity != "quiet":
            echo(f"{folder}: skipped, its logs are not here ({absent[0]} ...); study.toml says where to get them")


def matching(name: Path) -> list[Path]:
    """The folders that a name with * or ? stands for, as not every shell expands it; any other name is one folder.

    Raises
    ------
    BadStudy
        If there is no such folder.
    """
    if name.exists() or not set("*?") & set(str(name)):
        return [name]
    folders = [Path(match) for match in sorted(glob(str(name))) if Path(match).is_dir()]
    if not folders:
        raise BadStudy(f"{name}: no folder has a name like this; a study is a folder that holds study.toml")
    return folders


def one(name: Path) -> Path:
    """The one study that a name stands for.

    Raises
    ------
    BadStudy
        If a pattern stands for none, or for several.
    """
    folders = matching(name)
    if len(folders) > 1:
        names = ", ".join(map(str, folders))
        raise BadStudy(f"{name} stands for {len(folders)} studies, {names}: name one of them; `all` takes several")
    return folders[0]


def results_of(name: Path, reports: Path | None = None) -> Path:
    """The results.json that is meant: by its own name, by its report's folder, or by its study.

    Raises
    ------
    BadRequest
        If a folder holds neither a study nor results.
    MissingRecord
        If a study has no results yet.
    """
    if name.exists() and not name.is_dir():
        return name
    folder = one(name)
    if (folder / "study.toml").is_file():
        file = folders(folder, None, reports).reports / "results.json"
        if not file.is_file():
            raise MissingRecord(f"{file} is not there; run `davinci-forces all {folder}`")
        return file
    if (folder / "results.json").is_file():
        return folder / "results.json"
    if folder.is_dir():
        raise BadRequest(f"{folder} holds neither study.toml nor results.json; name a study or a results.json")
    raise BadRequest(f"{name} is not there; name a study, as raw/<study>, or a results.json")


def load(folder: Path) -> Study:
    """Read a study, and warn of outdated settings and of missing files; logs without files will fail, and no other.

    Raises
    ------
    BadStudy
        With every problem at once; that no file at all is there is one.
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
    folder: Path,
    names: Sequence[str],
    processed: Path | None = None,
    reports: Path | None = None,
    force: bool = False,
    jobs: int = 1,
    verbosity: Verbosity = "normal",
    dry_run: bool = False,
    cluster: str = "",
) -> bool:
    """Run stages on one study, and what they need; say what was done, or only what would be; whether all succeeded."""
    study = load(folder)
    speaks = console(verbosity)
    kind = Narrator if verbosity == "verbose" else Runner
    places = folders(folder.resolve() if cluster else folder, processed, reports)
    runner = kind(study, places, speaks, force, Others(partial(pool, jobs), jobs, prepare) if jobs > 1 else None)
    speaks.say(f"{folder}: {study.title}{' (SIMULATED)' if study.simulated else ''}", bold=True)
    if dry_run:
        for line in runner.preview(names):
            speaks.say(line)
        return True
    good = run_on_cluster(runner, names, cluster) if cluster else runner.run(names)
    if not runner.ran:
        speaks.say(f"{folder}: nothing to do, every stage is current")
    if REPORT in names:
        conclude(runner, folder)
    if not good:
        echo(f"{folder}: {runner.failures} of {runner.ran} tasks failed", fg="red", err=True)
    return good


def run_on_cluster(runner: Runner, names: Sequence[str], address: str) -> bool:
    """Run stages with the workers of a Dask cluster; raises as `connected` does, and as any run."""
    from davinci_forces.runner.processes.cluster import connected, perform_there

    with connected(address, runner.folders) as (executor, hands, terms):
        runner.others, runner.perform = Others(lambda: executor, hands), partial(perform_there, terms)
        return runner.run(names)


def conclude(runner: Runner, folder: Path) -> None:
    """Say what came out: the answer, how long it took, and where it is; of a report that failed, only the time."""
    report = runner.ledger.entry(REPORT, REPORT)
    files = report.outputs if report and not report.failed else {}
    if "reports/summary.txt" in files:
        runner.console.say(text_of(read_bytes(runner.folders.reports / "summary.txt")).rstrip())
    if runner.ran:
        runner.console.say(durations(runner.seconds))
    for file in ("report.html", "report.pdf", "robot.html", "results.json"):
        if f"reports/{file}" in files:
            runner.console.say(f"{folder}: see {runner.folders.reports / file}")


class Narrator(Runner):
    """A runner that says of every task, too, when it is done, and how long it took."""

    def _record(self, outcome: Outcome) -> None:
        self.console.say(f"{stage_of(outcome.task.step)}: {outcome.task.name}: took {outcome.seconds:.2f} s")
        super()._record(outcome)
