"""What every test may ask for, which tests take long, and how a run speaks of what it did not check."""

import gc
import os
import pickle
import shutil
import signal
import tempfile
import time
from collections import Counter, defaultdict
from collections.abc import Callable, Iterator
from hashlib import sha256
from pathlib import Path
from typing import Any

import pytest
from hypothesis import HealthCheck, settings
from typer.testing import CliRunner

from davinci_forces.runner.processes import arithmetic
from tests.durations import FIRST, MEDIUM, SLOW

if (
    signal.getsignal(signal.SIGINT) == signal.SIG_IGN
):  # as of a run in the background, whose children would pass it over
    signal.signal(signal.SIGINT, signal.default_int_handler)
IN_MEMORY, ROOM = Path("/dev/shm"), 3e9  # [bytes]; a run holds a sixth of it at a time
if "TMPDIR" not in os.environ and IN_MEMORY.is_dir() and shutil.disk_usage(IN_MEMORY).free > ROOM:
    # A run makes and removes 36,000 small files, for which a file system on a disk takes a fifth of the CPU time.
    os.environ["TMPDIR"] = tempfile.tempdir = str(IN_MEMORY)
arithmetic.pin()  # before anything loads numpy, as on the command line
os.environ["MPLBACKEND"] = "Agg"
gc.set_threshold(10_000)  # Python's own costs a twentieth of the time: modules and tests are many objects to search
# How long examples take is a matter of the machine and of what else it does: no test fails of it.
slow_machine = [HealthCheck.too_slow]
settings.register_profile("project", deadline=None, derandomize=True, suppress_health_check=slow_machine)
settings.register_profile("quick", settings.get_profile("project"), max_examples=20)
settings.load_profile("project")

HERE = Path(__file__).parent
ROOT = HERE.parent
BESIDE = ROOT.parent / "shared" / "data"
BENCHMARKS = HERE / "benchmarks"
DRAWN: dict[bytes, dict[str, bytes]] = {}  # the pages of documents, by a hash of what they show
# An arm whose friction the models describe (`matched`), and the same arm with another friction (`realistic`).
TWO_FRICTIONS = str(HERE / "simulation" / "two-frictions.toml")
# A coarser design of a robot: one start of each search of an excitation, and larger tolerances of simulated control.
QUICK_DESIGN = {
    "davinci_forces.stages.design.STARTS": 1,
    "davinci_forces.maths.simulation.continuous.RELATIVE": 1e-4,
    "davinci_forces.maths.simulation.continuous.ABSOLUTE": 1e-6,
}


def pytest_addoption(parser: pytest.Parser) -> None:
    parser.addoption("--slow", action="store_true", help="run the longest studies, too")
    parser.addoption("--approve", action="store_true", help="keep what there is now as what was approved")
    parser.addoption("--full", action="store_true", help="run benchmarks, at their full size")


def pytest_configure(config: pytest.Config) -> None:
    if "not medium" in config.getoption("markexpr") or not config.getoption("--slow"):
        settings.load_profile("quick")


def pytest_ignore_collect(collection_path: Path, config: pytest.Config) -> bool | None:
    """Benchmarks hold on a machine that does nothing else, so they run by themselves: asked for, or named."""
    return True if collection_path == BENCHMARKS and not _benchmarks(config) else None


@pytest.hookimpl(tryfirst=True)
def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    if "PYTEST_XDIST_WORKER" in os.environ:
        items.sort(key=lambda item: FIRST.index(_file(item)) if _file(item) in FIRST else len(FIRST))
    cases: Counter[tuple[str, str]] = Counter()
    for item in items:
        file, test = _file(item), item.name.partition("[")[0]
        if _medium(item):
            item.add_marker(pytest.mark.medium)
        cases[file, test] += 1
        if file in SLOW and (not SLOW[file] or cases[file, test] > SLOW[file].get(test, cases[file, test])):
            item.add_marker(pytest.mark.slow)
        if "slow" in item.keywords and not config.getoption("--slow"):
            item.add_marker(pytest.mark.skip(reason="one of the longest studies; run with --slow"))


def pytest_collection_finish() -> None:
    """Let the collector pass over what was collected of tests and modules, which stays to the end."""
    gc.freeze()


def _medium(item: pytest.Item) -> bool:
    """Whether a test is listed as medium, by its own name or with its whole file."""
    names = MEDIUM.get(_file(item))
    return names is not None and (not names or bool({item.name, item.name.partition("[")[0]} & set(names)))


def _file(item: pytest.Item) -> str:
    """The file of a test within this folder; "" of another folder."""
    return item.path.relative_to(HERE).as_posix() if item.path.is_relative_to(HERE) else ""


def pytest_terminal_summary(terminalreporter: pytest.TerminalReporter, config: pytest.Config) -> None:
    """One line for every test, or file of tests, that was not run, with the reason."""
    skipped = defaultdict(list)
    for report in terminalreporter.stats.get("skipped", ()):
        file, _, name = report.nodeid.partition("::")
        reason = report.longrepr[2] if isinstance(report.longrepr, tuple) else str(report.longrepr)
        skipped[file, reason.removeprefix("Skipped: ")].append(name.partition("[")[0].removeprefix("test_"))
    for (file, reason), names in skipped.items():
        many = list(dict.fromkeys(name.replace("_", " ") for name in names if name))
        what = "all of it" if not many else many[0] if len(many) == 1 else f"{len(names)} tests, {many[0]!r} the first"
        terminalreporter.write_line(f"not checked: {file}: {what} ({reason})")
    left_out = [mark for mark in ("medium", "slow") if f"not {mark}" in config.getoption("markexpr")]
    if left_out:
        terminalreporter.write_line(f"not checked: tests marked {' or '.join(left_out)} (`make test` runs them)")
    if not _benchmarks(config) and HERE.is_relative_to(config.rootpath):
        terminalreporter.write_line("not checked: how fast it is (`make bench` does)")


def _benchmarks(config: pytest.Config) -> bool:
    named = any(Path(argument.partition("::")[0]).resolve().is_relative_to(BENCHMARKS) for argument in config.args)
    return named or bool(config.getoption("--full"))


@pytest.fixture(scope="session")
def data() -> Path:
    """The folder of real recordings, which are not ours to ship; tests on them skip where it is absent."""
    folder = Path(os.environ.get("DAVINCI_FORCES_DATA", BESIDE))
    if not folder.is_dir():
        pytest.skip(f"real recordings are not at {folder}; set DAVINCI_FORCES_DATA to their folder")
    return folder


@pytest.fixture(scope="session")
def analysed(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A small study that every stage has run on; it is made once a run of the tests, and not to be changed."""

    def make(home: Path) -> None:
        from davinci_forces.cli import app
        from tests.arm import write_study

        done = CliRunner().invoke(app, ["all", str(write_study(home / "raw" / "arm"))])
        assert done.exit_code == 0, done.output

    return once(tmp_path_factory, "analysed", make) / "raw" / "arm"


@pytest.fixture(scope="module")
def drawn_once() -> Iterator[None]:
    """Each document is drawn once a process: where a report is made anew, it is nearly always what it was.

    Not where the same data have to give the same pages, in test_runs.py: a page that is remembered is the same anyhow.
    """
    from davinci_forces.report import report

    draw = report.render_all

    def remembered(documents):
        pages = {}
        for document in documents:
            key = sha256(pickle.dumps(document)).digest()
            if key not in DRAWN:
                DRAWN[key] = draw((document,))
            pages |= DRAWN[key]
        return pages

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(report, "render_all", remembered)
        yield


@pytest.fixture(scope="module")
def quick_design() -> Iterator[None]:
    """A coarser design of the robot, for tests on logs, which it does not depend on."""
    with pytest.MonkeyPatch.context() as patch:
        for name, value in QUICK_DESIGN.items():
            patch.setattr(name, value)
        yield


@pytest.fixture(scope="module")
def single_causes() -> Iterator[None]:
    """Causes of innovations that are not white are tried one at a time, for tests that read none of them."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("davinci_forces.filters.innovations.search.MAX_CAUSES", 1)
        yield


@pytest.fixture
def coarse_search() -> Iterator[None]:
    """A coarser search for models, for tests of what does not depend on which model is found."""
    from tests.arm import searched_coarsely

    with searched_coarsely():
        yield


def quick_limits() -> dict[str, Any]:
    """Constants of coarser limits of hands, for tests that read none of these numbers.

    Fewer frequencies of the loop's response, and shorter and fewer trials of whether a hand settles.
    """
    from davinci_forces.haptics.loop import FREQUENCIES

    few = FREQUENCIES[::5]
    return {
        "davinci_forces.haptics.loop.FREQUENCIES": few,
        "davinci_forces.haptics.limits.FREQUENCIES": few,
        "davinci_forces.haptics.loop.SETTLING_PERIODS": 8.0,
        "davinci_forces.haptics.maths.delay.TRIAL_HALVINGS": 2,
    }


def once(factory: pytest.TempPathFactory, name: str, make: Callable[[Path], None]) -> Path:
    """A folder that one of the processes that run the tests fills, and that the others wait for."""
    base = factory.getbasetemp()
    home = (base.parent if "PYTEST_XDIST_WORKER" in os.environ else base) / name
    done, failed = home.with_suffix(".done"), home.with_suffix(".failed")
    try:
        os.close(os.open(home.with_suffix(".begun"), os.O_CREAT | os.O_EXCL))
    except FileExistsError:
        until = time.monotonic() + 600
        while not done.exists():
            if failed.exists() or time.monotonic() > until:
                pytest.fail(f"{name} was not made by the process that began to; its own error says why")
            time.sleep(0.1)
        return home
    try:
        make(home)
    except BaseException:
        failed.touch()
        raise
    done.touch()
    return home
