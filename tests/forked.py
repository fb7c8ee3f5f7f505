"""Commands in processes of their own that are forked from one with the package loaded, which saves seconds of each."""

import os
import sys
import tempfile
import traceback
from collections.abc import Mapping, Sequence
from multiprocessing import get_context
from pathlib import Path

from davinci_forces.runner.processes import workers


def run(words: Sequence[str], folder: Path, environment: Mapping[str, str]) -> tuple[int | None, str]:
    """The exit code and the output of `davinci-forces` with words, or of `python -c` code, in a folder."""
    workers.prepare()
    with tempfile.NamedTemporaryFile() as output:
        started = (list(words), folder, output.name, dict(environment))
        process = get_context(workers.METHOD).Process(target=_perform, args=started)
        process.start()
        process.join()
        return process.exitcode, Path(output.name).read_text()


def _perform(words: list[str], folder: Path, output: str, environment: dict[str, str]) -> None:
    with open(output, "ab") as file:
        for stream in (1, 2):
            os.dup2(file.fileno(), stream)
    os.environ.clear()
    os.environ.update(environment)
    os.chdir(folder)
    code: object = 1
    try:
        if words[:2] == ["python", "-c"]:
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
