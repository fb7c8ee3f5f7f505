"""Runs in a world that is not kind: missing files, full disks, two runs at once, altered results."""

import ast
import contextlib
import errno
import gc
import json
import os
import re
import shutil
import socket
import subprocess
import sys
import tomllib
import weakref
from concurrent.futures.process import BrokenProcessPool
from dataclasses import replace
from datetime import UTC, datetime

import numpy as np
import pytest

from davinci_forces.errors import BadLog, BadRequest
from davinci_forces.records import Diagnostic, PeriodResidual, Recording, store
from davinci_forces.robots import davinci
from davinci_forces.robots.robot import Limits
from davinci_forces.runner import execution
from davinci_forces.runner.fingerprint import PACKAGE, Fingerprint, canonical, code, find_imports, hash_of
from davinci_forces.runner.ledger import Folders
from davinci_forces.runner.lock import hold_lock, parse_holder
from davinci_forces.runner.lock import holder as holder_now
from davinci_forces.runner.plan import Task
from davinci_forces.runner.signature import declaration
from davinci_forces.stages.recordings import resample
from tests import arm
from tests.conftest import once
from tests.test_runs import call, processed, reports

pytestmark = pytest.mark.usefixtures("drawn_once")


@pytest.fixture
def raw(tmp_path):
    """An empty raw/ folder."""
    folder = tmp_path / "raw"
    folder.mkdir()
    return folder


def small(folder, logs=("one", "two")):
    """A study of short logs of one joint."""
    signal = arm.signal("hand_roll", period=2.0, rate=50.0, periods=5)
    for name in logs:
        arm.write_csv(folder / f"{name}.csv", [signal])
    tables = "".join(arm.log_table(name, f"{name}.csv", "identification", ["hand_roll"]) for name in logs)
    arm.write_robot(folder)
    (folder / "study.toml").write_text('robot = "arm.toml"\n' + tables)
    return folder


@pytest.fixture(scope="module")
def analysed(tmp_path_factory):
    """A study of one log that every stage has run on; it is made once a run of the tests, and not to be changed."""
    made = once(tmp_path_factory, "small", lambda home: call("all", small(home / "raw" / "lab", ("one",))))
    return made / "raw" / "lab"


@pytest.fixture
def finished(analysed, tmp_path):
    """A copy of an analysed study, to be damaged."""
    shutil.copytree(analysed.parent.parent, tmp_path, dirs_exist_ok=True)
    return tmp_path / "raw" / "lab"


def flat(said: str) -> str:
    return " ".join(said.split())


def test_the_readers_of_logs_count_for_ingest_and_the_store_for_every_stage(finished):
    entry = json.loads((processed(finished) / "tasks" / "ingest" / "one.json").read_text())
    assert {
        "logs/text/__init__.py",
        "logs/tdms/__init__.py",
        "logs/log.py",
    } <= set(entry["fingerprint"]["code"])
    for file in (processed(finished) / "tasks").glob("*/*.json"):
        assert "records/store.py" in json.loads(file.read_text())["fingerprint"]["code"], file


def test_no_import_of_a_module_is_overlooked():
    for file in sorted(PACKAGE.rglob("*.py")):
        source = file.read_text(encoding="utf-8")
        statements = (node for node in ast.walk(ast.parse(source)) if isinstance(node, ast.ImportFrom))
        ours = (s for s in statements if str(s.module).startswith("davinci_forces"))
        parsed = [(str(s.module), [n.name for n in s.names]) for s in ours]
        assert sorted(find_imports(source)) == sorted(parsed), file


def test_records_that_a_stage_comes_to_in_turn_are_read_then_and_not_kept(finished):
    """Or a stage of a long log would need memory for all joints, though it looks at one."""
    where = processed(finished)
    [file] = (where / "motion").rglob("*.parquet")
    place = file.relative_to(where).as_posix()
    task = Task("predict", "one", Fingerprint({f"processed/{place}": ""}, {}, {}, {}, {}, ""))
    motions = execution.InTurn(Folders(finished, where, where), task, (("Motion", place),))
    assert declaration("predict").in_turn == {"motions"}
    assert len(motions) == 1
    [first], [again] = motions, motions
    assert first.t.tolist() == again.t.tolist()
    held = weakref.ref(first)
    del first
    gc.collect()
    assert held() is None


def test_what_is_written_is_let_go_though_its_file_has_no_name_yet(tmp_path):
    """Or a task that makes a record a time would need memory for all of them."""
    t = np.arange(10.0)
    with store.Writer(tmp_path, lambda record: lambda template: "", {}) as writer:
        record = PeriodResidual("log", "joint", t=t, q_noise=t, dq_noise=t, tau_noise=t)
        writer.write(record)
        held = weakref.ref(record)
        del record
        gc.collect()
        assert held() is None
    assert (tmp_path / "period_residual" / "log" / "joint.parquet").exists()


def test_code_of_several_modules_is_that_of_each():
    assert code("davinci_forces.maths.units", "davinci_forces.records.store") == code(
        "davinci_forces.maths.units"
    ) | code("davinci_forces.records.store")


def test_the_hash_of_a_robot_sees_every_bit_of_it():
    """In the last digit of one mass, where what numpy prints is the same."""
    bodies = davinci.ROBOT.bodies
    masses = bodies.masses.copy()
    masses[2] = np.nextafter(masses[2], 1)
    other = replace(davinci.ROBOT, bodies=replace(bodies, masses=masses))
    assert repr(other) == repr(davinci.ROBOT)
    assert hash_of(other) != hash_of(davinci.ROBOT)
    same = replace(davinci.ROBOT, bodies=replace(bodies, masses=bodies.masses.copy()))
    assert hash_of(same) == hash_of(davinci.ROBOT)


def test_a_canonical_text_tells_values_apart_that_differ():
    values = [1, 1.0, True, "1", (1,), [1], {1: 1}, None, np.ones(1), np.ones((1, 1)), np.ones(1, int), "None", ("1",)]
    assert len({canonical(value) for value in values}) == len(values)
    assert canonical({"a": 1, "b": 2}) == canonical({"b": 2, "a": 1})
    with pytest.raises(TypeError, match="object has no canonical text"):
        canonical([object()])


def test_a_missing_file_costs_its_own_log_and_no_other(raw, tmp_path):
    folder = small(raw / "lab")
    (folder / "two.csv").unlink()
    said = flat(call("all", folder, code=1))
    line = (folder / "study.toml").read_text().splitlines().index('file = "two.csv"') + 1
    assert f"warning: {folder / 'study.toml'}:{line}: file 'two.csv' is not in {folder}" in said
    assert "ingest: error: file 'two.csv' of log 'two' is not in raw/lab" in said
    made = tmp_path / "processed" / "lab"
    assert (made / "fit" / "hand_roll" / "independent.lse.parquet").exists()
    assert (tmp_path / "reports" / "lab" / "report.html").exists()
    assert not (made / "recording" / "two").exists()
    assert "are unchanged" in call("verify", folder)
    small(folder)
    assert "ingest: two: it failed last time" in flat(call("ingest", folder))


def test_a_study_of_which_no_file_is_there_says_so_and_stops(raw):
    folder = small(raw / "lab")
    for name in ("one", "two"):
        (folder / f"{name}.csv").unlink()
    said = flat(call("ingest", folder, code=1))
    assert "file 'one.csv' is not in" in said
    assert "file 'two.csv' is not in" in said
    assert not (raw.parent / "processed").exists()


@pytest.mark.parametrize("named", [True, False])
def test_a_broken_study_does_not_stop_the_others(raw, monkeypatch, named):
    monkeypatch.chdir(raw.parent)
    monkeypatch.setattr("davinci_forces.cli.ALL", ("ingest",))
    for name in ("a", "c"):
        (raw / name).mkdir()
    (raw / "a" / "study.toml").write_text("title = 3")
    (raw / "c" / "study.toml").write_text("titel = 3")
    small(raw / "b")
    said = call("all", *(["raw/a", "raw/b", "raw/c"] if named else []), code=1)
    assert said.count("title must be text, not 3") == 1
    assert said.count("unknown key 'titel'") == 1
    assert (raw.parent / "processed" / "b" / "recording" / "one" / "hand_roll.parquet").exists()


def test_a_file_in_place_of_the_processed_folder_is_said(raw, tmp_path):
    (tmp_path / "p").write_text("")
    assert str(tmp_path / "p") in call("ingest", small(raw / "lab"), "--processed", tmp_path / "p", code=1)


@pytest.mark.parametrize(
    ("failure", "says"),
    [
        (OSError(28, "No space left on device", "x.parquet"), "x.parquet: No space left on device"),
        (PermissionError(13, "Permission denied", "x.parquet"), "x.parquet: Permission denied"),
        (BrokenProcessPool("a child process terminated abruptly"), "run again with fewer --jobs"),
    ],
)
def test_what_the_machine_refuses_is_a_message(raw, monkeypatch, failure, says):
    def refuse(*_):
        raise failure

    monkeypatch.setattr("davinci_forces.runner.runner.perform", refuse)
    said = flat(call("ingest", small(raw / "lab"), code=1))
    assert says in said


def test_a_log_that_may_not_be_read_is_no_fault_of_ours(raw, monkeypatch):
    def refuse(files, options):
        raise PermissionError(13, "Permission denied", str(files[0]))

    monkeypatch.setattr("davinci_forces.logs.parts.open_parts", refuse)
    said = flat(call("ingest", small(raw / "lab"), code=1))
    assert "Permission denied" in said
    assert "fault of davinci-forces" not in said


HOLD = """
import sys, time
from pathlib import Path
from davinci_forces.runner.fingerprint import Fingerprint
from davinci_forces.runner.ledger import Folders
from davinci_forces.runner.lock import hold_lock
from davinci_forces.runner.plan import Task
from davinci_forces.runner.signature import declaration
with hold_lock(Path(sys.argv[1])):
    print("held", flush=True)
    time.sleep(60)
"""


@pytest.fixture
def holder(raw):
    """Another process that works on the study raw/lab."""
    folder = raw.parent / "processed" / "lab"
    other = subprocess.Popen([sys.executable, "-c", HOLD, str(folder)], stdout=subprocess.PIPE, text=True)
    assert other.stdout.readline() == "held\n"
    yield other
    other.kill()
    other.wait()
    other.stdout.close()


def test_a_second_run_on_a_study_is_refused_until_the_first_has_ended_however_it_ends(raw, holder):
    folder = small(raw / "lab")
    half = raw.parent / "processed" / "lab" / "x.parquet.partial"
    half.write_text("of the other run")
    assert "another run is working on this study" in flat(call("ingest", folder, code=1))
    assert half.read_text() == "of the other run"
    holder.kill()
    holder.wait()
    call("ingest", folder)
    assert not half.exists()


def test_a_lock_is_free_when_its_block_is_left_even_by_an_error(tmp_path):
    def work(inside):
        with hold_lock(tmp_path / "p"):
            inside()

    with pytest.raises(BadRequest, match="another run"):
        work(lambda: work(lambda: None))
    work(lambda: None)


def test_a_lock_file_that_nobody_holds_counts_for_nothing(tmp_path):
    (tmp_path / ".lock").write_text("of a run that was killed")
    with hold_lock(tmp_path):
        pass


AFTER = """
import sys, time
from pathlib import Path
from davinci_forces.errors import BadRequest
from davinci_forces.runner.lock import hold_lock
folder, done = Path(sys.argv[-1]), 0
while done < 40:
    try:
        with hold_lock(folder):
            marker = folder / "inside"
            marker.touch(exist_ok=False)
            marker.unlink()
            done += 1
    except BadRequest:
        time.sleep(0.0005)
"""


def test_many_runs_at_once_hold_the_lock_one_after_the_other(tmp_path):
    """Each appends to a file what would be torn if two were inside at once."""
    runs_ = [subprocess.Popen([sys.executable, "-c", AFTER, str(tmp_path)]) for _ in range(3)]
    assert [run.wait() for run in runs_] == [0, 0, 0]


NO_FLOCK = """
import errno, os, sys
try:
    import fcntl
except ImportError:  # Windows
    import msvcrt
def refuse(*_):
    raise OSError(getattr(errno, sys.argv[1]), os.strerror(getattr(errno, sys.argv[1])))
if "fcntl" in globals():
    fcntl.flock = refuse
else:
    msvcrt.locking = refuse
"""
REFUSALS = ("ENOSYS", "ENOTSUP", "ENOLCK")


@pytest.fixture(params=REFUSALS)
def without_flock(request, monkeypatch):
    """A file system that cannot lock files, as NFS, SMB and FUSE may be: here, and in processes that begin so."""

    def refuse(*_):
        raise OSError(getattr(errno, request.param), "the file system has no locks")

    flock = pytest.importorskip("fcntl") and "fcntl.flock"
    monkeypatch.setattr(flock, refuse)
    return request.param


def hold_without_flock(error, folder):
    """A process that holds the lock of a folder where the file system has none, and what the lock says."""
    text = NO_FLOCK + HOLD.replace("sys.argv[1]", "sys.argv[2]")
    other = subprocess.Popen([sys.executable, "-c", text, error, str(folder)], stdout=subprocess.PIPE, text=True)
    assert other.stdout.readline() == "held\n"
    return other


def test_without_flock_the_lock_of_a_living_run_is_refused_and_that_of_a_dead_one_taken(tmp_path, without_flock):
    other = hold_without_flock(without_flock, tmp_path)
    try:
        [said] = os.listdir(tmp_path / ".lock")
        taken = parse_holder(said).taken
        assert abs(datetime.now(UTC) - datetime.fromisoformat(f"{taken}+00:00")).total_seconds() < 600
        with pytest.raises(BadRequest, match="another run is working on this study") as refused, hold_lock(tmp_path):
            pass
        assert f"process {other.pid} on {socket.gethostname()}" in str(refused.value)
        assert f"{taken[:19]} UTC" in str(refused.value)
    finally:
        other.kill()
        other.communicate()
    assert os.listdir(tmp_path / ".lock") == [said]
    with hold_lock(tmp_path), pytest.raises(BadRequest, match=f"process {os.getpid()} on"), hold_lock(tmp_path):
        pass
    assert not list(tmp_path.iterdir())


def left_by(folder, **what):
    """A lock that was left by a run that differs so from one of this process."""
    stale = replace(holder_now(), **what)
    (folder / ".lock").mkdir()
    (folder / ".lock" / stale.name).touch()
    return stale


def test_without_flock_a_later_process_of_the_same_number_is_told_from_the_one_that_ended(tmp_path, without_flock):
    left_by(tmp_path, start="00000000.1")
    with hold_lock(tmp_path):
        assert [parse_holder(name).start for name in os.listdir(tmp_path / ".lock")] == [holder_now().start]


def test_without_flock_a_run_whose_end_the_system_does_not_tell_is_refused_with_the_remedy(
    tmp_path, without_flock, monkeypatch
):
    monkeypatch.setattr("davinci_forces.runner.lock.start_of", lambda process: "")
    file = tmp_path / ".lock" / left_by(tmp_path).name
    with pytest.raises(BadRequest) as refused, hold_lock(tmp_path):
        pass
    assert str(refused.value).endswith(f"if it has ended, delete {file}")


@pytest.mark.parametrize("host", ["elsewhere.0", f"{socket.gethostname()}.0"], ids=["host", "container"])
@pytest.mark.parametrize("as_file", [False, True])
def test_without_flock_the_lock_of_another_host_is_never_taken(tmp_path, without_flock, host, as_file):
    theirs = left_by(tmp_path, host=host, process="4711", start="00000000.1", taken="2026-01-02 03:04:05.000000")
    file = tmp_path / ".lock" / theirs.name
    if as_file:  # by a run whose host could lock the file
        shutil.rmtree(tmp_path / ".lock")
        file = tmp_path / ".lock"
        file.write_text(theirs.name)
    for _ in range(2):
        with pytest.raises(BadRequest) as refused, hold_lock(tmp_path):
            pass
        told = f"process 4711 on {host[:-2]}, which took the lock at 2026-01-02 03:04:05 UTC"
        assert told in str(refused.value)
        assert str(refused.value).endswith(f"delete {file}")
    file.unlink()
    with hold_lock(tmp_path):
        pass


@pytest.mark.parametrize("content", ["", "of a run that was killed", "4711\nlab\n", "host=&process=x&start=&taken="])
def test_without_flock_what_names_nobody_holds_nothing(tmp_path, without_flock, content):
    (tmp_path / ".lock").write_text(content)
    with hold_lock(tmp_path):
        pass
    (tmp_path / ".lock").mkdir()  # of a run that was killed as it let go
    with hold_lock(tmp_path):
        pass
    assert not list(tmp_path.iterdir())


def test_a_lock_says_who_holds_it_and_nothing_once_it_is_free(tmp_path):
    with hold_lock(tmp_path):
        assert parse_holder((tmp_path / ".lock").read_text()).process == str(os.getpid())
        with pytest.raises(BadRequest, match=f"process {os.getpid()} on {socket.gethostname()}"), hold_lock(tmp_path):
            pass
    assert (tmp_path / ".lock").read_bytes() == b""


@pytest.mark.skipif(sys.platform == "win32", reason="links and pipes of POSIX")
def test_a_lock_that_is_a_link_or_a_pipe_has_nothing_written_and_nobody_wait(tmp_path):
    (tmp_path / "precious").write_text("content")
    (tmp_path / ".lock").symlink_to(tmp_path / "precious")
    with pytest.raises(OSError, match="lock"), hold_lock(tmp_path):
        pass
    assert (tmp_path / "precious").read_text() == "content"
    (tmp_path / ".lock").unlink()
    os.mkfifo(tmp_path / ".lock")
    with contextlib.suppress(OSError), hold_lock(tmp_path):
        pass


RACE = """
import time
from pathlib import Path
from davinci_forces.errors import BadRequest
from davinci_forces.runner.lock import hold_lock
for line in sys.stdin:
    folder = Path(line.strip())
    while not (folder / "go").exists():
        pass
    try:
        with hold_lock(folder):
            print("won", flush=True)
            while not (folder / "over").exists():
                time.sleep(0.001)
    except BadRequest as error:
        print(str(error), flush=True)
"""


@pytest.mark.medium
@pytest.mark.parametrize("left", ["folder", "file", "nothing"])
def test_without_flock_exactly_one_of_many_runs_takes_a_lock_that_was_left(tmp_path, left):
    ran = [
        subprocess.Popen(
            [sys.executable, "-c", NO_FLOCK + RACE, "ENOTSUP"], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
        )
        for _ in range(3)
    ]
    try:
        for i in range(100):
            folder = tmp_path / str(i)
            folder.mkdir()
            if left != "nothing":
                stale = left_by(folder, start="00000000.1")
            if left == "file":
                shutil.rmtree(folder / ".lock")
                (folder / ".lock").write_text(stale.name)
            for run in ran:
                run.stdin.write(f"{folder}\n")
                run.stdin.flush()
            (folder / "go").touch()
            said = {run: run.stdout.readline() for run in ran}
            (folder / "over").touch()
            [winner] = [run for run, line in said.items() if line == "won\n"]
            others = [line for run, line in said.items() if run is not winner]
            assert all(f"process {winner.pid} on" in line for line in others), others
    finally:
        for run in ran:
            run.stdin.close()
            run.wait()
            run.stdout.close()


@pytest.mark.medium
def test_without_flock_many_runs_at_once_hold_the_lock_one_after_the_other(tmp_path):
    ran = [subprocess.Popen([sys.executable, "-c", NO_FLOCK + AFTER, "ENOLCK", str(tmp_path)]) for _ in range(3)]
    assert [run.wait() for run in ran] == [0, 0, 0]
    assert not list(tmp_path.iterdir())


def test_the_title_of_a_study_named_by_a_dot_is_its_folder(raw, monkeypatch):
    monkeypatch.chdir(small(raw / "lab"))
    assert ".: lab" in call("ingest", ".")


@pytest.mark.parametrize(
    ("key", "word", "value"),
    [
        ("fit.hand_roll.independent.lse.inertia", "std", 1e-9),
        ("fit.hand_roll.independent.lse.inertia", "unit", "kg"),
        ("fit.hand_roll.independent.lse.mse", "std", 0.1),
        ("period.one", "unit", "ms"),
        ("ekf.one.hand_roll.tau_ext_rms", "unit", "N"),
    ],
)
def test_verify_names_a_deviation_or_a_unit_that_was_altered(finished, key, word, value):
    file = reports(finished) / "results.json"
    results = json.loads(file.read_text())
    next(r for r in results if r["key"] == key)[word] = value
    file.write_text(json.dumps(results))
    assert f"{key}: has {word} {value!r}, but its records give" in flat(call("verify", finished, code=1))


def test_verify_names_results_that_are_gone_or_odd(finished):
    file = reports(finished) / "results.json"
    results = json.loads(file.read_text())
    gone = results.pop()["key"]
    odd = [{**results[0], "source": source} for source in ("processed/fits/a.parquet#mse", 3)]
    file.write_text(json.dumps([*results, *odd, {}, {**results[0], "key": "fit.of.nothing"}]))
    said = flat(call("verify", finished, code=1))
    assert f"{gone} is missing" in said
    assert f"{results[0]['key']} appears 3 times" in said
    assert said.count("has source 'processed/fits/a.parquet#mse', but its records give") == 1
    assert said.count("has source 3, but") == 1
    assert "None comes from no record" in said
    assert "fit.of.nothing comes from no record" in said


def test_verify_passes_over_files_that_are_no_entries(finished):
    (processed(finished) / "tasks" / "ingest" / ".DS_Store").write_bytes(b"\0")
    assert "are unchanged" in call("verify", finished)


def test_verify_compares_a_file_with_what_every_task_knew_of_it(finished):
    """A record is made anew and read by one of two tasks; the other's work, first in order, is of one that is gone."""
    table = finished / "one.csv"
    lines = table.read_text().splitlines()
    lines[5] = lines[5].replace("1", "2", 1)
    table.write_text("\n".join(lines) + "\n")
    call("ingest", finished)
    call("resample", finished)
    said = flat(call("verify", finished, code=1))
    line = said.partition("recording/one/hand_roll.parquet was altered")[2].partition("was altered")[0]
    assert "for report report" in line


def remarked(damage) -> str:
    """What is said of a recording of the roll after something was done to it."""
    return " ".join(text for record in diagnosed(damage) for text in record.text)


def diagnosed(damage) -> list[Diagnostic]:
    signal = arm.signal("hand_roll", rate=100.0, periods=2)
    columns = {"t": signal.t, "q": signal.q.copy(), "dq": signal.dq.copy(), "tau": signal.tau.copy()}
    damage(columns)
    filled = np.zeros(len(columns["t"]), int)
    recording = Recording("run", "hand_roll", "identification", 100.0, "logged", **columns, filled=filled)
    made = resample.run(recording, arm.joint("hand_roll"), lowpass=17.0)
    return [record for record in made if isinstance(record, Diagnostic)]


def stop_sensor(columns):
    columns["q"][500:600] = columns["q"][500]


def rest(columns):
    """A joint that stands still for a second goes on from where it stood."""
    columns["q"][500:600] = columns["q"][500]
    columns["q"][600:] -= columns["q"][600] - columns["q"][599]
    columns["dq"][500:600] = 0.0


def test_a_stuck_sensor_and_a_saturated_drive_are_said():
    assert remarked(lambda columns: None) == ""
    assert "stands still from 5.000 to 5.990 s and then jumps" in remarked(stop_sensor)
    assert "the position stands still" not in remarked(rest)
    limit = np.quantile(arm.signal("hand_roll", rate=100.0, periods=2).tau, 0.9)
    assert "was saturated" in remarked(lambda c: c.update(tau=np.minimum(c["tau"], limit)))


def test_positions_beyond_the_limits_are_noted_beyond_twice_warned_of_and_beyond_twenty_times_refused():
    far = np.quantile(np.abs(arm.signal("hand_roll", rate=100.0, periods=2).q), 0.99) / 0.6

    def at(times):
        return remarked(lambda c: c.update(q=times / far * c["q"], dq=times / far * c["dq"]))

    assert at(1.0) == ""
    assert at(1.1) != at(1.9)
    for times in (1.1, 1.9):
        assert (
            "rad where the robot states -0.6 to 0.6; correct the units, or the zero of positions (`offset`), on which "
            in at(times)
        )
    severities = [
        [record.severity for record in diagnosed(lambda c, x=times: c.update(q=x / far * c["q"], dq=x / far * c["dq"]))]
        for times in (1.1, 1.4, 1.6, 1.9)
    ]
    assert severities == [[("note",)]] * 2 + [[("warning",)]] * 2  # a quarter of the range is 1.5
    for times in (2.1, 19.0):
        assert "times the limit of 0.6 rad" in at(times)
        assert "positions from" not in at(times)
    with pytest.raises(BadLog, match=r"times the limit of 0\.6 rad.*write the unit of the channel"):
        at(21.0)


def test_no_zero_of_positions_is_offered_against_velocities_beyond_the_limits():
    remark = remarked(lambda c: c.update(dq=2.5 * c["dq"]))
    assert "velocities from" in remark
    assert (
        "to 1.2; correct the units, or the `rate`, or the limits, by which `excite` designs, if these are wrong"
        in remark
    )
    assert "tip" not in remark


@pytest.mark.parametrize(
    ("joint", "depends"), [("hand_roll", "gravity and the arm's pose"), ("instrument_slide", "pose")]
)
def test_limits_that_hold_the_motion_are_printed_to_be_pasted_and_nothing_is_said_of_forces_at_the_tip(joint, depends):
    signal, known = arm.signal(joint, rate=100.0, periods=2), arm.joint(joint)
    beyond = 0.1 * np.ptp(signal.q)
    tight = replace(known.limits, q=(signal.q.min() + beyond, signal.q.max() - beyond), effort=12.5)
    columns = {"t": signal.t, "q": signal.q, "dq": signal.dq, "tau": signal.tau, "filled": np.zeros(len(signal.t), int)}
    recording = Recording("run", joint, "identification", 100.0, "logged", **columns)

    def said(limits: Limits) -> list[str]:
        made = resample.run(recording, replace(known, limits=limits), lowpass=17.0)
        return [text for record in made if isinstance(record, Diagnostic) for text in record.text if "states" in text]

    [text] = said(tight)
    line = re.search(r"`(limits = .*?)` in \[robot_overrides\.(\w+)\] of study.toml", text)
    assert line is not None
    assert (line[2], depends in text, "forces at the tip" in text) == (joint, True, False)
    stated = tomllib.loads(line[1])["limits"]
    assert (stated["dq"], stated["ddq"], stated["effort"]) == ([*tight.dq], [*tight.ddq], 12.5)
    low, high = np.percentile(signal.q, (1.0, 99.0))
    assert stated["q"][0] <= low < high <= stated["q"][1]
    assert max(len(f"{x:.6g}".lstrip("-0.")) for x in stated["q"]) <= 3
    assert said(replace(tight, q=tuple(stated["q"]))) == []


@pytest.mark.slow
def test_what_one_joint_of_a_log_suffers_costs_no_other_joint_or_log(raw):
    """A log whose position is in other units than it says is refused, and the rest comes out as without it."""
    alone, beside = small(raw / "alone", ("one", "two")), small(raw / "beside", ("one", "two"))
    wrong = arm.signal("hand_roll", period=2.0, rate=50.0, periods=5, seed=3)
    object.__setattr__(wrong, "q", 1000.0 * wrong.q)
    arm.write_csv(beside / "wrong.csv", [wrong])
    with (beside / "study.toml").open("a") as study:
        study.write(arm.log_table("wrong", "wrong.csv", "validation", ["hand_roll"]))
    call("all", alone)
    said = flat(call("all", beside, code=1))
    assert "wrong/hand_roll: the logged velocity is 0.001 times the derivative of the logged position" in said
    theirs, ours = (json.loads((reports(folder) / "results.json").read_text()) for folder in (alone, beside))
    values = {row["key"]: row["value"] for row in ours}
    tracked = [row for row in theirs if row["key"].startswith(("fit.", "ekf."))]
    assert tracked
    assert all(values[row["key"]] == row["value"] for row in tracked if "white" not in row["key"])
