"""Workers of a Dask cluster: they see the same folders under the same paths, and hold the same code, or are refused."""

import logging
import socket
from collections.abc import Iterator
from concurrent.futures import Executor
from contextlib import contextmanager
from dataclasses import dataclass
from functools import cache
from importlib.metadata import PackageNotFoundError, version
from platform import python_version
from time import sleep
from uuid import uuid4

from davinci_forces.errors import BadRequest
from davinci_forces.files import digest
from davinci_forces.runner.execution import Outcome, perform
from davinci_forces.runner.fingerprints.code import PACKAGE
from davinci_forces.runner.fingerprints.fingerprint import hash_of
from davinci_forces.runner.ledger import Folders
from davinci_forces.runner.plan import Task
from davinci_forces.runner.processes import arithmetic

PACKAGES = ("numpy", "scipy", "numba", "pyarrow", "statsmodels", "clarabel")  # that results are made with
LOGGERS = ("distributed", "distributed.client", "tornado.application", "asyncio")  # of tracebacks of a lost connection
PATIENCE = 10.0  # [s] that a shared file system may take to show a file to others


@dataclass(frozen=True)
class Terms:
    """What a worker has to find to be handed tasks of a study."""

    mark: str  # a file in the processed folder
    code: str
    versions: tuple[tuple[str, str], ...]


@cache
def own_terms(mark: str = "") -> Terms:
    """What this process has."""
    code = {file.relative_to(PACKAGE).as_posix(): digest(file) for file in sorted(PACKAGE.rglob("*.py"))}
    versions = {"Python": python_version(), "arithmetic": arithmetic.described()}
    versions["instructions"] = arithmetic.instructions()
    for name in PACKAGES:
        try:
            versions[name] = version(name)
        except PackageNotFoundError:
            versions[name] = "missing"
    return Terms(mark, hash_of(code), tuple(versions.items()))


def perform_there(terms: Terms, folders: Folders, task: Task) -> Outcome:
    """Run a task in a worker of a cluster.

    Raises
    ------
    BadRequest
        If this worker does not see the study's folders, or its code or libraries are others.
    """
    require(terms, folders)
    return perform(folders, task, folders.processed / terms.mark)


@cache
def require(terms: Terms, folders: Folders) -> None:
    """Refuse to work on what this process sees or does otherwise than the one that asked; raises as `perform_there`."""
    here, own = f"the worker on {socket.gethostname()}", own_terms(terms.mark)
    waited = 0.0
    while not (folders.processed / terms.mark).exists():
        if waited >= PATIENCE:
            raise BadRequest(
                f"{here} does not see {folders.processed}; a cluster needs the same folders under the same paths on "
                "every machine: name ones that are shared with --processed and --reports"
            )
        sleep(0.5)
        waited += 0.5
    if own.code != terms.code:
        raise BadRequest(
            f"{here} holds another version of davinci-forces; install the same one there and start it anew"
        )
    if others := sorted({*own.versions} - {*terms.versions}):
        wanted = dict(terms.versions)
        said = ", ".join(f"{name} {has} instead of {wanted[name]}" for name, has in others)
        settings = " ".join(f"{name}={value}" for name, value in arithmetic.wanted().items())
        raise BadRequest(
            f"{here} has {said}; numbers would differ: start it in the same environment, with {settings} set"
        )


@contextmanager
def connected(address: str, folders: Folders) -> Iterator[tuple[Executor, int, Terms]]:
    """The workers of a cluster as an executor, how many tasks they run at once, and on what terms they are handed them.

    Raises
    ------
    BadRequest
        If there is no scheduler at the address or it ends, workers end again and again, or Dask is not installed.
    """
    try:
        from distributed import Client, KilledWorker, Security
    except ImportError:
        raise BadRequest(
            "--cluster needs Dask, which is not installed: python -m pip install 'davinci-forces[cluster]'"
        ) from None
    try:
        if address.startswith("tls:") and not Security().get_connection_args("client")["ssl_context"]:
            names = "ca-file, client.cert and client.key"
            raise BadRequest(f"{address} needs certificates: set distributed.comm.tls.{names} in Dask's configuration")
        client = Client(address, timeout=PATIENCE, set_as_default=False)
    except (OSError, RuntimeError, ValueError) as error:
        raise BadRequest(f"no scheduler of a Dask cluster answers at {address}: {error}") from None
    terms = own_terms(f".run-{uuid4().hex[:12]}")
    mark = folders.processed / terms.mark
    folders.processed.mkdir(parents=True, exist_ok=True)
    mark.touch()
    levels = {logger: logger.level for logger in map(logging.getLogger, LOGGERS)}
    for logger in levels:
        logger.setLevel(logging.CRITICAL)
    try:
        yield client.get_executor(pure=False), max(sum(client.nthreads().values()), 1), terms
    except KilledWorker as error:
        raise BadRequest(f"workers of the cluster ended again and again, perhaps for want of memory: {error}") from None
    except Exception:
        if client.status == "running":
            raise
        says = f"the scheduler at {address} is gone; what was finished is kept: run again"
        raise BadRequest(says) from None
    finally:
        mark.unlink(missing_ok=True)
        client.close()
    for logger, level in levels.items():  # not after an error: what a lost connection leaves behind speaks later
        logger.setLevel(level)
