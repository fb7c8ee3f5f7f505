"""Tasks in other processes: all are done, whoever is killed, and nobody is left behind."""

import os
import re
import signal
import subprocess
import sys
import time
from collections.abc import Iterable
from concurrent.futures import BrokenExecutor, Executor, Future
from contextlib import closing
from functools import partial
from pathlib import Path

import pytest

from davinci_forces.runner.console import Console
from davinci_forces.runner.execution import Outcome
from davinci_forces.runner.fingerprint import Fingerprint
from davinci_forces.runner.graph import ALL_LOGS, Graph, Part, every_step, required_steps
from davinci_forces.runner.plan import Task
from davinci_forces.runner.processes import workers
from davinci_forces.runner.processes.workers import TaskQueue, WorkerPool, pool
from davinci_forces.runner.runner import Runner
from davinci_forces.runner.runs import folders
from davinci_forces.study import reading
from tests import arm

pytestmark = pytest.mark.medium


def task(name: str) -> Task:
    return Task("ingest", name, Fingerprint({}, {}, {}, {}, {}, "1"))


def tell_process(each: Task) -> Outcome:
    return Outcome(each, {"pid": str(os.getpid())})


def die_once(mark: Path, each: Task) -> Outcome:
    """The second task kills the process that it is in, the first time."""
    if each.name == "2" and not mark.exists():
        mark.touch()
        os.kill(os.getpid(), signal.SIGKILL)
    return Outcome(each, {})


def die(each: Task) -> Outcome:
    os.kill(os.getpid(), signal.SIGKILL)
    raise AssertionError


def outcomes(crew: TaskQueue) -> list[Outcome]:
    done = []
    while not crew.idle:
        done += crew.outcomes()
    return done


@pytest.fixture
def at_once(monkeypatch):
    """Others are started for the first task."""
    monkeypatch.setattr(workers, "SECONDS_ALONE", -1.0)


def test_tasks_run_here_while_there_is_little_to_do():
    with closing(TaskQueue(WorkerPool(partial(pool, 2)))) as crew:
        for i in range(20):
            crew.submit(tell_process, task(str(i)))
        assert {o.outputs["pid"] for o in outcomes(crew)} == {str(os.getpid())}
        assert crew.counts == (20, 20)


def test_tasks_run_elsewhere_where_there_is_much(at_once):
    with closing(TaskQueue(WorkerPool(partial(pool, 2)))) as crew:
        for i in range(20):
            crew.submit(tell_process, task(str(i)))
        done = outcomes(crew)
        assert {o.task.name for o in done} == {str(i) for i in range(20)}
        assert str(os.getpid()) not in {o.outputs["pid"] for o in done}


def test_a_worker_that_is_killed_is_replaced_and_its_task_runs_again(at_once, tmp_path):
    with closing(TaskQueue(WorkerPool(partial(pool, 2)))) as crew:
        for i in range(12):
            crew.submit(partial(die_once, tmp_path / "mark"), task(str(i)))
        assert sorted(int(o.task.name) for o in outcomes(crew)) == list(range(12))
        assert crew.restarts == 1


def test_a_worker_that_is_killed_with_nothing_to_do_is_replaced(at_once):
    with closing(TaskQueue(WorkerPool(partial(pool, 1)))) as crew:
        pids = set()
        for names in (("1", "2"), ("3", "4")):
            for name in names:
                crew.submit(tell_process, task(name))
            done = outcomes(crew)
            assert {o.task.name for o in done} == {*names}
            pids |= {o.outputs["pid"] for o in done}
            os.kill(int(done[0].outputs["pid"]), signal.SIGKILL)
            time.sleep(0.5)
        assert len(pids) == 2


def test_a_task_that_ends_every_worker_ends_the_run(at_once):
    with closing(TaskQueue(WorkerPool(partial(pool, 2)))) as crew:
        for i in range(2):
            crew.submit(die, task(str(i)))
        with pytest.raises(BrokenExecutor):
            outcomes(crew)


class Recording(Executor):
    """Runs what it is handed at once, in this process, and remembers how many tasks that was at a time."""

    def __init__(self) -> None:
        self.shares: list[int] = []

    def submit(self, function, /, share):
        self.shares.append(len(share))
        future = Future()
        future.set_result(function(share))
        return future


def took(seconds: float, each: Task) -> Outcome:
    return Outcome(each, {}, seconds=seconds)


@pytest.mark.parametrize(("seconds", "together"), [(0.03, 7), (0.15, 2), (1.0, 1)])
def test_tasks_that_are_known_to_be_short_are_handed_over_together(at_once, seconds, together):
    there = Recording()
    crew = TaskQueue(WorkerPool(lambda: there, hands=2))
    for i in range(400):
        crew.submit(partial(took, seconds), task(str(i)))
    assert [int(o.task.name) for o in outcomes(crew)] == list(range(400))
    assert there.shares[:6] == [1] * 6  # of which nothing was known
    assert max(there.shares) == together
    assert there.shares[-1] <= 2  # so that all end at about the same time
    assert sum(there.shares) == 400


def test_what_one_of_the_others_left_half_written_goes_with_the_run_though_nobody_knows_of_its_end(at_once, tmp_path):
    study = arm.write_study(tmp_path / "raw" / "arm")

    class Leaving(Recording):
        def submit(self, function, /, share):
            (tmp_path / "processed" / "arm" / "recording.parquet.0123.partial").touch()
            return super().submit(function, share)

    there = Leaving()
    where, silent = folders(study, None, None), Console(lambda line: None, lambda line: None)
    assert Runner(reading.read(study), where, silent, others=WorkerPool(lambda: there)).run(["ingest"])
    assert there.shares
    assert (where.processed / "recording").is_dir()
    assert not list(where.processed.rglob("*.partial"))


def test_others_are_prepared_as_soon_as_there_is_work_for_them_in_sight(monkeypatch):
    monkeypatch.setattr(workers, "SECONDS_ALONE", 0.2)
    prepared: list[int] = []
    crew = TaskQueue(WorkerPool(Recording, hands=2, prepare=lambda: prepared.append(crew.counts[0])))
    for i in range(40):
        crew.submit(lambda each: time.sleep(0.01) or Outcome(each, {}), task(str(i)))
    assert len(outcomes(crew)) == 40
    assert prepared == [1]  # the other 39 will take as long as the first


LEFT = """
import sys
from functools import partial
from pathlib import Path
sys.path[:0] = [{root!r}]
from davinci_forces.runner.processes import workers
from tests.test_workers import {busy}, task
workers.SECONDS_ALONE = -1.0
if __name__ == "__main__":
    crew = workers.TaskQueue(workers.WorkerPool(partial(workers.pool, 2)))
    for i in range(2):
        crew.submit(partial({busy}, Path(sys.argv[1])), task(str(i)))
    list(crew.outcomes())
"""


def sleep(folder: Path, each: Task) -> Outcome:
    (folder / str(os.getpid())).touch()
    time.sleep(600)
    return Outcome(each, {})


def compute(folder: Path, each: Task) -> Outcome:
    """Compute for longer than anybody waits, and let no other thread have a turn meanwhile, as a compiler does."""
    (folder / str(os.getpid())).touch()
    re.match("(a+)+b", "a" * 60)
    return Outcome(each, {})


def alive(pid: int) -> bool:
    try:
        return Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0] != "Z"
    except OSError:
        return False


def end_within(seconds: float, pids: Iterable[int]) -> bool:
    """Whether these processes all end in so long."""
    until = time.monotonic() + seconds
    while any(map(alive, pids)) and time.monotonic() < until:
        time.sleep(0.05)
    return not any(map(alive, pids))


@pytest.mark.skipif(sys.platform != "linux", reason="asks /proc who is alive")
@pytest.mark.parametrize("busy", [sleep, compute], ids=lambda busy: busy.__name__)
def test_workers_end_with_their_parent_however_it_ends(tmp_path, busy):
    script = tmp_path / "left.py"
    script.write_text(LEFT.format(root=str(Path(__file__).parents[1]), busy=busy.__name__))
    pids = tmp_path / "pids"
    pids.mkdir()
    parent = subprocess.Popen([sys.executable, str(script), str(pids)])
    until = time.monotonic() + 120
    while len(list(pids.iterdir())) < 2 and time.monotonic() < until:
        time.sleep(0.1)
    working = [int(file.name) for file in pids.iterdir()]
    assert len(working) == 2
    assert all(map(alive, working))
    parent.kill()
    parent.wait()
    assert end_within(5.0, working)


LOGS = ("one", "two")


def order(names) -> list[list[Part]]:
    """The batches in which a run begins its parts, each of them done before the next."""
    graph, batches = Graph(names, LOGS), []
    while batch := graph.next():
        batches.append(batch)
        for part in batch:
            graph.finish(part)
    return batches


def test_every_part_of_a_run_begins_once_and_after_the_stages_before_it():
    steps = required_steps(["report"])
    batches = order(steps)
    begun = [part for batch in batches for part in batch]
    assert len(begun) == len(set(begun)) == len(Graph(steps, LOGS).parts)
    assert begun[-1] == Part("report", ALL_LOGS)
    named = [part.step for part in begun]
    assert named == sorted(named, key=steps.index)


def finish(graph: Graph, steps: set[str]) -> list[Part]:
    """Finish the parts of these steps as they begin; return the other parts that begin."""
    others = []
    while begun := [part for batch in iter(graph.next, []) for part in batch]:
        others += [part for part in begun if part.step not in steps]
        for part in begun:
            if part.step in steps:
                graph.finish(part)
    return others


def test_a_log_waits_for_what_is_made_of_it_and_a_stage_of_all_logs_for_all():
    graph = Graph(every_step(), LOGS)
    assert {part.step for part in finish(graph, set())} == {"design", "ingest"}
    graph.finish(Part("ingest", "one"))
    assert graph.next() == [Part("resample", "one")]
    graph.finish(Part("resample", "one"))
    waiting = finish(graph, {"average", "differentiate"})
    assert {part.log for part in waiting} <= {"one"}
    assert not {part.step for part in waiting} & {"fit", "choose", "predict", "tune"}
    graph.finish(Part("ingest", "two"))
    begun = finish(graph, {"ingest", "resample", "average", "differentiate"})
    assert {part.step for part in begun} >= {"fit", "choose"}
