"""Which tasks a study gives, and what each of them is handed: what is about its own log and joint, and nothing else."""

import pickle
import sys
from collections import Counter
from dataclasses import replace

import pytest

from davinci_forces.records import KINDS, Fit, LogSummary, MeasurementNoise, Signal, Track, Whiteness
from davinci_forces.robots import dvrk_psm
from davinci_forces.runner.fingerprint import Fingerprint, schemas
from davinci_forces.runner.graph import every_step
from davinci_forces.runner.ledger import Entry, Folders, Ledger
from davinci_forces.runner.plan import Plan, log_and_joint
from davinci_forces.runner.signature import declaration
from davinci_forces.study import LogEntry, Settings, Study
from tests import many

ROLL, PITCH = (joint.name for joint in dvrk_psm.ROBOT.joints[:2])
LOGS = ("zebra", "aardvark")
NOTHING = Fingerprint({}, {}, {}, {}, {}, "")


@pytest.fixture
def plan(tmp_path) -> Plan:
    """Two logs of two joints, in another order than their names', as the stages before the predictions leave them."""
    folders = Folders(tmp_path / "raw", tmp_path / "processed", tmp_path / "reports")
    entries = tuple(LogEntry(log, (f"{log}.csv",), "identification", ()) for log in LOGS)
    ledger = Ledger(folders)

    def write(stage: str, task: str, *names: str) -> None:
        outputs = {f"processed/{name}.parquet": "0" for name in names}
        ledger.write(Entry(stage, task, vars(NOTHING), outputs))

    for log in (*LOGS, "gone"):
        write("resample", log, *(f"{kind}/{log}/{joint}" for kind in ("signal", "motion") for joint in (PITCH, ROLL)))
        write("predict", log, *(f"joint_model/{log}/{joint}" for joint in (PITCH, ROLL)))
        write("differentiate", log, *(f"trajectory/{log}/{joint}" for joint in (PITCH, ROLL)))
    joints = (PITCH, ROLL)
    pooled = [f"{kind}/{joint}/independent.lse" for kind in ("fit", "cross_fit") for joint in joints]
    noise = [f"{kind}/{joint}" for kind in ("fitted_paths", "measurement_noise") for joint in joints]
    write("fit", "fit", *pooled, *noise)
    return Plan(Study(folders.raw, "T", dvrk_psm.ROBOT, False, Settings(), entries), Ledger(folders))


@pytest.mark.parametrize(
    ("kind", "place", "log", "joint"),
    [
        (Signal, "signal/a/roll.parquet", "a", "roll"),
        (Whiteness, "whiteness/a/roll.tau.independent.lse.parquet", "a", "roll"),
        (Fit, "fit/roll/independent.lse.parquet", "", "roll"),
        (MeasurementNoise, "measurement_noise/roll.parquet", "", "roll"),
        (LogSummary, "log_summary/a.parquet", "a", ""),
        (KINDS["Excitation"], "excitation/roll/published.parquet", "", "roll"),
        (KINDS["Diagnostic"], "diagnostic/fit/roll.parquet", "", ""),
    ],
)
def test_a_place_says_what_its_record_is_about(kind, place, log, joint):
    assert log_and_joint(kind, place) == (log, joint)


def test_records_come_in_the_order_of_the_studys_logs_and_the_robots_joints(plan):
    names = [place for _, place in plan.places().find((Track, Signal))]
    assert names == [f"signal/{log}/{joint}.parquet" for log in LOGS for joint in (ROLL, PITCH)]


def test_a_log_that_has_left_the_study_has_no_records(plan):
    assert not [place for _, place in plan.places().find(tuple(KINDS.values())) if "gone" in place]


def handed(plan: Plan, step: str) -> dict[str, list[str]]:
    """The places of the records that the call of a step about one log is handed."""
    tasks = {task.name: task for task in plan.tasks(declaration(step))}
    assert list(tasks) == list(LOGS)
    return {parameter: [str(place) for _, place in located] for parameter, located in tasks["zebra"].records.items()}


def test_a_call_gets_the_records_about_its_own_log_and_joint(plan):
    joints = (ROLL, PITCH)
    motions = [f"motion/zebra/{joint}.parquet" for joint in joints]
    assert handed(plan, "predict") == {
        "motions": motions,
        "fits": [
            *(f"fit/{joint}/independent.lse.parquet" for joint in joints),
            *(f"fitted_paths/{joint}.parquet" for joint in joints),
        ],
    }
    assert handed(plan, "fit.apply") == {
        "motions": motions,
        "trajectories": [f"trajectory/zebra/{joint}.parquet" for joint in joints],
        "cross_fits": [f"cross_fit/{joint}/independent.lse.parquet" for joint in joints],
    }
    [whole] = plan.tasks(declaration("fit"))
    assert len(whole.records["trajectories"]) == len(LOGS) * 2


def test_a_fit_reads_the_motion_of_identification_logs_only(plan):
    first, second = plan.study.logs
    study = replace(plan.study, logs=(first, replace(second, role="validation")))
    for stage in ("fit", "choose"):
        [task] = Plan(study, plan.ledger).tasks(declaration(stage))
        assert [place for _, place in task.records["motions"]] == [
            f"motion/{first.name}/{joint}.parquet" for joint in (ROLL, PITCH)
        ]


@pytest.mark.parametrize("stage", ["ingest", "average", "resample", "predict", "ekf"])
def test_a_task_knows_nothing_of_other_logs(plan, stage):
    tasks = list(plan.tasks(declaration(stage)))
    assert tasks or stage == "resample"
    for task in tasks:
        sent = pickle.dumps(task)
        assert [log for log in LOGS if log.encode() in sent] == [task.name.partition("/")[0]]


def test_a_stage_depends_on_the_settings_and_things_that_its_signature_names(plan):
    task = next(plan.tasks(declaration("predict")))
    assert task.fingerprint.settings == {"fit": Settings().fit, "lowpass": Settings().lowpass}
    assert task.given.keys() == {"entry", "robot"} == task.fingerprint.given.keys()


def test_what_is_read_counts_by_name_type_and_unit_and_what_is_written_by_meaning_too(monkeypatch):
    from davinci_forces.records.quantities import QUANTITIES

    before = {stage: schemas(stage) for stage in ("predict", "fit", "whiteness")}
    read = {"Motion", "FittedPaths", "Fit", "Choice"}
    assert before["predict"].keys() == {*read, "Prediction", "PathShare", "Diagnostic"}

    def changed(**what: str) -> set[tuple[str, str]]:
        schemas.cache_clear()
        with monkeypatch.context() as patch:
            patch.setitem(QUANTITIES, "theta", QUANTITIES["theta"]._replace(**what))
            now = {stage: schemas(stage) for stage in before}
        schemas.cache_clear()
        return {
            (stage, kind) for stage, kinds in now.items() for kind, sha in kinds.items() if sha != before[stage][kind]
        }

    assert changed(meaning="in other words") == {("fit", "Fit"), ("fit", "CrossFit"), ("fit", "Guess")}
    assert changed(unit="kg") == {("fit", "Fit"), ("fit", "CrossFit"), ("fit", "Guess"), ("predict", "Fit")}


@pytest.fixture
def few_and_many(tmp_path) -> list[tuple[Study, Folders]]:
    return [many.study(tmp_path / str(logs), logs) for logs in (20, 200)]


def test_what_a_call_reads_does_not_grow_with_the_logs(few_and_many):
    """Unless it is the only call of its stage."""
    reads = []
    for study, folders in few_and_many:
        plan = Plan(study, Ledger(folders))
        tasks = {step: list(plan.tasks(declaration(step))) for step in every_step()}
        reads.append({s: max(len(t.fingerprint.inputs) for t in every) for s, every in tasks.items() if len(every) > 1})
        pooled = {
            "design",
            "fit",
            "choose",
            "tune.gather",
            "calibrate.gather",
            "assess.gather",
            "stream.gather",
            "resolve.gather",
            "haptic-limits",
        }
        assert {s for s, every in tasks.items() if len(every) == 1} == pooled
    assert reads[0] == reads[1]


def test_planning_takes_steps_in_proportion_to_the_logs(few_and_many):
    """Calls of functions are counted, as seconds depend on what else a machine does."""
    steps = []
    for lab in [few_and_many[0], *few_and_many]:  # first, what is worked out once a process
        calls = Counter[str]()
        sys.setprofile(lambda frame, event, _, calls=calls: calls.update([event]))
        try:
            many.planned(*lab)
        finally:
            sys.setprofile(None)
        steps.append(calls["call"] + calls["c_call"])
    assert steps[2] < 10.5 * steps[1]
