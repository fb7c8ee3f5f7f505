"""What machines do to a run: disks that are full or read-only, links, names and files that are too long."""

import os
import re
import shutil
import signal
import subprocess
import sys
import time
from contextlib import suppress
from pathlib import Path

import numpy as np
import pyarrow.csv
import pytest
from pyarrow import parquet

from davinci_forces.files import PARTIAL
from tests.test_robustness import analysed, finished, flat, raw, small  # noqa: F401 - fixtures
from tests.test_runs import call, contents, edit, processed, reports
from tests.test_workers import end_within

pytestmark = pytest.mark.usefixtures("drawn_once")
LIMITED = """
import resource, sys
resource.setrlimit(resource.RLIMIT_FSIZE, (int(sys.argv[1]),) * 2)
sys.argv = ["davinci-forces", *sys.argv[2:]]
from davinci_forces.cli import main
main()
"""


def partial_files(folder: Path) -> list[Path]:
    return [file for file in folder.rglob("*") if file.name.endswith(PARTIAL)]


@pytest.mark.skipif(sys.platform == "win32", reason="no limits of file sizes")
@pytest.mark.parametrize("largest", [3000, 9000])
def test_a_disk_that_takes_no_more_is_said_and_leaves_no_partial_file(raw, largest):  # noqa: F811
    """Files may not grow beyond a size, as on a full disk: a record cannot be finished, nor a diagnostic."""
    folder = small(raw / "lab", ("one",))
    command = [sys.executable, "-c", LIMITED, str(largest), "ingest", str(folder)]
    environment = os.environ | {"PYTHONDONTWRITEBYTECODE": "1"}  # Python would keep modules that were cut
    ran = subprocess.run(command, capture_output=True, text=True, check=False, env=environment)
    assert ran.returncode == 1
    assert "File too large" in ran.stderr
    assert "fault of davinci-forces" not in ran.stderr
    assert "Traceback" not in ran.stderr
    assert "Exception ignored" not in ran.stderr
    assert not partial_files(processed(folder))
    call("ingest", folder)
    assert (processed(folder) / "recording" / "one" / "hand_roll.parquet").exists()


def test_a_report_that_failed_once_is_the_same_as_that_of_a_clean_run(finished, monkeypatch):  # noqa: F811
    folder = finished
    clean = contents(reports(folder)), contents(processed(folder))

    def fail(*_):
        raise OSError(28, "No space left on device")

    for page in reports(folder).iterdir():
        page.unlink()
    with monkeypatch.context() as patch:
        patch.setattr("davinci_forces.report.report.render_all", fail)
        assert "No space left on device" in flat(call("all", folder, code=1))
    call("all", folder)
    assert (contents(reports(folder)), contents(processed(folder))) == clean


def test_a_stage_that_failed_once_leaves_nothing_behind(finished, monkeypatch):  # noqa: F811
    folder = finished
    clean = contents(reports(folder)), contents(processed(folder))

    def fail(*_, **__):
        raise ZeroDivisionError

    edit(folder / "study.toml", 'robot = "arm.toml"', 'robot = "arm.toml"\n[settings]\nlowpass = 12.0')
    with monkeypatch.context() as patch:
        patch.setattr("davinci_forces.stages.model.fit.run", fail)
        call("all", folder, code=1)
    edit(folder / "study.toml", "\n[settings]\nlowpass = 12.0", "")
    call("all", folder)
    assert (contents(reports(folder)), contents(processed(folder))) == clean


def test_what_is_made_is_not_written_through_a_link(raw, tmp_path):  # noqa: F811
    folder, elsewhere = small(raw / "lab", ("one",)), tmp_path / "elsewhere"
    elsewhere.mkdir()
    processed(folder).mkdir(parents=True)
    (processed(folder) / "recording").symlink_to(elsewhere)
    said = flat(call("ingest", folder, code=1))
    assert f"{processed(folder) / 'recording'} is a link to {elsewhere}" in said
    assert not list(elsewhere.iterdir())


def test_a_folder_of_results_may_be_a_link_itself(raw, tmp_path):  # noqa: F811
    """A large disk is linked to like this."""
    folder, disk = small(raw / "lab", ("one",)), tmp_path / "disk"
    disk.mkdir()
    (raw.parent / "processed").symlink_to(disk)
    call("ingest", folder)
    assert (disk / "lab" / "recording" / "one" / "hand_roll.parquet").exists()


def test_a_name_that_no_file_can_have_costs_its_own_log_and_no_other(raw):  # noqa: F811
    folder = small(raw / "lab")
    long = "x" * 250
    edit(folder / "study.toml", 'name = "two"', f'name = "{long}"')
    said = flat(call("ingest", folder, code=1))
    assert "give the log a shorter name in study.toml" in said
    assert (processed(folder) / "recording" / "one" / "hand_roll.parquet").exists()
    assert not [file for file in processed(folder).rglob(f"{long}*/*") if file.is_file()]
    assert "1 of 2 tasks failed" in said
    assert "it failed last time" in flat(call("ingest", folder, code=1))


def test_a_study_file_that_is_a_log_by_mistake_is_refused_unread(raw, monkeypatch):  # noqa: F811
    folder = small(raw / "lab")
    with (folder / "study.toml").open("a") as file:
        file.writelines(f"k{i} = 1\n" for i in range(700_000))
    monkeypatch.delattr("tomllib.loads")
    said = flat(call("all", folder, code=1))
    assert "study.toml: it has 8.3 MB, more than the 4 MB that are read" in said


@pytest.fixture
def read_only(monkeypatch):
    """The results of every study can be read alone: the tests may run as one who may write anywhere."""

    def make(folder: Path) -> None:
        allowed = os.access
        monkeypatch.setattr(os, "access", lambda path, mode: Path(path) != folder and allowed(path, mode))

    return make


def test_where_nothing_can_be_written_what_needs_no_writing_is_done(finished, read_only):  # noqa: F811
    folder = finished
    before = contents(processed(folder))
    (processed(folder) / ".lock").unlink()
    read_only(processed(folder))
    assert "nothing to do" in call("all", folder)
    assert "are unchanged" in call("verify", folder)
    call("all", folder, "--dry-run")
    edit(folder / "study.toml", 'robot = "arm.toml"', 'robot = "arm.toml"\n[settings]\nlowpass = 12.0')
    said = flat(call("all", folder, code=1))
    assert f"{processed(folder)} cannot be written to, and" in said
    assert "lowpass = 17.0 became 12.0" in said
    assert not (processed(folder) / ".lock").exists()
    assert {name: content for name, content in before.items() if name != ".lock"} == contents(processed(folder))


RUN = """
import sys
from pathlib import Path
from davinci_forces.runner import ALL
from davinci_forces.runner.processes import arithmetic
arithmetic.pin()
from davinci_forces.runner import runs
from davinci_forces.runner.processes import workers
workers.SECONDS_ALONE = -1.0
if __name__ == "__main__":
    sys.exit(0 if runs.run(Path(sys.argv[1]), ALL, jobs=int(sys.argv[2])) else 1)
"""


def children(pid: int) -> list[int]:
    """The processes that one started, and those that they did."""
    found, known = [], {pid}
    for stat in sorted(Path("/proc").glob("[0-9]*/stat"), key=lambda file: int(file.parent.name)):
        with suppress(OSError):
            if int(stat.read_text().rpartition(")")[2].split()[1]) in known:
                known.add(int(stat.parent.name))
                found.append(int(stat.parent.name))
    return found


def quarter(attempt: int, rng: np.random.Generator, done) -> int:
    """A number of files within one quarter of all of them: the next quarter with each attempt."""
    return int((attempt % 4 + rng.uniform()) / 4 * len(done[0]))


def wait_until_made(files: int, folder: Path, run: subprocess.Popen) -> None:
    """Wait until a run has made so many files, or ends."""
    while run.poll() is None and sum(len(names) for *_, names in os.walk(processed(folder))) < files:
        time.sleep(0.02)


@pytest.mark.slow
@pytest.mark.skipif(sys.platform != "linux", reason="asks /proc who is there")
def test_whoever_of_a_run_is_killed_whenever_the_bytes_are_the_same_and_nobody_is_left(raw, done, tmp_path):  # noqa: F811
    """Parent or worker, or who does all by himself, at moments over all stages; the next run goes on.

    A moment is known by how many files there are, since how long a run takes is a matter of the machine.
    """
    kills, rng = int(os.environ.get("DAVINCI_FORCES_KILLS", "6")), np.random.default_rng(0)
    folder = small(raw / "lab", ("one",))
    script = tmp_path / "run.py"
    script.write_text(RUN)
    for attempt in range(kills):
        run = subprocess.Popen(
            [sys.executable, str(script), str(folder), "1" if attempt % 3 == 2 else "2"],
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
        )
        wait_until_made(quarter(attempt, rng, done), folder, run)
        with suppress(subprocess.TimeoutExpired):
            run.wait(rng.uniform(0.0, 0.3))
        started = children(run.pid)
        if attempt % 2 and started:
            with suppress(ProcessLookupError):
                os.kill(int(rng.choice(started)), signal.SIGKILL)
            with suppress(subprocess.TimeoutExpired):
                run.wait(1.0)
        started = {*started, *children(run.pid)}
        run.kill()
        run.wait()
        assert end_within(5.0, started)
        for name, content in contents(processed(folder)).items():
            assert name.endswith((PARTIAL, ".lock")) or content == done[0][name], name
        if attempt % 4 == 3:  # otherwise soon nothing would be left to be killed in
            shutil.rmtree(processed(folder))
    call("all", folder)
    assert not partial_files(raw.parent)
    assert (contents(processed(folder)), contents(reports(folder))) == done


COMMAND = """
import sys
from davinci_forces.cli import main
from davinci_forces.runner.processes import workers
workers.SECONDS_ALONE = -1.0
if __name__ == "__main__":
    exec(sys.argv.pop(1))
    print("begins", flush=True)
    main()
"""
DRAWING = """
from davinci_forces.report.writers import pdf
render = pdf.render
def say_and_render(document):
    print("drawn", flush=True)
    return render(document)
pdf.render = say_and_render
"""
STOPPED = "stopped; run again to continue\n"


@pytest.fixture
def done(analysed):  # noqa: F811
    """What a run to the end of the study makes."""
    return contents(processed(analysed)), contents(reports(analysed))


@pytest.fixture(scope="module")
def fitted(tmp_path_factory):
    """What fitting a study to its end makes."""
    folder = small(tmp_path_factory.mktemp("fitted") / "raw" / "lab", ("one",))
    call("fit", folder)
    return contents(processed(folder))


@pytest.fixture
def begin(tmp_path):
    """Starts the command line in a group of its own, as a terminal does, and waits until its code is there."""
    script, started = tmp_path / "command.py", []
    script.write_text(COMMAND)

    def run(*words: str, first: str = "") -> subprocess.Popen:
        started.append(
            subprocess.Popen(
                [sys.executable, str(script), first, *words],
                stdout=subprocess.PIPE,
                stderr=subprocess.PIPE,
                text=True,
                start_new_session=True,
                preexec_fn=lambda: signal.signal(signal.SIGINT, signal.SIG_DFL),
            )
        )
        assert started[-1].stdout.readline() == "begins\n"
        return started[-1]

    yield run
    for run in started:
        with suppress(ProcessLookupError):
            os.killpg(run.pid, signal.SIGKILL)
        run.communicate()


def stopped(run: subprocess.Popen, how: str) -> tuple[str, int]:
    """What a run says, and its exit code, when it is stopped; nobody is left."""
    started = children(run.pid)
    number = signal.SIGTERM if how == "SIGTERM" else signal.SIGINT
    if how == "SIGTERM":
        run.send_signal(number)
    else:
        os.killpg(run.pid, number)
    if how == "twice":
        time.sleep(0.1)
        with suppress(ProcessLookupError):
            os.killpg(run.pid, number)
    started = {*started, *children(run.pid)}
    _, said = run.communicate(timeout=60)
    assert end_within(5.0, started)
    return said, run.returncode


def wait_until_signals_are_caught(run: subprocess.Popen) -> None:
    status = Path(f"/proc/{run.pid}/status")
    while run.poll() is None:
        [caught] = re.findall(r"SigCgt:\s*(\w+)", status.read_text()) or ["0"]
        if int(caught, 16) >> (signal.SIGTERM - 1) & 1:
            return
        time.sleep(0.01)


LINUX = pytest.mark.skipif(sys.platform != "linux", reason="asks /proc who is there")
HOW = {"SIGINT": 130, "SIGTERM": 143, "twice": 130}


@LINUX
@pytest.mark.medium
@pytest.mark.parametrize(
    ("jobs", "until", "how"),
    [("1", "recording", "SIGINT"), ("2", "recording", "SIGTERM"), ("2", "fit", "SIGINT"), ("2", "fit", "twice")],
)
def test_a_run_that_is_stopped_says_so_in_one_line_and_goes_on_next_time(raw, begin, fitted, jobs, until, how):  # noqa: F811
    folder = small(raw / "lab", ("one",))
    run = begin("fit", str(folder), "--jobs", jobs)
    while run.poll() is None and not (processed(folder) / until).exists():
        time.sleep(0.01)
    assert stopped(run, how) == (STOPPED, HOW[how])
    assert not partial_files(raw.parent)
    call("fit", folder)
    assert contents(processed(folder)) == fitted


@LINUX
@pytest.mark.medium
@pytest.mark.parametrize("how", ["SIGINT", "SIGTERM", "twice"])
def test_a_report_that_is_stopped_leaves_no_half_page(raw, begin, done, how):  # noqa: F811
    """While threads set pages, which cannot be ended."""
    folder = small(raw / "lab", ("one",))
    for where, made in ((processed(folder), done[0]), (reports(folder), done[1])):
        for name, content in made.items():
            (where / name).parent.mkdir(parents=True, exist_ok=True)
            (where / name).write_bytes(content)
    for page in reports(folder).iterdir():
        page.unlink()
    run = begin("all", str(folder), first=DRAWING)
    line = run.stdout.readline()
    while line and not line.startswith("drawn"):
        line = run.stdout.readline()
    assert stopped(run, how) == (STOPPED, HOW[how])
    assert not partial_files(raw.parent)


@pytest.fixture(scope="module")
def long_log(tmp_path_factory):
    """A log that takes long to read."""
    folder = small(tmp_path_factory.mktemp("long") / "lab", ("one",))
    table = pyarrow.csv.read_csv(folder / "one.csv")
    parquet.write_table(pyarrow.concat_tables([table] * 10_000), folder / "one.parquet", row_group_size=1000)
    return folder / "one.parquet"


@LINUX
@pytest.mark.medium
@pytest.mark.parametrize(("jobs", "how"), [("1", "SIGINT"), ("1", "SIGTERM"), ("2", "SIGINT")])
def test_a_run_that_is_stopped_while_a_child_reads_a_log_leaves_no_child(raw, begin, long_log, jobs, how):  # noqa: F811
    folder = small(raw / "lab", ("one",))
    (folder / "one.parquet").hardlink_to(long_log)
    edit(folder / "study.toml", "one.csv", "one.parquet")
    run = begin("ingest", str(folder), "--jobs", jobs)
    while run.poll() is None and not any(map(reads_log, children(run.pid))):
        time.sleep(0.01)
    assert stopped(run, how) == (STOPPED, HOW[how])
    assert not partial_files(raw.parent)


def reads_log(pid: int) -> bool:
    """Whether a process is one that reads a log for another."""
    with suppress(OSError):
        return b"isolated.process" in Path(f"/proc/{pid}/cmdline").read_bytes()
    return False


@LINUX
@pytest.mark.medium
def test_who_imports_the_package_keeps_his_handlers_of_signals(raw):  # noqa: F811
    text = """
import signal, sys
from pathlib import Path
from davinci_forces.runner import runs
import davinci_forces.cli
before = [signal.getsignal(number) for number in (signal.SIGINT, signal.SIGTERM)]
assert runs.run(Path(sys.argv[1]), ["ingest"], jobs=2)
assert before == [signal.getsignal(number) for number in (signal.SIGINT, signal.SIGTERM)]
assert before == [signal.default_int_handler, signal.SIG_DFL]
assert signal.SIGINT not in signal.pthread_sigmask(signal.SIG_BLOCK, ())
"""
    command = [sys.executable, "-c", text, str(small(raw / "lab"))]
    subprocess.run(command, check=True, preexec_fn=lambda: signal.signal(signal.SIGINT, signal.SIG_DFL))


@LINUX
@pytest.mark.slow
def test_whenever_a_run_is_stopped_it_says_one_line_and_the_next_goes_on(raw, begin, done):  # noqa: F811
    """From when the command line answers to signals; a signal that comes when all is done changes nothing."""
    stops, rng = int(os.environ.get("DAVINCI_FORCES_KILLS", "6")), np.random.default_rng(1)
    folder, ends = small(raw / "lab", ("one",)), []
    for attempt in range(stops):
        how = str(rng.choice(list(HOW)))
        run = begin("all", str(folder), "--jobs", "1" if attempt % 3 == 2 else "2")
        wait_until_signals_are_caught(run)
        wait_until_made(quarter(attempt, rng, done), folder, run)
        with suppress(subprocess.TimeoutExpired):
            run.wait(rng.uniform(0.0, 0.3))
        if run.poll() is None:
            ends.append(stopped(run, how))
            assert ends[-1] in ((STOPPED, HOW[how]), ("", 0))
        assert not partial_files(raw.parent)
        if attempt % 4 == 3:
            shutil.rmtree(processed(folder))
    assert ends.count(("", 0)) <= stops // 6
    call("all", folder)
    assert (contents(processed(folder)), contents(reports(folder))) == done
