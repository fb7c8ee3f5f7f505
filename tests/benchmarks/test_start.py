"""What starting costs: a program's help, and a first filter in a process that has compiled nothing yet."""

import resource
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path

import pytest

TYPER = 1.25  # times at most, what our help takes, over that of a program of one command
COMPILER = 1.2  # times at most, what a first filter takes, over a first compiled loop of the same length
TURNS = 7

ONE_COMMAND = """
import typer
app = typer.Typer()
@app.command()
def one(number: int = 1):
    "Do one thing."
app()
"""
HELP = "import sys; sys.argv[0] = 'davinci-forces'; from davinci_forces.cli import main; main()"
LOOP = """
import numpy as np
from numba import njit
@njit(cache=True, error_model="numpy")
def loop(x):
    s = 0.0
    for i in range(len(x)):
        s = 0.9 * s + x[i]
    return s
assert abs(loop(np.ones(4000)) - 10.0) < 1e-9
"""
FILTER = """
import numpy as np
from davinci_forces.filters import tracker
from davinci_forces.filters.problem import NoiseModel
from davinci_forces.filters.problem import FilterInput
from davinci_forces.maths.models.model import JointDynamics
t = np.arange(4000) * 1e-3
joint = JointDynamics(np.full(4000, 0.5), (0.1, 0.7, -0.2, 0.0, 0.3, 0.2, 0.0), np.zeros(4000))
noise = NoiseModel(1e-4, 1e-3, 1e-5, 1e-3, 0.05)
tracked = tracker("ekf")(FilterInput(joint, np.sin(t), np.cos(t), -np.sin(t), np.sin(t), 1e-3, 1.0), noise)
assert np.isfinite(tracked.tau_ext).all() and np.abs(tracked.tau_ext).max() > 0.1
"""


def seconds_of(command: Sequence[str]) -> float:
    """The processor's time of a process, from its start on."""
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    subprocess.run(command, check=True, stdout=subprocess.DEVNULL)
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    return after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime


def compared(ours: Sequence[str], rival: Sequence[str]) -> tuple[float, float]:
    """What two commands take when nothing disturbs them, in turn; in the first turn they compile what they keep."""
    times = [(seconds_of(ours), seconds_of(rival)) for _ in range(1 + TURNS)][1:]
    first, second = (min(column) for column in zip(*times, strict=True))
    return first, second


@pytest.fixture(autouse=True)
def compiled_once(monkeypatch):
    """Bytecode is kept, as in any installation, or every start would compile a hundred files."""
    monkeypatch.delenv("PYTHONDONTWRITEBYTECODE", raising=False)


def test_help_takes_little_longer_than_that_of_one_command(capsys):
    ours, rival = compared([sys.executable, "-c", HELP, "--help"], [sys.executable, "-c", ONE_COMMAND, "--help"])
    with capsys.disabled():
        print(f"\n--help takes {ours:.3f} s, {ours / rival:.2f} times that of a program of one command", end="")
    assert ours < TYPER * rival


def test_a_first_filter_costs_little_more_than_the_compiler_s_own_start(tmp_path: Path, capsys):
    loop = tmp_path / "loop.py"  # a file, since what is compiled is kept beside it
    loop.write_text(LOOP)
    ours, rival = compared([sys.executable, "-c", FILTER], [sys.executable, str(loop)])
    with capsys.disabled():
        print(f"\na first filter takes {ours:.2f} s, {ours / rival:.2f} times a first compiled loop", end="")
    assert ours < COMPILER * rival
