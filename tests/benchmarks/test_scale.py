"""What a log of a study costs when there are many, as ratios within one run."""

import time
from dataclasses import replace
from pathlib import Path

import pytest

from pipeline.robots import dvrk_psm
from pipeline.runner.console import Console
from pipeline.runner.ledger import Entry, Folders, Ledger
from pipeline.runner.plan import Plan
from pipeline.runner.runner import Runner
from pipeline.runner.runs import folders
from pipeline.runner.signature import declaration
from pipeline.stages import STAGES
from pipeline.study import LogEntry, Settings, Study, reading
from tests import arm

GROWS = 1.3  # times at most, what a log costs in a study of many, over one in a study of few
PLANNED = 12.0  # times at most, what planning ten times as many logs takes
CHECKED = 2.0  # times at most, what finding nothing to do takes, over hashing the files that there are


@pytest.fixture
def full(request) -> bool:
    return request.config.getoption("--full")


def synthetic(home: Path, logs: int) -> tuple[Study, Folders]:
    """A study as it stands when all its stages but the last have run, as far as its ledger knows."""
    where = Folders(home / "raw" / "lab", home / "processed" / "lab", home / "reports" / "lab")
    entries = tuple(LogEntry(f"log-{i}", (f"{i}.csv",), "identification", ()) for i in range(logs))
    study = Study(where.raw, "Many logs", dvrk_psm.ROBOT, False, Settings(), entries)
    ledger = Ledger(where)
    joints = [joint.name for joint in study.robot.joints[:2]]
    code = {f"pipeline/module_{i}.py": "0" * 64 for i in range(40)}
    for kind, stage in (("recording", "ingest"), ("signal", "resample"), ("trajectory", "differentiate")):
        for entry in entries:
            outputs = {f"processed/{kind}/{entry.name}/{joint}.parquet": "0" * 64 for joint in joints}
            ledger.write(Entry(stage, entry.name, {"code": code}, outputs))
    kept = [f"{kind}/{joint}/independent.{name}" for kind in ("fit", "cross_fit") for joint in joints for name in "ab"]
    noise = [f"measurement_noise/{joint}" for joint in joints]
    outputs = {f"processed/{name}.parquet": "0" * 64 for name in kept + noise}
    ledger.write(Entry("fit", "fit", {"code": code}, outputs))
    return study, where


def seconds_of_planning(study: Study, where: Folders) -> float:
    start = time.process_time()
    plan = Plan(study, Ledger(where))
    for stage in STAGES:
        for task in plan.tasks(declaration(stage)):
            plan.ledger.reasons(plan.ledger.entry(stage, task.name), task.fingerprint)
    return time.process_time() - start


def test_planning_is_linear_in_the_logs(tmp_path, full, capsys):
    few = 1000 if full else 100
    studies = [synthetic(tmp_path / str(n), n) for n in (few, 10 * few)]
    plan = Plan(studies[0][0], Ledger(studies[0][1]))
    assert len(list(plan.tasks(declaration("predict")))) == 2 * few
    least, most = (min(seconds_of_planning(*study) for _ in range(3)) for study in studies)
    with capsys.disabled():
        print(f"\nplanning {few} logs {least:.2f} s, ten times as many {most / least:.1f} times that", end="")
    assert most < PLANNED * least


def lab(home: Path, logs: int) -> Path:
    folder = home / "raw" / f"lab{logs}"
    for i in range(logs):
        arm.write_csv(folder / f"{i}.csv", [arm.signal("hand_roll", period=2.0, rate=50.0, periods=5, seed=i)])
    tables = (arm.log_table(f"log-{i}", f"{i}.csv", "identification", ["hand_roll"]) for i in range(logs))
    (folder / "study.toml").write_text('robot = "dvrk_psm"\n' + "".join(tables))
    return folder


def quiet(study: Path) -> Runner:
    return Runner(reading.read(study), folders(study, None, None), Console(lambda line: None, lambda line: None))


def seconds_of_stages(study: Path) -> dict[str, float]:
    """Of the processor, so that what else a machine does counts little."""
    taken = {}
    for name in STAGES:
        start = time.process_time()
        assert quiet(study).run([name])
        taken[name] = time.process_time() - start
    return taken


def seconds_of_hashing(where: Folders) -> float:
    files = [f for root in (where.raw, where.processed) for f in root.rglob("*") if f.is_file()]
    ledger = Ledger(replace(where, raw=Path("/")))
    start = time.process_time()
    for file in files:
        ledger.digest(f"raw{file}")
    return time.process_time() - start


@pytest.mark.slow
def test_a_log_costs_the_same_in_a_study_of_many(tmp_path, full, capsys):
    """In every stage that works on logs; the first study only imports and compiles what the others need."""
    few, many = (50, 400) if full else (25, 100)
    _, least, most = (seconds_of_stages(lab(tmp_path, logs)) for logs in (3, few, many))
    grows = {name: most[name] / many / (least[name] / few) for name in STAGES if name != "design"}
    study = tmp_path / "raw" / f"lab{many}"
    start = time.process_time()
    assert quiet(study).run(STAGES)
    checked = (time.process_time() - start) / seconds_of_hashing(folders(study, None, None))
    with capsys.disabled():
        for name, times in grows.items():
            print(
                f"\n{name:14s} {1e3 * most[name] / many:7.2f} ms a log of {many}, {times:.2f} times that of {few}",
                end="",
            )
        print(f"\nnothing to do: {checked:.2f} times the hashing of all files", end="")
    assert max(grows.values()) < GROWS
    assert checked < CHECKED
