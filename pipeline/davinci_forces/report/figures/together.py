"""Draw many figures at once, shared between other processes of this program and this process."""

import os
import pickle
import subprocess
import sys
from collections.abc import Iterable
from contextlib import suppress
from pathlib import Path
from typing import IO

from davinci_forces.logs.isolated.process import block_interrupts
from davinci_forces.report.content import Figure, Figure3D
from davinci_forces.report.figures.svg import draw_svg, drawn

MIN_FIGURES_PER_PROCESS = 8  # starting another process takes as long as drawing this many figures
MAX_PROCESSES = 4  # processes, including this process
PROGRAM = (
    "from davinci_forces.logs.isolated.process import end_with_parent; end_with_parent(); "
    "from davinci_forces.report.figures.together import serve; serve()"
)


def draw_together(figures: Iterable[Figure | Figure3D]) -> None:
    """Draw the figures that are not drawn yet; every process gives the same bytes."""
    left = sorted((figure for figure in figures if figure not in drawn), key=_cost)
    processes = min(MAX_PROCESSES, os.cpu_count() or 1, max(len(left) // MIN_FIGURES_PER_PROCESS, 1))
    shares = [left[i::processes] for i in range(processes)]
    asked = [(share, _ask(share)) for share in shares[1:]]
    _draw(shares[0])
    for share, process in asked:
        _take(share, process)


def serve() -> None:
    """Draw the figures that another process asks for, until that process has all figures."""
    figures = pickle.load(sys.stdin.buffer)
    pickle.dump([draw_svg(figure) for figure in figures], sys.stdout.buffer)


def _cost(figure: Figure | Figure3D) -> int:
    """Sort key of a figure by its drawing time: minus its number of panels."""
    return -len(figure.panels) if isinstance(figure, Figure) else -1


def _draw(figures: list[Figure | Figure3D]) -> None:
    for figure in figures:
        drawn[figure] = draw_svg(figure)


def _ask(share: list[Figure | Figure3D]) -> "subprocess.Popen[bytes]":
    """Have a new process draw a share.  It is not forked: a fork inherits locks, but not the threads that hold them."""
    path = os.pathsep.join(filter(None, [str(Path(__file__).parents[3]), os.environ.get("PYTHONPATH")]))
    with block_interrupts():
        process = subprocess.Popen(
            [sys.executable, "-P", "-c", PROGRAM], stdin=subprocess.PIPE, stdout=subprocess.PIPE,
            stderr=subprocess.DEVNULL, env=os.environ | {"PYTHONPATH": path},
        )  # fmt: skip
    _send(share, process.stdin)
    return process


def _send(share: list[Figure | Figure3D], pipe: IO[bytes] | None) -> None:
    assert pipe is not None
    with suppress(OSError), pipe:  # a process that has ended is noticed when its share is taken
        pickle.dump(share, pipe)


def _take(share: list[Figure | Figure3D], process: "subprocess.Popen[bytes]") -> None:
    """Take the figures that a process has drawn; if it failed, draw its share here, which raises the error."""
    assert process.stdout is not None
    with process.stdout as pipe:
        output = pipe.read()
    if process.wait():
        _draw(share)
    else:
        drawn.update(zip(share, pickle.loads(output), strict=True))
