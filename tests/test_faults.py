"""What machines do to a run: disks that are full or read-only, links, names and files that are too long."""

import os
import shutil
import signal
import subprocess
import sys
from contextlib import suppress
from pathlib import Path

import numpy as np
import pytest

from davinci_forces.records.store import PARTIAL
from tests.test_robustness import flat, raw, small  # noqa: F401 - fixtures
from tests.test_runs import call, contents, edit, processed, reports
from tests.test_workers import end_within

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
    ran = subprocess.run(command, capture_output=True, text=True, check=False)
    assert ran.returncode == 1
    assert "File too large" in ran.stderr
    assert "fault of davinci-forces" not in ran.stderr
    assert "Traceback" not in ran.stderr
    assert "Exception ignored" not in ran.stderr
    assert not partial_files(processed(folder))
    call("ingest", folder)
    assert (processed(folder) / "recording" / "one" / "hand_roll.parquet").exists()


def test_a_report_that_failed_once_is_the_same_as_that_of_a_clean_run(raw, monkeypatch):  # noqa: F811
    folder = small(raw / "lab", ("one",))
    call("all", folder)
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


def test_a_stage_that_failed_once_leaves_nothing_behind(raw, monkeypatch):  # noqa: F811
    folder = small(raw / "lab", ("one",))
    call("all", folder)
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
    assert "give it a shorter one in study.toml" in said
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
    assert "study.toml: it has 8.3 MB, and what people write down has at most 4" in said


@pytest.fixture
def read_only(monkeypatch):
    """The results of every study can be read alone: the tests may run as one who may write anywhere."""

    def make(folder: Path) -> None:
        allowed = os.access
        monkeypatch.setattr(os, "access", lambda path, mode: Path(path) != folder and allowed(path, mode))

    return make


def test_where_nothing_can_be_written_what_needs_no_writing_is_done(raw, read_only):  # noqa: F811
    folder = small(raw / "lab", ("one",))
    call("all", folder)
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
workers.ALONE = -1.0
if __name__ == "__main__":
    sys.exit(0 if runs.run(Path(sys.argv[1]), ALL, jobs=2) else 1)
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


@pytest.mark.slow
@pytest.mark.skipif(sys.platform != "linux", reason="asks /proc who is there")
def test_whoever_of_a_run_is_killed_whenever_the_bytes_are_the_same_and_nobody_is_left(raw, tmp_path):  # noqa: F811
    """Parent or worker, at moments over all stages; the next run goes on."""
    kills, rng = int(os.environ.get("DAVINCI_FORCES_KILLS", "12")), np.random.default_rng(0)
    clean = small(tmp_path / "clean" / "raw" / "lab", ("one",))
    call("all", clean)
    wanted = contents(processed(clean)), contents(reports(clean))
    folder = small(raw / "lab", ("one",))
    script = tmp_path / "run.py"
    script.write_text(RUN)
    for attempt in range(kills):
        run = subprocess.Popen(
            [sys.executable, str(script), str(folder)], stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL
        )
        with suppress(subprocess.TimeoutExpired):
            run.wait(rng.uniform(1.0, 12.0))
        started = children(run.pid)
        if attempt % 2 and started:
            with suppress(ProcessLookupError):
                os.kill(int(rng.choice(started)), signal.SIGKILL)
            with suppress(subprocess.TimeoutExpired):
                run.wait(2.0)
        started = {*started, *children(run.pid)}
        run.kill()
        run.wait()
        assert end_within(5.0, started)
        for name, content in contents(processed(folder)).items():
            assert name.endswith((PARTIAL, ".lock")) or content == wanted[0][name], name
        if attempt % 4 == 3:  # otherwise soon nothing would be left to be killed in
            shutil.rmtree(processed(folder))
    call("all", folder)
    assert not partial_files(raw.parent)
    assert (contents(processed(folder)), contents(reports(folder))) == wanted
