"""Logs that a child process reads: it crashes, hangs, asks for too much, and costs no more than a message."""

import os
import signal
import sys
import time
from pathlib import Path

import numpy as np
import pytest

from davinci_forces.errors import BadLog
from davinci_forces.logs import isolated
from davinci_forces.logs.isolated import process
from davinci_forces.logs.log import Channel, Log, Options

HERE = "tests.logs.test_isolated"  # which the child imports as the reader
POSIX = pytest.mark.skipif(sys.platform == "win32", reason="signals and limits are those of POSIX")


class Odd(Log):
    """Does with its child whatever the file says."""

    def _read(self, names):
        yield {"x": np.arange(3.0)}
        what = self.path.read_text()
        if what == "crash":
            os.kill(os.getpid(), signal.SIGSEGV)
        elif what == "hang":
            while True:
                time.sleep(0.01)
        elif what == "compute":
            while True:
                pass
        elif what == "fault":
            raise KeyError("of a library")
        elif what == "greedy":
            np.ones(1 << 27)  # a gigabyte
        elif what == "print":
            os.write(1, b"what a library has to say\n")
        self.warnings.append("noticed")
        self.nulls["x"] += 1
        yield {"x": np.arange(3.0, 6.0)}


def open_in_child(path):
    if path.read_text() == "refuse":
        raise BadLog(f"{path}: refused")
    return Odd(path, "odd", (Channel("x", "m", alias="y"),), facts={"pid": str(os.getpid())})


def start(tmp_path, what: str) -> Log:
    (tmp_path / "log.odd").write_text(what)
    return isolated.read(tmp_path / "log.odd", Options(), HERE)


def test_blocks_and_remarks_are_those_of_the_child(tmp_path):
    log = start(tmp_path, "print")
    assert log.channels == (Channel("x", "m", alias="y"),)
    for _ in range(2):
        [block] = log.blocks(["x"])
        np.testing.assert_array_equal(block["x"], np.arange(6.0))
        assert (log.warnings, log.nulls) == (["noticed"], {"x": 1})


def test_a_child_is_kept_for_the_next_file(tmp_path):
    first = start(tmp_path, "plain").facts["pid"]
    assert start(tmp_path, "plain again").facts["pid"] == first
    assert int(first) != os.getpid()


@pytest.mark.parametrize(
    ("what", "says"),
    [
        pytest.param("crash", "reading it crashes the reader process (signal 11)", marks=POSIX),
        ("fault", "it cannot be read (KeyError: 'of a library'): it is damaged; record it again"),
        pytest.param("greedy", "reading it takes more than 448 MB of memory", marks=POSIX),
    ],
)
def test_what_goes_wrong_in_the_child_is_a_message_and_the_next_file_is_read(tmp_path, what, says):
    log = start(tmp_path, what)
    with pytest.raises(BadLog) as raised:
        list(log.blocks(["x"]))
    assert f"{tmp_path / 'log.odd'}: {says}" in str(raised.value)
    assert list(start(tmp_path, "plain").blocks(["x"]))


@pytest.mark.parametrize(
    ("what", "limit", "says"),
    [
        ("hang", "seconds", "reading it takes more than 1 s, so"),
        pytest.param("compute", "cpu", "reading it takes more than 1 s of CPU time", marks=POSIX),
    ],
)
def test_a_child_that_takes_too_long_is_ended(tmp_path, what, limit, says):
    log = start(tmp_path, what)
    log.request[limit] = 1.0
    begun = time.monotonic()
    with pytest.raises(BadLog, match=says):
        list(log.blocks(["x"]))
    assert time.monotonic() - begun < 20


def test_a_refusal_names_the_file_as_it_was_named(tmp_path, monkeypatch):
    (tmp_path / "log.odd").write_text("refuse")
    monkeypatch.chdir(tmp_path)
    with pytest.raises(BadLog) as raised:
        isolated.read(Path("log.odd"), Options(), HERE)
    assert str(raised.value) == "log.odd: refused"


def test_blocks_that_nobody_wants_any_more_end_their_child(tmp_path):
    log = start(tmp_path, "hang")
    reading = log._blocks(["x"])
    next(reading)
    waiting = len(process._waiting)
    reading.close()
    assert len(process._waiting) == waiting


def test_a_file_that_changed_is_opened_anew(tmp_path):
    log = start(tmp_path, "plain")
    list(log.blocks(["x"]))
    (tmp_path / "log.odd").write_text("fault")
    with pytest.raises(BadLog, match="of a library"):
        list(log.blocks(["x"]))


@POSIX
def test_a_child_ends_with_its_parent(tmp_path):
    import subprocess

    code = (
        "from pathlib import Path\n"
        "from davinci_forces.logs.isolated import read as start\n"
        "from davinci_forces.logs.log import Options\n"
        f"print(start(Path({str(tmp_path / 'log.odd')!r}), Options(), {HERE!r}).facts['pid'], flush=True)\n"
        "import os, signal; os.kill(os.getpid(), signal.SIGKILL)"
    )
    (tmp_path / "log.odd").write_text("plain")
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, cwd=Path(__file__).parents[2])
    child = int(done.stdout)
    until = time.monotonic() + 20
    while Path(f"/proc/{child}").exists() and time.monotonic() < until:
        time.sleep(0.05)
    assert not Path(f"/proc/{child}").exists()


def test_a_log_of_text_imports_nothing_that_other_formats_need(tmp_path):
    import subprocess

    (tmp_path / "log.csv").write_text("t,q\n0,1\n1,2\n")
    code = (
        "import sys; from pathlib import Path; from davinci_forces.logs import open_log\n"
        f"log = open_log(Path({str(tmp_path / 'log.csv')!r})); list(log.blocks(['q']))\n"
        "print(sorted({'h5py', 'rosbags', 'scipy.io', 'pyarrow.parquet', 'pyarrow.feather'} & set(sys.modules)))"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, cwd=Path(__file__).parents[2])
    assert done.stdout.strip() == "[]", done.stderr
