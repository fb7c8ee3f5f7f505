"""Files that are none: pipes, devices, folders, sockets, links to nowhere and endless files, wherever one is read."""

import hashlib
import os
import random
import stat
import sys
from pathlib import Path

import pytest

if sys.platform == "win32":
    pytest.skip("Windows has no pipes, devices and sockets among its files", allow_module_level=True)

from davinci_forces import files
from davinci_forces.errors import NotAFile
from tests.odd_files import KINDS, Server, replace

SECONDS = 8.0  # of the processor's time that a command may take; most take one
MEMORY = 500_000  # [kB] that it may have; most take half


@pytest.fixture(scope="module")
def server(tmp_path_factory):
    served = Server(tmp_path_factory.mktemp("odd"))
    yield served
    served.close()


def is_bounded(answer, case) -> None:
    """A command ends by itself, soon, in little memory, and without a traceback."""
    assert answer["code"] in (0, 1), (case, answer)
    assert "Traceback" not in answer["said"], (case, answer)
    assert answer["seconds"] < SECONDS, (case, answer)
    assert answer["memory"] < MEMORY, (case, answer)


@pytest.mark.parametrize("kind", ["pipe", "device", "folder", "socket"])
def test_the_door_refuses_in_words_what_is_no_file(tmp_path, kind):
    file = tmp_path / "file"
    file.write_bytes(b"1")
    replace(file, kind)
    for opens in (files.open_file, files.read_bytes, files.digest, files.require_file):
        with pytest.raises(NotAFile, match=f"^{file}: it is a {kind}, not a file; remove it"):
            opens(file)


def test_the_door_opens_files_and_links_to_them(tmp_path):
    file = tmp_path / "file"
    file.write_bytes(b"1\r\n2")
    replace(file, "link")
    assert files.read_bytes(file) == b"1\r\n2"
    assert files.text_of(files.read_bytes(file)) == "1\n2"
    with files.open_file(file) as stream:
        assert stream.read(1) == b"1"
    assert files.digest(file) == hashlib.sha256(b"1\r\n2").hexdigest()


def test_what_is_read_counts_and_not_what_the_system_says():
    endless = Path("/proc/self/smaps")
    if not endless.exists():
        pytest.skip("this system has no /proc")
    assert endless.stat().st_size == 0
    assert len(files.read_bytes(endless)) > 1000
    with pytest.raises(NotAFile, match=r"smaps: it has .* MB, more than is read whole"):
        files.read_bytes(endless, 1000)


@pytest.mark.parametrize("size", [0, 1, 99, 100])
def test_a_file_of_as_many_bytes_as_may_be_is_read(tmp_path, size):
    (tmp_path / "file").write_bytes(b"x" * size)
    assert files.read_bytes(tmp_path / "file", 100) == b"x" * size
    (tmp_path / "file").write_bytes(b"x" * 101)
    with pytest.raises(NotAFile, match="more than is read whole"):
        files.read_bytes(tmp_path / "file", 100)


def test_what_is_written_replaces_a_pipe(tmp_path):
    file = tmp_path / "file"
    os.mkfifo(file)
    files.write_bytes(file, b"whole")
    assert file.read_bytes() == b"whole"
    assert stat.S_ISREG(file.lstat().st_mode)
    assert os.listdir(tmp_path) == ["file"]


# What a user hands in, and the command that reads it first.
HANDED_IN = [
    *((f"raw/arm/{name}", ("all", "raw/arm")) for name in ("study.toml", "arm.toml", "roll.csv", "feel.toml")),
    *((f"raw/arm/{name}", ("all", "raw/arm")) for name in ("truth.toml", "review.toml", "old.json")),
    ("raw/arm/study.toml", ("verify", "raw/arm")),
    ("raw/arm/roll.csv", ("inspect", "{}")),
    ("raw/arm/roll.csv", ("new", "{}", "--print")),
    ("raw/arm/feel.toml", ("haptics", "{}")),
    ("raw/arm/arm.toml", ("excite", "{}", "hand_roll")),
    ("raw/arm/old.json", ("compare", "{}", "reports/arm/results.json")),
    ("reports/arm/summary.json", ("campaign", "raw/arm", "--out", "page")),
    ("arm.urdf", ("robot", "{}")),
    ("scene.toml", ("simulate", "{}", "out")),
]


@pytest.mark.parametrize("kind", ["pipe", "device", "huge"])
@pytest.mark.parametrize(("file", "words"), HANDED_IN, ids=[f"{words[0]} {Path(f).name}" for f, words in HANDED_IN])
@pytest.mark.slow
def test_what_is_handed_in_and_is_no_file_is_refused_by_its_name(server, file, words, kind):
    answer = server.ask(file, kind, *words)
    is_bounded(answer, (file, kind, words))
    assert answer["code"] == 1, answer
    assert Path(file).name in answer["said"]


@pytest.mark.medium
def test_a_log_that_is_a_pipe_costs_its_own_tasks_and_no_other(server):
    answer = server.ask("raw/arm/check.csv", "pipe", "all", "raw/arm")
    assert "ingest: error: raw/arm/check.csv: it is a pipe, not a file; remove it, or put" in answer["said"]
    assert "raw/arm: 1 of " in answer["said"]
    assert "reports/arm/report.html" in answer["said"]


@pytest.mark.medium
@pytest.mark.parametrize("kind", ["pipe", "device", "folder"])
@pytest.mark.parametrize("name", ["recording/*/*.parquet", "tasks/ingest/*.json", "results.json", "report.html"])
def test_verify_names_what_a_run_made_and_is_no_file_any_more(server, name, kind):
    file = next(f for f in server.files if Path(f).match(name))
    answer = server.ask(file, kind, "verify", "raw/arm")
    is_bounded(answer, (file, kind))
    assert answer["code"] == 1
    assert file in answer["said"]


@pytest.mark.medium
@pytest.mark.parametrize("name", ["recording/*/*.parquet", "tasks/ingest/*.json", "results.json"])
def test_a_pipe_in_place_of_what_a_run_made_is_replaced_by_the_next(server, name):
    file = next(f for f in server.files if Path(f).match(name))
    answer = server.ask(file, "pipe", "all", "raw/arm")
    is_bounded(answer, file)
    assert answer["code"] == 0
    assert "first run" in answer["said"] or f"{Path(file).name} was altered" in answer["said"]


COMMANDS = (
    ("all", "raw/arm"), ("ingest", "raw/arm"), ("fit", "raw/arm"), ("recordings", "raw/arm"), ("report", "raw/arm"),
    ("verify", "raw/arm"), ("all", "raw/arm", "--dry-run"), ("all", "raw/arm", "--force"),
    ("inspect", "raw/arm/roll.csv"), ("new", "raw/arm/roll.csv", "raw/arm/check.csv", "--print"),
    ("compare", "raw/arm", "raw/arm/old.json"), ("campaign", "raw/arm"), ("haptics", "raw/arm/feel.toml"),
    ("robot", "arm.urdf"), ("robot", "raw/arm/arm.toml"), ("excite", "raw/arm/arm.toml", "hand_roll", "--starts", "1"),
)  # fmt: skip


@pytest.mark.slow
def test_any_file_of_any_kind_costs_a_message_at_most(server):
    """Two hundred of all pairs: a file of the study or of a run on it, what stands in its place, and a command."""
    choice = random.Random(4)
    inputs = [file for file in server.files if "." in Path(file).name and file.startswith(("raw/", "arm", "scene"))]
    made = [file for file in server.files if "." in Path(file).name and file not in inputs]
    for _ in range(200):
        file, kind = choice.choice(choice.choice([inputs, made])), choice.choice(KINDS)
        words = choice.choice(COMMANDS)
        answer = server.ask(file, kind, *words)
        is_bounded(answer, (file, kind, words))
        if kind == "link" and file in inputs:
            assert answer["code"] == 0, (file, words, answer)
        reads_it = file in words or (file.endswith(("study.toml", "arm.toml")) and "raw/arm" in words[1:2])
        if kind != "link" and file in inputs and reads_it and "campaign" not in words:
            assert answer["code"] == 1 or words[0] == "new", (file, kind, words, answer)  # new takes the others
            assert Path(file).name in answer["said"], (file, kind, words, answer)


def test_a_bag_in_a_folder_that_holds_a_pipe_is_refused(tmp_path):
    (tmp_path / "bag").mkdir()
    (tmp_path / "bag" / "metadata.yaml").write_text("rosbag2_bagfile_information:\n")
    os.mkfifo(tmp_path / "bag" / "bag_0.db3")
    child = Server.alone(tmp_path, "inspect", "bag")
    assert child["code"] == 1
    assert "bag_0.db3: it is a pipe, not a file" in child["said"]
