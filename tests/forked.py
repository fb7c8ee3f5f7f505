"""Commands in processes of their own that are forked from one with the package loaded, which saves seconds of each."""

import os
import sys
import tempfile
import traceback
from collections.abc import Mapping, Sequence
from importlib import import_module
from multiprocessing import get_context
from pathlib import Path
from subprocess import TimeoutExpired
from typing import Any

from davinci_forces.runner.processes import workers

# What the package loads when it needs it, and what else a run of all stages loads.
LATER = (
    "matplotlib.figure", "pandas", "pydantic.fields", "pydantic.type_adapter", "scipy.signal", "scipy.stats",
    "statsmodels.api", "typer._adapters", "typst",
)  # fmt: skip
NO_CONSTANTS: Mapping[str, Any] = {}


def prepare(*others: str) -> None:
    """Start the process that others are forked from, if the system can, with all loaded that a run loads later."""
    if workers.METHOD == "forkserver":
        from multiprocessing import forkserver

        forkserver.set_forkserver_preload(["davinci_forces.runner.processes.preloaded", *LATER, *others])
        forkserver.ensure_running()
    workers.prepare()


class Started:
    """A process that runs `davinci-forces` with words, or `python -c` code with words, as subprocess.Popen would.

    It writes at the end of files: one for both streams, unless there is another for errors.
    """

    def __init__(
        self,
        words: Sequence[str],
        folder: Path,
        environment: Mapping[str, str],
        output: Path,
        errors: Path | None = None,
        constants: Mapping[str, Any] = NO_CONSTANTS,
    ) -> None:
        prepare()
        started = (list(words), folder, (str(output), str(errors or output)), dict(environment), dict(constants))
        self._process = get_context(workers.METHOD).Process(target=_perform, args=started)
        self._process.start()
        self.pid = self._process.pid
        self.kill = self._process.kill

    @property
    def returncode(self) -> int | None:
        code: int | None = self._process.exitcode
        return code

    def poll(self) -> int | None:
        return self.returncode

    def send_signal(self, number: int) -> None:
        os.kill(self.pid, number)

    def wait(self, timeout: float | None = None) -> int | None:
        self._process.join(timeout)
        if timeout is not None and self.returncode is None:
            raise TimeoutExpired(str(self.pid), timeout)
        return self.returncode


def run(
    words: Sequence[str], folder: Path, environment: Mapping[str, str], constants: Mapping[str, Any] = NO_CONSTANTS
) -> tuple[int | None, str]:
    """The exit code and the output of `davinci-forces` with words, or of `python -c` code, in a folder.

    `constants` are values of constants of modules, which hold in that process alone.
    """
    with tempfile.NamedTemporaryFile() as output:
        code = Started(words, folder, environment, Path(output.name), constants=constants).wait()
        return code, Path(output.name).read_text()


def _perform(
    words: list[str], folder: Path, outputs: tuple[str, str], environment: dict[str, str], constants: dict[str, Any]
) -> None:
    for stream, output in enumerate(outputs, start=1):
        with open(output, "ab") as file:
            os.dup2(file.fileno(), stream)
    os.environ.clear()
    os.environ.update(environment)
    os.chdir(folder)
    code: object = 1
    try:
        for name, value in constants.items():
            module, _, constant = name.rpartition(".")
            assert hasattr(import_module(module), constant), name
            setattr(import_module(module), constant, value)
        if words[:2] == ["python", "-c"]:
            sys.argv = ["-c", *words[3:]]
            exec(compile(words[2], "<string>", "exec"), {"__name__": "__main__"})
        else:
            from davinci_forces.cli import main

            sys.argv = list(words)
            main()
        code = 0
    except SystemExit as left:
        code = left.code or 0
    except BaseException:
        traceback.print_exc()
    sys.stdout.flush()
    sys.stderr.flush()
    os._exit(code if isinstance(code, int) else 1)
