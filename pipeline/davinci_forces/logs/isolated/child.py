"""The child process: opens logs and reads their blocks for its parent, within limits that the system holds it to."""

import os
import signal
import sys
from collections.abc import Iterator
from contextlib import suppress
from dataclasses import asdict
from importlib import import_module
from pathlib import Path
from typing import IO, Any

from davinci_forces.errors import BadLog
from davinci_forces.logs.isolated.process import Message, receive, send
from davinci_forces.logs.log import Log, Options
from davinci_forces.maths.arrays import Array

Answer = tuple[Message, list[Array]]
TOLD_AT_THE_END = ("facts", "warnings", "comments", "dropped", "cut")


def serve() -> None:
    """Answer requests until the parent is gone."""
    answers = os.fdopen(os.dup(1), "wb")
    os.dup2(2, 1)  # what a library prints must not get between the answers
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # the parent ends it
    child = Child()
    with suppress(EOFError, BrokenPipeError):
        while True:
            _answer(child, receive(sys.stdin.buffer)[0], answers)


def _answer(child: "Child", request: Message, answers: IO[bytes]) -> None:
    """Answer one request; whatever goes wrong in a library is an answer, too."""
    _limit(request["memory"], request["cpu"])
    try:
        for message, columns in child.answers(request):
            send(answers, message, columns)
    except BrokenPipeError:
        raise
    except BadLog as error:
        send(answers, {"bad": str(error)})
    except MemoryError:
        child.forget()
        send(answers, {"bad": "", "memory": True})
    except Exception as error:
        child.forget()
        send(answers, {"bad": f"{type(error).__name__}: {error}", "fault": True})


class Child:
    """What is known between two requests: the log that was opened last."""

    def __init__(self) -> None:
        self.key: Any = None
        self.log: Log | None = None

    def forget(self) -> None:
        """Let go of the log."""
        self.key = self.log = None

    def answers(self, request: Message) -> Iterator[Answer]:
        """What an open log is, or its blocks."""
        log = self._opened(request)
        names = request["names"]
        if names is None:
            yield {"log": _described(log)}, []
            return
        for block in log.blocks(names):
            yield {"nulls": log.nulls, "nans": log.nans, "more": True}, [block[name] for name in names]
        yield {"end": {name: getattr(log, name) for name in TOLD_AT_THE_END}, "nulls": log.nulls, "nans": log.nans}, []

    def _opened(self, request: Message) -> Log:
        path = Path(request["path"])
        about = path.stat()
        key = (request["reader"], path, request["options"], about.st_mtime_ns, about.st_size)
        if self.log is None or self.key != key:
            self.forget()
            self.log = import_module(request["reader"]).opened(path, Options(**_tupled(request["options"])))
            self.key = key
        return self.log


def _tupled(options: dict[str, Any]) -> dict[str, Any]:
    return {name: tuple(value) if isinstance(value, list) else value for name, value in options.items()}


def _described(log: Log) -> dict[str, Any]:
    said = {name: getattr(log, name) for name in ("format", "time", "started", "zone", *TOLD_AT_THE_END)}
    clock = asdict(log.clock) if log.clock else None
    return {**said, "clock": clock, "channels": [asdict(channel) for channel in log.channels]}


def _limit(memory: int, seconds: float) -> None:
    """Have the system refuse more memory [bytes], and end the process after so much more CPU time [s]."""
    if sys.platform == "win32":
        return
    import resource

    used = sum(resource.getrusage(resource.RUSAGE_SELF)[:2])
    for limit, value in ((resource.RLIMIT_DATA, memory), (resource.RLIMIT_CPU, int(used + seconds) + 1)):
        hard = resource.getrlimit(limit)[1]
        value = value if hard == resource.RLIM_INFINITY else min(value, hard)
        with suppress(ValueError, OSError):
            resource.setrlimit(limit, (value, hard))
