"""The child process: opens logs and reads their blocks for its parent, within limits that the system enforces."""

import os
import pickle
import signal
import sys
from collections.abc import Iterator
from contextlib import suppress
from importlib import import_module
from pathlib import Path
from typing import IO, Any

from davinci_forces.errors import BadLog
from davinci_forces.logs.isolated.process import Message, send
from davinci_forces.logs.log import Log
from davinci_forces.maths.arrays import Array

Answer = tuple[Message, list[Array]]
FINAL_FIELDS = ("facts", "warnings", "comments", "dropped", "cut")
FIELDS = ("format", "channels", "clock", "time", "started", "zone", *FINAL_FIELDS)
_opened: dict[Any, Log] = {}  # the log that was opened last, by all that it depends on


def serve() -> None:
    """Answer requests until the parent has ended."""
    answers = os.fdopen(os.dup(1), "wb")
    os.dup2(2, 1)  # what a library prints must not mix with the answers
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # the parent ends it
    with suppress(EOFError, BrokenPipeError):
        while True:
            _answer(pickle.load(sys.stdin.buffer)[0], answers)


def _answer(request: Message, answers: IO[bytes]) -> None:
    """Answer one request; errors in a library are answers, too."""
    _limit(request["memory"], request["cpu"])
    try:
        for message, columns in _answers(request):
            send(answers, message, columns)
    except BrokenPipeError:
        raise
    except BadLog as error:
        send(answers, {"bad": str(error)})
    except MemoryError:
        _opened.clear()
        send(answers, {"bad": "", "memory": True})
    except Exception as error:
        _opened.clear()
        send(answers, {"bad": f"{type(error).__name__}: {error}", "fault": True})


def _answers(request: Message) -> Iterator[Answer]:
    """Yield the description of an opened log, or its blocks."""
    path = Path(request["path"])
    about = path.stat()
    key = (request["reader"], path, about.st_mtime_ns, about.st_size)
    if key not in _opened:
        _opened.clear()
        _opened[key] = import_module(request["reader"]).open_in_child(path)
    log, names = _opened[key], request["names"]
    if names is None:
        yield {name: getattr(log, name) for name in FIELDS}, []
        return
    for block in log.blocks(names):
        yield {"nulls": log.nulls, "nans": log.nans, "more": True}, [block[name] for name in names]
    yield {"end": {name: getattr(log, name) for name in FINAL_FIELDS}, "nulls": log.nulls, "nans": log.nans}, []


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
