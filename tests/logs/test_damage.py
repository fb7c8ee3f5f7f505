"""Random damages of files of every format: a message or samples, in bounded time and memory, and never a traceback."""

import json
import subprocess
import sys
from pathlib import Path

import pytest

MOST_MEMORY = 512  # [MB]
LONGEST = 60.0  # [s] of one file, on a machine that does other things too

pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="memory is limited and measured as Linux does")


@pytest.mark.parametrize(
    "runs",  # of each the seed, the number of files, and whether they are texts
    [
        pytest.param([(0, 150, 0), (2, 600, 1)], marks=pytest.mark.medium),
        pytest.param([(1, 3000, 0), (3, 6000, 1)], marks=pytest.mark.slow),
    ],
)
def test_a_damaged_file_is_read_or_refused_within_limits(runs):
    command = [sys.executable, "-m", "tests.logs.damaging", *(str(number) for run in runs for number in run)]
    done = subprocess.run(command, capture_output=True, text=True, cwd=Path(__file__).parents[2])
    assert done.returncode == 0, done.stderr[-4000:]
    for (_, count, _), line in zip(runs, done.stdout.splitlines(), strict=True):
        said = json.loads(line)
        assert not said["failures"], "\n".join(said["failures"][:5])
        assert said["memory"] < MOST_MEMORY
        assert said["slowest"] < LONGEST
        assert sum(said["outcomes"].values()) == count
        assert any(name.endswith("read") for name in said["outcomes"])
        assert any(name.endswith("refused") for name in said["outcomes"])
