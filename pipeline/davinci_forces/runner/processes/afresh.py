"""Run in a new process, for a program that has loaded numpy before its threads and kernels could be set.

Its main module is this one, so that its workers do not run a script of the caller again.
"""

import json
import os
import sys
from collections.abc import Sequence
from pathlib import Path
from subprocess import PIPE, STDOUT, Popen
from typing import Any

from davinci_forces import errors
from davinci_forces.runner.console import echo
from davinci_forces.runner.processes import arithmetic

TASK_FAILED, RAISED = 4, 5  # exit codes: a task failed; a PipelineError was raised, which the last line holds


def run(study: Path, names: Sequence[str], **options: Any) -> bool:
    """Call `runs.run` in a new process, print what it prints, and return or raise what it does."""
    command = [sys.executable, "-P", "-m", __name__, json.dumps([str(study), names, options])]
    line, environment = "", os.environ | {"PYTHONPATH": os.pathsep.join(path for path in sys.path if path)}
    with Popen(command, env=environment, stdout=PIPE, stderr=STDOUT, text=True, encoding="utf-8") as child:
        try:
            for following in child.stdout or ():
                echo(line, nl=False)
                line = following
        except BaseException:  # such as an interrupt of a notebook, which does not reach the new process
            child.terminate()
            raise
    if child.returncode == RAISED:
        kind, message = json.loads(line)
        raise getattr(errors, "BadRequest" if kind == "NotAFile" else kind)(message)
    echo(line, nl=False)
    if child.returncode not in (0, TASK_FAILED):
        raise errors.BadRequest(f"{study}: the run ended with code {child.returncode}; its last words are above")
    return child.returncode == 0


def main() -> int:
    """Run as the argument says; return the exit code."""
    arithmetic.pin()
    from davinci_forces.runner import runs

    study, names, options = json.loads(sys.argv[1])
    try:
        return 0 if runs.run(Path(study), names, **options) else TASK_FAILED
    except errors.PipelineError as error:
        sys.stdout.write(json.dumps([type(error).__name__, str(error)]))
        return RAISED


if __name__ == "__main__":
    sys.exit(main())
