"""Run tasks on workers of a Dask cluster that see the same folders under the same paths and have the same code."""

import logging
import socket
from collections.abc import Iterator
from concurrent.futures import Executor
from contextlib import contextmanager
from dataclasses import dataclass
from functools import cache
from importlib.metadata import version
from platform import python_version
from time import sleep
from uuid import uuid4

from davinci_forces.errors import BadRequest, install
from davinci_forces.runner.execution import Outcome, perform
from davinci_forces.runner.fingerprint import package_fingerprint
from davinci_forces.runner.ledger import Folders
from davinci_forces.runner.plan import Task
from davinci_forces.runner.processes import arithmetic

RESULT_PACKAGES = ("numpy", "scipy", "numba", "pyarrow", "statsmodels", "clarabel")
# These loggers print tracebacks when a connection is lost.
CONNECTION_LOGGERS = ("distributed", "distributed.client", "tornado.application", "asyncio")
CONNECT_TIMEOUT = 10.0  # [s] for a scheduler to answer, and for a shared file system to show a new file


@dataclass(frozen=True)
class Terms:
    """The conditions that a worker must meet to run tasks of a study."""

    mark: str  # a file in the processed folder
    code: str
    versions: tuple[tuple[str, str], ...]


@cache
def own_terms(mark: str = "") -> Terms:
    """The terms that this process meets."""
    versions = {name: version(name) for name in RESULT_PACKAGES} | {"Python": python_version()}
    versions |= {"arithmetic": arithmetic.description(), "instructions": arithmetic.instructions()}
    return Terms(mark, package_fingerprint(), tuple(versions.items()))


def perform_there(terms: Terms, folders: Folders, task: Task) -> Outcome:
    """Run a task in a worker of a cluster; raises BadRequest if it lacks the folders or has other code."""
    require_terms(terms, folders)
    return perform(folders, task, folders.processed / terms.mark)


@cache
def require_terms(terms: Terms, folders: Folders) -> None:
    """Check that this process meets the terms; raises as `perform_there`."""
    here, actual = f"the worker on {socket.gethostname()}", own_terms(terms.mark)
    waited = 0.0
    while not (folders.processed / terms.mark).exists():
        if waited >= CONNECT_TIMEOUT:
            need = "a cluster needs the same folders under the same paths on every machine"
            remedy = "name ones that are shared with --processed and --reports"
            raise BadRequest(f"{here} does not see {folders.processed}; {need}: {remedy}")
        sleep(0.5)
        waited += 0.5
    if actual.code != terms.code:
        raise BadRequest(f"{here} has another version of davinci-forces; install the same one there and restart it")
    if others := sorted({*actual.versions} - {*terms.versions}):
        expected = dict(terms.versions)
        versions = ", ".join(f"{name} {version} instead of {expected[name]}" for name, version in others)
        settings = " ".join(f"{name}={value}" for name, value in arithmetic.blas_variables().items())
        remedy = f"start it in the same environment, with {settings} set"
        raise BadRequest(f"{here} has {versions}; numbers would differ: {remedy}")


@contextmanager
def connect(address: str, folders: Folders) -> Iterator[tuple[Executor, int, Terms]]:
    """Connect to a cluster; yield its executor, how many tasks it runs at once, and the terms for its workers.

    Raises BadRequest if no scheduler is at the address or it ends, workers are killed repeatedly, or Dask is not
    installed.
    """
    try:
        from distributed import Client, KilledWorker, Security
    except ImportError:
        raise BadRequest(f"--cluster needs Dask, which is not installed; run: {install('distributed')}") from None
    try:
        if address.startswith("tls:") and not Security().get_connection_args("client")["ssl_context"]:
            names = "ca-file, client.cert and client.key"
            raise BadRequest(f"{address} needs certificates: set distributed.comm.tls.{names} in Dask's configuration")
        client = Client(address, timeout=CONNECT_TIMEOUT, set_as_default=False)
    except (OSError, RuntimeError, ValueError) as error:
        raise BadRequest(f"no scheduler of a Dask cluster answers at {address}: {error}") from None
    terms = own_terms(f".run-{uuid4().hex[:12]}")
    mark = folders.processed / terms.mark
    folders.processed.mkdir(parents=True, exist_ok=True)
    mark.touch()
    levels = {logger: logger.level for logger in map(logging.getLogger, CONNECTION_LOGGERS)}
    for logger in levels:
        logger.setLevel(logging.CRITICAL)
    try:
        yield client.get_executor(pure=False), max(sum(client.nthreads().values()), 1), terms
    except KilledWorker as error:
        raise BadRequest(f"workers were killed repeatedly, perhaps because memory ran out: {error}") from None
    except Exception:
        if client.status == "running":
            raise
        message = f"the scheduler at {address} does not answer any more; finished tasks are kept: run again"
        raise BadRequest(message) from None
    finally:
        mark.unlink(missing_ok=True)
        client.close()
    for logger, level in levels.items():  # not after an error: what a lost connection leaves behind speaks later
        logger.setLevel(level)
