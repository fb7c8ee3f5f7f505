"""Child processes that read logs: the parent's side, which keeps or ends them, and their own side, with its limits."""

import atexit
import ctypes
import os
import pickle
import signal
import subprocess
import sys
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from importlib import import_module
from pathlib import Path
from threading import Timer
from typing import IO, Any

from davinci_forces.errors import BadLog
from davinci_forces.logs.log import Log
from davinci_forces.maths.arrays import Array

Message = dict[str, Any]
Answer = tuple[Message, list[Array]]

REMEDY = "it is damaged; record it again, or take it out of study.toml"
MAX_WAITING = 2  # children kept for the next log: starting one takes longer than reading a small file
START = "import sys; sys.path[:] = {path!r}; from davinci_forces.logs.isolated.process import serve; serve()"
OUT_OF_TIME = 24  # the signal SIGXCPU, which Windows does not have
PACKAGES = Path(__file__).parents[3]
# One thread each, and Arrow's memory from the system: memory that libraries reserve in advance counts as used.
CHILD_ENVIRONMENT = {"OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1", "ARROW_DEFAULT_MEMORY_POOL": "system"}
FINAL_FIELDS = ("facts", "warnings", "comments", "dropped", "cut")  # of a log, complete after its last block
FIELDS = ("format", "channels", "clock", "time", "started", "zone", *FINAL_FIELDS)
PR_SET_PDEATHSIG = 1  # of Linux's prctl(2): the signal that a process gets when the thread that started it ends


def send(stream: IO[bytes], message: Message, columns: Sequence[Array] = ()) -> None:
    """Write a message and columns of samples."""
    pickle.dump((message, columns), stream, protocol=5)
    stream.flush()


class ChildEnded(Exception):
    """A child has ended; the message says why."""


class Child:
    """A process that reads logs."""

    def __init__(self) -> None:
        path = [str(PACKAGES), *(entry or os.getcwd() for entry in sys.path)]
        self.owner = os.getpid()
        self.late = False
        with block_interrupts():
            self.process = subprocess.Popen(
                [sys.executable, "-S", "-c", START.format(path=path)], stdin=subprocess.PIPE, stdout=subprocess.PIPE,
                stderr=subprocess.DEVNULL, env=os.environ | CHILD_ENVIRONMENT,
            )  # fmt: skip

    def answers(self, request: Message) -> Iterator[Answer]:
        """Send a request, and yield the answers piece by piece; raises ChildEnded if the child ends, or is late."""
        assert self.process.stdin
        assert self.process.stdout
        more = True
        try:
            send(self.process.stdin, request)
            while more:
                with self._within(request["seconds"]):
                    message, columns = pickle.load(self.process.stdout)
                more = message.pop("more", False)
                yield message, columns
        except (EOFError, OSError, pickle.UnpicklingError) as error:
            code = self.process.wait()
            why = f"crashes the reader process ({f'signal {-code}' if code < 0 else f'code {code}'})"
            if self.late:
                why = f"takes more than {request['seconds']:.0f} s"
            elif code == -OUT_OF_TIME:
                why = f"takes more than {request['cpu']:.0f} s of CPU time"
            raise ChildEnded(why) from error

    @contextmanager
    def _within(self, seconds: float) -> Iterator[None]:
        timer = Timer(seconds, self._end_late)
        timer.daemon = True
        timer.start()
        try:
            yield
        finally:
            timer.cancel()
            timer.join()  # a thread that still runs when the interpreter ends may abort the process

    def _end_late(self) -> None:
        self.late = True
        self.process.kill()

    def close(self) -> None:
        """End the process if this process started it: after a fork, the parent's children are listed here, too."""
        if self.owner != os.getpid():
            self.process.returncode = 0
            return
        self.process.kill()
        for stream in (self.process.stdin, self.process.stdout):
            with suppress(OSError):
                stream.close()  # type: ignore[union-attr]  # both are pipes
        self.process.wait()


_waiting: list[Child] = []


def answers(request: Message) -> Iterator[Answer]:
    """Have a child answer a request, and keep it for the next one if it answered completely; raises as `Child` does."""
    taken, whole = _taken(), False
    try:
        yield from taken.answers(request)
        whole = True
    finally:
        if whole and len(_waiting) < MAX_WAITING:
            _waiting.append(taken)
        else:
            taken.close()


def _taken() -> Child:
    while True:
        try:
            waiting = _waiting.pop()
        except IndexError:
            return Child()
        if waiting.owner == os.getpid() and waiting.process.poll() is None:
            return waiting
        waiting.close()


@atexit.register
def close_all() -> None:
    """End the waiting children."""
    while _waiting:
        _waiting.pop().close()


@contextmanager
def block_interrupts(*also: signal.Signals) -> Iterator[None]:
    """Start processes that ignore Ctrl-C, because their parent ends them; the signals `also` wait meanwhile, too."""
    if sys.platform == "win32":
        yield
        return
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT, *also})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


def end_with_parent() -> None:
    """Have the system end this process when its parent ends; only Linux can.

    A thread that waits for the end of the parent would need the interpreter, which other threads hold while they
    compile or import.
    """
    if sys.platform == "linux":
        ctypes.CDLL(None).prctl(PR_SET_PDEATHSIG, signal.SIGKILL)


_opened: dict[Any, Log] = {}  # the log that was opened last, by all that it depends on


def serve() -> None:
    """Answer requests, in a child, until the parent has ended."""
    end_with_parent()
    answers = os.fdopen(os.dup(1), "wb")
    os.dup2(2, 1)  # what a library prints must not mix with the answers
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # the parent ends it
    with suppress(EOFError, BrokenPipeError):
        while True:
            _answer(pickle.load(sys.stdin.buffer)[0], answers)


def _answer(request: Message, answers: IO[bytes]) -> None:
    """Answer one request by the description of an opened log or by its blocks; errors in a library are answers, too."""
    _limit(request["memory"], request["cpu"])
    try:
        path = Path(request["path"])
        about = path.stat()
        key = (request["reader"], path, about.st_mtime_ns, about.st_size)
        if key not in _opened:
            _opened.clear()
            _opened[key] = import_module(request["reader"]).open_in_child(path)
        log, names = _opened[key], request["names"]
        if names is None:
            send(answers, {name: getattr(log, name) for name in FIELDS})
            return
        for block in log.blocks(names):
            send(answers, {"nulls": log.nulls, "nans": log.nans, "more": True}, [block[name] for name in names])
        end = {name: getattr(log, name) for name in FINAL_FIELDS}
        send(answers, {"end": end, "nulls": log.nulls, "nans": log.nans})
    except BrokenPipeError:
        raise
    except BadLog as error:
        send(answers, {"bad": str(error)})
    except MemoryError:
        _opened.clear()
        most = request["memory"] >> 20
        what = f"reading it takes more than {most} MB of memory; it is damaged, or holds much in one piece"
        remedy = "save it in a format that is read piece by piece, such as MATLAB's -v7.3"
        send(answers, {"bad": f"{request['path']}: {what}: {remedy}"})
    except Exception as error:
        _opened.clear()
        send(answers, {"bad": f"{request['path']}: it cannot be read ({type(error).__name__}: {error}): {REMEDY}"})


def _limit(memory: int, seconds: float) -> None:
    """Limit the memory [bytes] and the further CPU time [s] of this process, enforced by the system."""
    if sys.platform == "win32":
        return
    import resource

    used = sum(resource.getrusage(resource.RUSAGE_SELF)[:2])
    for limit, value in ((resource.RLIMIT_DATA, memory), (resource.RLIMIT_CPU, int(used + seconds) + 1)):
        hard = resource.getrlimit(limit)[1]
        value = value if hard == resource.RLIM_INFINITY else min(value, hard)
        with suppress(ValueError, OSError):
            resource.setrlimit(limit, (value, hard))
