"""A Dask cluster on this machine: the same bytes as in one process, whoever is killed, and others are refused."""

import os
import shutil
import signal
import socket
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from pathlib import Path

import pytest

from davinci_forces.errors import BadRequest
from davinci_forces.runner.ledger import Folders, Ledger
from davinci_forces.runner.plan import Plan
from davinci_forces.runner.processes import arithmetic, cluster, workers
from davinci_forces.runner.runs import folders
from davinci_forces.runner.signature import declaration
from davinci_forces.study import reading
from tests import arm, forked
from tests.forked import Started
from tests.test_robustness import flat
from tests.test_runs import call, contents, processed

pytest.importorskip("distributed")
pytestmark = pytest.mark.slow

MODULE = [sys.executable, "-m"]
OF_DASK = ("distributed", "distributed.cli.dask_scheduler", "distributed.cli.dask_worker")
RECORDINGS = int(os.environ.get("DAVINCI_FORCES_RECORDINGS", "4"))


@dataclass
class Local:
    """A scheduler and its workers, each a process of its own."""

    address: str
    log: Path
    settings: dict[str, str] = field(default_factory=dict)  # of Dask
    processes: list[subprocess.Popen | Started] = field(default_factory=list)

    def start(self, *words: str, **environment: str) -> subprocess.Popen | Started:
        if not environment:  # it would count where numpy is loaded
            self.processes.append(forked_of(AS_MODULE, *words, output=self.log, **self.settings))
            return self.processes[-1]
        with self.log.open("ab") as log:
            process = subprocess.Popen(
                [*MODULE, *words],
                stdout=log,
                stderr=log,
                env={**os.environ, **arithmetic.blas_variables(), **environment},
            )
        self.processes.append(process)
        return process

    def add_worker(self, **environment: str) -> subprocess.Popen | Started:
        options = ("--nthreads", "1", "--no-dashboard", "--no-nanny")
        return self.start("distributed.cli.dask_worker", self.address, *options, **environment)


AS_MODULE = """
import sys
from importlib import import_module
import dask
dask.config.refresh()  # by the environment
dask.config.set({"distributed.worker.profile.enabled": False})
import_module(sys.argv.pop(1)).main()
"""


def forked_of(code: str, *words: str, output: Path, errors: Path | None = None, **settings: str) -> Started:
    """A process that runs code with words, forked from one with the package and Dask loaded."""
    forked.prepare(*OF_DASK)
    environment = {**os.environ, **arithmetic.blas_variables(), **settings}
    return Started(["python", "-c", code, *words], Path.cwd(), environment, output, errors)


@contextmanager
def cluster_of(log: Path, protocol: str, **settings: str) -> Iterator[Local]:
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        port = str(free.getsockname()[1])
    here = Local(f"{protocol}://127.0.0.1:{port}", log, settings)
    options = ("--protocol", protocol, "--host", "127.0.0.1", "--port", port, "--no-dashboard")
    here.start("distributed.cli.dask_scheduler", *options)
    try:
        yield here
    finally:
        for process in here.processes:
            process.kill()
            process.wait()


@pytest.fixture
def local(tmp_path) -> Iterator[Local]:
    with cluster_of(tmp_path / "dask.log", "tcp") as here:
        yield here


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
    monkeypatch.setattr(workers, "SECONDS_ALONE", -1.0)
    study = study_of(tmp_path / "one" / "raw" / "lab", RECORDINGS)
    there = tmp_path / "two" / "raw" / "lab"
    shutil.copytree(study, there)
    names = ("measure", "benchmark", "whiteness")
    for name in names:
        call(name, study)
    victim, _ = local.add_worker(), local.add_worker()
    said = tmp_path / "said.txt"
    run = forked_of(RUN, str(there), local.address, *names, output=said)
    tracks = processed(there) / "track"
    while run.poll() is None and not tracks.exists():
        time.sleep(0.05)
    assert run.poll() is None, said.read_text()
    victim.send_signal(signal.SIGKILL)
    run.wait(timeout=60 + 25 * RECORDINGS)
    assert run.returncode == 0, said.read_text()
    made, wanted = contents(processed(there)), contents(processed(study))
    assert not [name for name in {**made, **wanted} if made.get(name) != wanted.get(name)]


RUN = """
import sys
from pathlib import Path
from davinci_forces.runner.processes import arithmetic
arithmetic.pin()
from davinci_forces.runner import runs
from davinci_forces.runner.processes import workers
workers.SECONDS_ALONE = -1.0
study, address, *names = sys.argv[1:]
sys.exit(0 if runs.run(Path(study), names, cluster=address) else 1)
"""


MAIN = """
from davinci_forces.cli import main
from davinci_forces.runner.processes import workers
workers.SECONDS_ALONE = -1.0
main()
"""


@pytest.fixture
def errors(tmp_path) -> Path:
    """The file of what a command says."""
    return tmp_path / "errors.txt"


def command(*words: str, errors: Path) -> Started:
    """The command line, which has others run every task."""
    return forked_of(MAIN, *words, output=errors.with_name("output.txt"), errors=errors)


@pytest.fixture(scope="module")
def whole(tmp_path_factory) -> Path:
    """A study that one process has run."""
    study = study_of(tmp_path_factory.mktemp("whole") / "raw" / "lab", 4)
    call("measure", study)
    return study


@pytest.fixture
def begun(whole, tmp_path) -> Path:
    """The same study, of which nothing is done."""
    shutil.copytree(whole, tmp_path / "raw" / "lab")
    return tmp_path / "raw" / "lab"


def wait_until_made(file: Path, run: Started, errors: Path) -> None:
    while run.poll() is None and not file.exists():
        time.sleep(0.02)
    assert run.poll() is None, errors.read_text()


@pytest.mark.parametrize("record", ["recording", "track"])
def test_a_scheduler_that_is_killed_ends_the_run_in_one_line_and_costs_nothing_made(
    local, whole, begun, errors, record
):
    local.add_worker()
    run = command("measure", str(begun), "--cluster", local.address, errors=errors)
    wait_until_made(processed(begun) / record, run, errors)
    local.processes[0].kill()
    run.wait(timeout=60)
    assert (
        errors.read_text()
        == f"error: the scheduler at {local.address} does not answer any more; finished tasks are kept: run again\n"
    )
    assert run.returncode == 1
    assert (processed(begun) / record).exists()
    assert not [file for file in processed(begun).iterdir() if file.name.startswith(".run-")]
    for worker in local.processes[1:]:  # which write what they are at until they notice
        worker.kill()
        worker.wait()
    call("measure", begun)
    assert contents(processed(begun)) == contents(processed(whole))


@pytest.mark.skipif(sys.platform == "win32", reason="no signals")
@pytest.mark.parametrize(("record", "number"), [("recording", signal.SIGTERM), ("fit", signal.SIGINT)])
def test_a_run_on_a_cluster_that_is_stopped_says_so_and_goes_on_next_time(local, whole, begun, errors, record, number):
    local.add_worker()
    run = command("measure", str(begun), "--cluster", local.address, errors=errors)
    wait_until_made(processed(begun) / record, run, errors)
    run.send_signal(number)
    run.wait(timeout=60)
    assert (errors.read_text(), run.returncode) == ("stopped; run again to continue\n", 128 + number)
    for worker in local.processes[1:]:
        worker.kill()
        worker.wait()
    call("measure", begun)
    assert contents(processed(begun)) == contents(processed(whole))


def test_a_task_that_fails_when_its_run_has_ended_leaves_no_diagnostic(tmp_path, monkeypatch):
    """The next run may have removed what it was writing, and writes diagnostics of its own."""
    study = arm.write_study(tmp_path / "raw" / "arm")
    where = folders(study, None, None)
    task = next(Plan(reading.read(study), Ledger(where)).tasks(declaration("ingest"), "roll"))
    terms = cluster.own_terms(".run-x")
    where.processed.mkdir(parents=True)
    (where.processed / terms.mark).touch()

    def end(files, options):
        (where.processed / terms.mark).unlink(missing_ok=True)
        raise FileNotFoundError(2, "No such file or directory", "x.partial")

    monkeypatch.setattr("davinci_forces.logs.parts.open_parts", end)
    with pytest.raises(FileNotFoundError):
        cluster.perform_there(terms, where, task)
    assert not contents(where.processed)


@pytest.mark.skipif(shutil.which("openssl") is None, reason="openssl makes the certificates")
def test_a_cluster_is_reached_by_tls_with_certificates_in_dasks_configuration_and_not_without(whole, begun, tmp_path):
    names = {"CERT": str(tmp_path / "cert.pem"), "KEY": str(tmp_path / "key.pem")}
    request = ["openssl", "req", "-x509", "-newkey", "rsa:2048", "-nodes", "-subj", "/CN=lab", "-days", "2"]
    out = ["-out", names["CERT"], "-keyout", names["KEY"]]
    subprocess.run([*request, *out], check=True, capture_output=True)
    each = {f"{who}__{what}": file for who in ("SCHEDULER", "WORKER", "CLIENT") for what, file in names.items()}
    settings = {f"DASK_DISTRIBUTED__COMM__TLS__{key}": file for key, file in {**each, "CA_FILE": names["CERT"]}.items()}
    with cluster_of(tmp_path / "dask.log", "tls", **settings) as there:
        there.add_worker()
        said = flat(call("measure", begun, "--cluster", there.address, code=1))
        assert f"{there.address} needs certificates: set distributed.comm.tls.ca-file" in said
        assert not (processed(begun) / "recording").exists()
        options = ("measure", str(begun), "--cluster", there.address)
        ran = subprocess.run(
            [sys.executable, "-c", MAIN, *options], env=os.environ | settings, capture_output=True, check=False
        )
        assert ran.returncode == 0, ran.stderr
    assert contents(processed(begun)) == contents(processed(whole))


def test_an_address_where_nobody_is_is_said(tmp_path, monkeypatch):
    monkeypatch.setattr(cluster, "CONNECT_TIMEOUT", 1.0)
    study = arm.write_study(tmp_path / "raw" / "arm")
    said = flat(call("ingest", study, "--cluster", "tcp://127.0.0.1:9", code=1))
    assert "no scheduler of a Dask cluster answers at tcp://127.0.0.1:9" in said


def test_a_worker_that_reckons_otherwise_is_refused(local, tmp_path, monkeypatch):
    monkeypatch.setattr(workers, "SECONDS_ALONE", -1.0)
    local.add_worker(OPENBLAS_NUM_THREADS="2")
    study = arm.write_study(tmp_path / "raw" / "arm")
    said = flat(call("ingest", study, "--cluster", local.address, code=1))
    assert "BLAS as it was loaded before davinci-forces was instead of BLAS with one thread" in said
    assert "OPENBLAS_NUM_THREADS=1" in said


def test_a_worker_that_lacks_the_folder_or_holds_other_code_is_refused(tmp_path, monkeypatch):
    monkeypatch.setattr(cluster, "CONNECT_TIMEOUT", 0.1)
    there = Folders(tmp_path / "raw", tmp_path / "processed", tmp_path / "reports")
    terms = cluster.own_terms(".run-x")
    with pytest.raises(BadRequest, match=r"does not see .*processed; a cluster needs the same folders"):
        cluster.require_terms(terms, there)
    there.processed.mkdir()
    (there.processed / ".run-x").touch()
    cluster.require_terms(terms, there)
    with pytest.raises(BadRequest, match="has another version of davinci-forces"):
        cluster.require_terms(replace(terms, code="0"), there)
    older = tuple((name, "1.0" if name == "numpy" else version) for name, version in terms.versions)
    with pytest.raises(BadRequest, match=r"has numpy \S+ instead of 1\.0"):
        cluster.require_terms(replace(terms, versions=older), there)
