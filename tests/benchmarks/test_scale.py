"""What a log of a study costs when there are many, as ratios within one run, of the processor's time."""

import os
import subprocess
import sys
import time
from pathlib import Path

import pytest

from davinci_forces.files import digest
from davinci_forces.runner.console import Console
from davinci_forces.runner.ledger import Folders
from davinci_forces.runner.runner import Runner
from davinci_forces.runner.runs import folders
from davinci_forces.stages import STAGES
from davinci_forces.study import Study, reading
from tests import arm, many

GROWS = 1.3  # times at most, what a log costs in a study of many, over one in a study of few
PLANNED = 12.0  # times at most, what planning ten times as many logs takes
TWICE = 1.6  # times as fast at least, two processes as one
CHECKED = 2.0  # times at most, what finding nothing to do takes beyond start-up, over hashing the files that there are


@pytest.fixture
def full(request) -> bool:
    return request.config.getoption("--full")


def seconds_of_planning(study: Study, where: Folders) -> float:
    start = time.process_time()
    tasks = many.planned(study, where)
    taken = time.process_time() - start
    assert tasks > 15 * len(study.logs)
    return taken


def test_planning_is_linear_in_the_logs(tmp_path, full, capsys):
    few = 1000 if full else 100
    studies = [many.study(tmp_path / str(n), n) for n in (few, 10 * few)]
    many.planned(*studies[0])  # imports the stages
    least, most = (min(seconds_of_planning(*study) for _ in range(3)) for study in studies)
    with capsys.disabled():
        print(f"\nplanning {few} logs {least:.2f} s, ten times as many {most / least:.1f} times that", end="")
    assert most < PLANNED * least


# In turn: what is fitted and left out by cross-validation, what is predicted and sets the level, what is measured.
ROLES = (("identification", 1.0, ""), ("validation", 1.3, ""), ("contact", 1.3, "contact = [[4.0, 6.0]]"))


def lab(home: Path, logs: int, period: float, rate: float) -> Path:
    """A study of so many logs of one joint, of five periods of about that length [s], in every role that counts."""
    folder, tables = home / "raw" / f"lab{logs}", []
    for i in range(logs):
        role, times, more = ROLES[i % len(ROLES)]
        signal = arm.signal("hand_roll", period=times * period, rate=rate, periods=5, seed=i)
        arm.write_csv(folder / f"{i}.csv", [signal])
        tables.append(arm.log_table(f"log-{i}", f"{i}.csv", role, ["hand_roll"], more))
    (folder / "study.toml").write_text('robot = "dvrk_psm"\n' + "".join(tables))
    return folder


def quiet(study: Path) -> Runner:
    return Runner(reading.read(study), folders(study, None, None), Console(lambda line: None, lambda line: None))


def seconds_of_stages(study: Path) -> dict[str, float]:
    """What each stage takes, run after the others, of which it finds that they are current."""
    taken = {}
    for name in STAGES:
        start = time.process_time()
        assert quiet(study).run([name])
        taken[name] = time.process_time() - start
    return taken


def seconds_of_hashing(where: Folders) -> float:
    files = [f for root in (where.raw, where.processed) for f in root.rglob("*") if f.is_file()]
    start = time.process_time()
    for file in files:
        digest(file)
    return time.process_time() - start


def seconds_afresh(study: Path) -> float:
    """What finding nothing to do takes a process of its own, from its start on."""
    code = (
        "import sys, time, davinci_forces as it; assert it.run(*sys.argv[1:], quiet=True); print(time.process_time())"
    )
    done = subprocess.run([sys.executable, "-c", code, study, *STAGES], capture_output=True, text=True, check=True)
    return float(done.stdout)


def test_a_log_costs_the_same_in_a_study_of_many(tmp_path, full, capsys):
    """In every stage that works on logs; the first study imports and compiles what the others need, and is a start-up.

    At full size logs are as long as those of a laboratory, so that hashing them is more than opening files.
    """
    few, logs, period, rate = (50, 400, 10.0, 100.0) if full else (25, 100, 2.0, 50.0)
    least_of_all, least, most = (lab(tmp_path, n, period, rate) for n in (3, few, logs))
    _, of_few, of_many = (seconds_of_stages(study) for study in (least_of_all, least, most))
    grows = {name: of_many[name] / logs / (of_few[name] / few) for name in STAGES if name != "design"}
    start_up, checked = (min(seconds_afresh(study) for _ in range(3)) for study in (least_of_all, most))
    hashing = min(seconds_of_hashing(folders(most, None, None)) for _ in range(3))
    with capsys.disabled():
        for name, times in grows.items():
            each = 1e3 * of_many[name] / logs
            print(f"\n{name:14s} {each:7.2f} ms a log of {logs}, {times:.2f} times that of {few}", end="")
        print(f"\nnothing to do: start-up of {start_up:.2f} s and {(checked - start_up) / hashing:.2f} times", end=" ")
        print(f"the {hashing:.2f} s of hashing all files", end="")
    assert max(grows.values()) < (GROWS if full else 2 * GROWS)
    assert checked < start_up + (CHECKED if full else 2 * CHECKED) * hashing


def seconds_of_jobs(study: Path, jobs: int) -> float:
    """How long a process of its own takes from ingest to whiteness, by the clock."""
    code = (
        "import sys, davinci_forces as it; assert it.run(sys.argv[1], *sys.argv[3:], jobs=int(sys.argv[2]), quiet=True)"
    )
    names = STAGES[STAGES.index("ingest") : STAGES.index("whiteness") + 1]
    start = time.perf_counter()
    subprocess.run([sys.executable, "-c", code, study, str(jobs), *names], check=True, stdout=subprocess.DEVNULL)
    return time.perf_counter() - start


@pytest.mark.skipif((os.cpu_count() or 1) < 2, reason="two processes need two processors")
def test_two_processes_take_little_more_than_half_the_time_of_one(tmp_path, full, capsys):
    """Of a hundred logs of a minute at full size; few short ones are done before others have begun to help."""
    logs, period = (100, 10.4) if full else (20, 10.4)
    one, two = (lab(tmp_path / str(jobs), logs, period, 100.0) for jobs in (1, 2))
    alone, shared = seconds_of_jobs(one, 1), seconds_of_jobs(two, 2)
    tracks = [
        sorted(f.name for f in (folders(s, None, None).processed / "track").rglob("*.parquet")) for s in (one, two)
    ]
    assert len(tracks[0]) >= logs // 3
    assert tracks[0] == tracks[1]
    with capsys.disabled():
        print(
            f"\n{logs} logs of a minute take {alone:.0f} s, two processes are {alone / shared:.2f} times as fast",
            end="",
        )
    assert alone > (TWICE if full else 1.0) * shared
