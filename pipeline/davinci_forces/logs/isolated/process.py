"""The parent's side: children that are kept for the next log, and ended when they are late or their parent ends."""

import atexit
import ctypes
import json
import os
import signal
import subprocess
import sys
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path
from threading import Timer
from typing import IO, Any

import numpy as np

from davinci_forces.maths.arrays import Array

Message = dict[str, Any]

KEPT = 2  # children that wait for a next log: starting one takes longer than reading a small file
START = (
    "import sys; sys.path[:] = {path!r}; from davinci_forces.logs.isolated.process import end_with_parent; "
    "end_with_parent(); from davinci_forces.logs.isolated.child import serve; serve()"
)
OUT_OF_TIME = 24  # the signal SIGXCPU, which Windows does not know
PACKAGES = Path(__file__).parents[3]
# One thread each, and Arrow's memory from the system: what libraries reserve beforehand counts as used.
SPARING = {"OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1", "ARROW_DEFAULT_MEMORY_POOL": "system"}
PR_SET_PDEATHSIG = 1  # of Linux's prctl(2): the signal that a process gets when the thread that started it ends


def send(stream: IO[bytes], message: Message, columns: Sequence[Array] = ()) -> None:
    """Write a message, and columns of one length."""
    rows = len(columns[0]) if columns else 0
    stream.write(json.dumps(message | {"shape": [len(columns), rows]}).encode() + b"\n")
    for column in columns:
        stream.write(np.ascontiguousarray(column, np.float64).data)
    stream.flush()


def receive(stream: IO[bytes]) -> tuple[Message, list[Array]]:
    """Read a message and its columns.

    Raises
    ------
    EOFError
        If the other side is gone.
    """
    line = stream.readline()
    if not line.endswith(b"\n"):
        raise EOFError
    message = json.loads(line)
    columns, rows = message.pop("shape")
    return message, [_column(stream, rows) for _ in range(columns)]


def _column(stream: IO[bytes], rows: int) -> Array:
    content = stream.read(8 * rows)
    if len(content) < 8 * rows:
        raise EOFError
    return np.frombuffer(content, np.float64)


class Ended(Exception):
    """A child is gone, with words for why."""


class Child:
    """A process that reads logs."""

    def __init__(self) -> None:
        path = [str(PACKAGES), *(entry or os.getcwd() for entry in sys.path)]
        self.owner = os.getpid()
        self.late = False
        with uninterrupted():
            self.process = subprocess.Popen(
                [sys.executable, "-S", "-c", START.format(path=path)], stdin=subprocess.PIPE, stdout=subprocess.PIPE,
                stderr=subprocess.DEVNULL, env=os.environ | SPARING,
            )  # fmt: skip

    def answers(self, request: Message) -> Iterator[tuple[Message, list[Array]]]:
        """Ask, and hand on what comes back, piece by piece.

        Raises
        ------
        Ended
            If the child is gone, or had to be ended because a piece took longer than the request allows.
        """
        assert self.process.stdin
        assert self.process.stdout
        more = True
        try:
            send(self.process.stdin, request)
            while more:
                with self._within(request["seconds"]):
                    message, columns = receive(self.process.stdout)
                more = message.pop("more", False)
                yield message, columns
        except (EOFError, OSError) as error:
            raise Ended(self._why(request)) from error

    @contextmanager
    def _within(self, seconds: float) -> Iterator[None]:
        timer = Timer(seconds, self._end_late)
        timer.daemon = True
        timer.start()
        try:
            yield
        finally:
            timer.cancel()

    def _end_late(self) -> None:
        self.late = True
        self.process.kill()

    def _why(self, request: Message) -> str:
        code = self.process.wait()
        if self.late:
            return f"takes more than {request['seconds']:.0f} s"
        if code == -OUT_OF_TIME:
            return f"takes more than {request['cpu']:.0f} s of computing"
        return f"ends the process that does so ({f'signal {-code}' if code < 0 else f'code {code}'})"

    def close(self) -> None:
        """End the process, if it is ours: one that was forked off knows children that are not."""
        if self.owner != os.getpid():
            self.process.returncode = 0
            return
        self.process.kill()
        for stream in (self.process.stdin, self.process.stdout):
            with suppress(OSError):
                stream.close()  # type: ignore[union-attr]  # both are pipes
        self.process.wait()


_waiting: list[Child] = []


@contextmanager
def child() -> Iterator[Child]:
    """A child for one request; it is kept for the next one where it answered all of this one."""
    taken = _taken()
    whole = False
    try:
        yield taken
        whole = True
    finally:
        if whole and len(_waiting) < KEPT:
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
    """End the children that wait."""
    while _waiting:
        _waiting.pop().close()


@contextmanager
def uninterrupted() -> Iterator[None]:
    """Start processes that Ctrl-C passes over, which a terminal sends to all: their parent ends them."""
    if sys.platform == "win32":
        yield
        return
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


def end_with_parent() -> None:
    """Have the system end this process with the one that started it, which only Linux can.

    Unlike a thread that waits for the end of the other process, this needs no turn of the interpreter, for which a
    thread waits as long as others compile or import.
    """
    if sys.platform == "linux":
        ctypes.CDLL(None).prctl(PR_SET_PDEATHSIG, signal.SIGKILL)
