"""A Dask cluster on this machine: the same bytes as in one process, whoever is killed, and others are refused."""

import os
import shutil
import signal
import socket
import subprocess
import sys
import time
from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from pathlib import Path

import pytest

from davinci_forces.errors import BadRequest
from davinci_forces.runner.ledger import Folders
from davinci_forces.runner.processes import arithmetic, cluster, workers
from tests import arm
from tests.test_robustness import flat
from tests.test_runs import call, contents, processed

pytest.importorskip("distributed")
pytestmark = pytest.mark.slow

MODULE = [sys.executable, "-m"]
RECORDINGS = int(os.environ.get("DAVINCI_FORCES_RECORDINGS", "24"))


@dataclass
class Local:
    """A scheduler and its workers, each a process of its own."""

    address: str
    log: Path
    processes: list[subprocess.Popen] = field(default_factory=list)

    def start(self, *words: str, **environment: str) -> subprocess.Popen:
        with self.log.open("ab") as log:
            process = subprocess.Popen(
                [*MODULE, *words], stdout=log, stderr=log, env={**os.environ, **arithmetic.wanted(), **environment}
            )
        self.processes.append(process)
        return process

    def add_worker(self, **environment: str) -> subprocess.Popen:
        options = ("--nthreads", "1", "--no-dashboard", "--no-nanny")
        return self.start("distributed.cli.dask_worker", self.address, *options, **environment)


@pytest.fixture
def local(tmp_path) -> Iterator[Local]:
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        port = free.getsockname()[1]
    here = Local(f"tcp://127.0.0.1:{port}", tmp_path / "dask.log")
    here.start("distributed.cli.dask_scheduler", "--host", "127.0.0.1", "--port", str(port), "--no-dashboard")
    yield here
    for process in here.processes:
        process.kill()
        process.wait()


def study_of(folder: Path, count: int) -> Path:
    """Logs of one joint with different seeds, every fourth of another path."""
    for i in range(count):
        signal = arm.signal("hand_roll", period=2.6 if i % 4 == 3 else 2.0, rate=50.0, periods=5, seed=i)
        arm.write_csv(folder / f"log{i}.csv", [signal])
    tables = (arm.log_table(f"log{i}", f"log{i}.csv", "identification", ["hand_roll"]) for i in range(count))
    arm.write_robot(folder)
    (folder / "study.toml").write_text('robot = "arm.toml"\n' + "".join(tables))
    return folder


def test_a_cluster_gives_the_same_bytes_though_a_worker_is_killed(local, tmp_path, monkeypatch):
    monkeypatch.setattr(workers, "ALONE", -1.0)
    study = study_of(tmp_path / "one" / "raw" / "lab", RECORDINGS)
    there = tmp_path / "two" / "raw" / "lab"
    shutil.copytree(study, there)
    names = ("measure", "benchmark", "whiteness")
    for name in names:
        call(name, study)
    victim, _ = local.add_worker(), local.add_worker()
    run = subprocess.Popen(
        [sys.executable, "-c", RUN, str(there), local.address, *names], stdout=subprocess.PIPE, stderr=subprocess.STDOUT
    )
    tracks = processed(there) / "track"
    while run.poll() is None and not tracks.exists():
        time.sleep(0.05)
    assert run.poll() is None, run.stdout.read().decode()
    victim.send_signal(signal.SIGKILL)
    said, _ = run.communicate(timeout=60 + 25 * RECORDINGS)
    assert run.returncode == 0, said.decode()
    made, wanted = contents(processed(there)), contents(processed(study))
    assert not [name for name in {**made, **wanted} if made.get(name) != wanted.get(name)]


RUN = """
import sys
from pathlib import Path
from davinci_forces.runner.processes import arithmetic
arithmetic.pin()
from davinci_forces.runner import runs
from davinci_forces.runner.processes import workers
workers.ALONE = -1.0
study, address, *names = sys.argv[1:]
sys.exit(0 if runs.run(Path(study), names, cluster=address) else 1)
"""


def test_an_address_where_nobody_is_is_said(tmp_path, monkeypatch):
    monkeypatch.setattr(cluster, "PATIENCE", 1.0)
    study = arm.write_study(tmp_path / "raw" / "arm")
    said = flat(call("ingest", study, "--cluster", "tcp://127.0.0.1:9", code=1))
    assert "no scheduler of a Dask cluster answers at tcp://127.0.0.1:9" in said


def test_a_worker_that_reckons_otherwise_is_refused(local, tmp_path, monkeypatch):
    monkeypatch.setattr(workers, "ALONE", -1.0)
    local.add_worker(OPENBLAS_NUM_THREADS="2")
    study = arm.write_study(tmp_path / "raw" / "arm")
    said = flat(call("ingest", study, "--cluster", local.address, code=1))
    assert "BLAS as it was loaded before davinci-forces was instead of BLAS with one thread" in said
    assert "OPENBLAS_NUM_THREADS=1" in said


def test_a_worker_that_lacks_the_folder_or_holds_other_code_is_refused(tmp_path, monkeypatch):
    monkeypatch.setattr(cluster, "PATIENCE", 0.1)
    folders = Folders(tmp_path / "raw", tmp_path / "processed", tmp_path / "reports")
    terms = cluster.own_terms(".run-x")
    with pytest.raises(BadRequest, match=r"does not see .*processed; a cluster needs the same folders"):
        cluster.require(terms, folders)
    folders.processed.mkdir()
    (folders.processed / ".run-x").touch()
    cluster.require(terms, folders)
    with pytest.raises(BadRequest, match="holds another version of davinci-forces"):
        cluster.require(replace(terms, code="0"), folders)
    older = tuple((name, "1.0" if name == "numpy" else version) for name, version in terms.versions)
    with pytest.raises(BadRequest, match=r"has numpy \S+ instead of 1\.0"):
        cluster.require(replace(terms, versions=older), folders)
