"""What terminals and pages would obey is shown as text; and names that ASCII does not have are names like any other."""

import json
import os
import re
import shutil
import subprocess
import sys
import tomllib
from pathlib import Path

import numpy as np
import pytest
from nptdms import ChannelObject, RootObject, TdmsWriter
from typer.testing import CliRunner

from davinci_forces.cli import app
from davinci_forces.files import visible
from davinci_forces.report.content import literal
from davinci_forces.report.content.inline import parse
from tests import arm

OBEYED = re.compile("[\x00-\x08\x0b-\x1f\x7f-\x9f\u061c\u200e\u200f\u2028-\u202e\u2066-\u2069]")
HOSTILE = "a\x1b[31m\x9b2J\u202eb\u2066c\u200fd\u061c\x7f"
SHOWN = "a\\x1b[31m\\u009b2J\\u202eb\\u2066c\\u200fd\\u061c\\u007f"


def said(*words, code=0) -> str:
    """What a command prints, on either stream."""
    done = CliRunner().invoke(app, [str(word) for word in words])
    assert done.exit_code == code, done.output
    return done.output + done.stderr


@pytest.fixture
def hostile(tmp_path) -> Path:
    """A study whose title, file, group of channels, channels and comment hold what a terminal obeys."""
    folder = tmp_path / "raw" / "arm"
    folder.mkdir(parents=True)
    signal = arm.signal("hand_roll", period=2.0, rate=50.0, periods=3)
    columns = {"time": signal.t, "q": signal.q, "dq": signal.dq, "tau": signal.tau}
    name = f"roll{HOSTILE}.tdms"
    with TdmsWriter(str(folder / name)) as file:
        channels = [ChannelObject(f"group{HOSTILE}", f"{key}{HOSTILE}", values) for key, values in columns.items()]
        file.write_segment([RootObject({"operator": HOSTILE}), *channels])
    arm.write_robot(folder)
    numbers = "\n".join(f'"hand_roll.{key}" = {i}' for i, key in enumerate(columns) if i)
    (folder / "study.toml").write_text(
        f'title = {json.dumps(HOSTILE)}\nrobot = "arm.toml"\n[[log]]\nname = "roll"\nfile = {json.dumps(name)}\n'
        f'role = "identification"\nperiod = 2.0\n[log.channels]\ntime = 0\n{numbers}\n'
    )
    return folder


def test_every_control_and_mark_of_direction_is_written_out():
    assert visible(HOSTILE) == SHOWN
    assert visible("two\nlines\t", "\n\t") == "two\nlines\t"
    assert visible("two\nlines") == "two\\x0alines"
    assert visible(b"gr\xf6\xdfe".decode(errors="surrogateescape")) == "gr\\udcf6\\udcdfe"
    assert visible("größe 日本 → ±") == "größe 日本 → ±"
    assert "".join(span.text for span in parse(literal(HOSTILE))) == SHOWN


def test_inspect_and_new_show_them_and_their_json_and_toml_hold_them(hostile):
    [log] = hostile.glob("*.tdms")
    for words in (["inspect", log], ["inspect", log, "--json"], ["new", log, "--print"], ["inspect", "no" + HOSTILE]):
        shown = said(*words, code=int(words[-1] == "no" + HOSTILE))
        assert not OBEYED.search(shown), words
        assert "\\u202e" in shown
    names = [channel["name"] for channel in json.loads(said("inspect", log, "--json"))["channels"]]
    assert f"group{HOSTILE}/q{HOSTILE}" in names
    printed = said("new", log, "--print")
    [drafted] = tomllib.loads(printed)["log"]
    assert drafted["file"] == log.name
    assert set(names) >= set(drafted["channels"].values())
    assert "CHECK: position 1 of 1" in printed  # by its values, as nobody knows such names


@pytest.mark.medium
def test_a_run_and_its_pages_show_them(hostile, tmp_path):
    shown = said("all", hostile)
    assert not OBEYED.search(shown)
    assert SHOWN in shown
    assert not OBEYED.search(said("verify", hostile))
    made = tmp_path / "reports" / "arm"
    page = (made / "report.html").read_text()
    assert not OBEYED.search(page)
    assert SHOWN in page
    if shutil.which("pdftotext"):
        done = subprocess.run(["pdftotext", "-layout", made / "report.pdf", "-"], capture_output=True, text=True)
        assert not OBEYED.search(done.stdout.replace("\f", ""))
        assert SHOWN in re.sub(r"[\s\u200b]", "", done.stdout)


def test_labels_of_figures_show_them():
    from davinci_forces.report.content import Figure, Panel
    from davinci_forces.report.content.marks import Line
    from davinci_forces.report.figures.svg import svg

    panel = Panel(HOSTILE, "t [s]", "q", (Line(np.arange(3.0), np.arange(3.0), HOSTILE),))
    drawn = svg(Figure("c", "a", (panel,)))
    assert not OBEYED.search(drawn)
    assert drawn.count(SHOWN) == 2


def in_ascii(home: Path, *words: str) -> subprocess.CompletedProcess:
    """A command in a process whose system knows ASCII alone."""
    environment = os.environ | {"PYTHONUTF8": "0", "LC_ALL": "C"}
    return subprocess.run(
        [sys.executable, "-m", "davinci_forces", *words], capture_output=True, cwd=home, env=environment
    )


@pytest.mark.skipif(sys.platform == "win32", reason="names are Unicode on Windows")
@pytest.mark.slow
def test_folders_and_files_named_in_any_script_work_in_a_system_of_ascii(tmp_path):
    folder = arm.write_study(tmp_path / "raw" / "größe-日本", periods=3)
    for log in ("slide", "push"):
        (folder / f"{log}.csv").unlink()
    (folder / "check.csv").rename(folder / "prüf.csv")
    head, roll, _, check, _ = (folder / "study.toml").read_text().split("[[log]]")
    text = "[[log]]".join([head, roll, check.replace("check.csv", "prüf.csv")])
    (folder / "study.toml").write_text(text, encoding="utf-8")
    for words in (["all", "raw/größe-日本"], ["verify", "raw/größe-日本"], ["inspect", "raw/größe-日本/prüf.csv"]):
        done = in_ascii(tmp_path, *words)
        assert (done.returncode, done.stderr.decode().count("Traceback")) == (0, 0), done.stderr.decode()
        assert words[1] in done.stdout.decode()
    (folder / "study.toml").unlink()
    assert in_ascii(tmp_path, "new", "raw/größe-日本/prüf.csv").returncode == 0
    assert tomllib.loads((folder / "study.toml").read_text(encoding="utf-8"))["title"] == "größe-日本"
    ledger = tmp_path / "processed" / "größe-日本" / "tasks" / "ingest" / "check.json"
    assert "raw/prüf.csv" in json.loads(ledger.read_text(encoding="utf-8"))["fingerprint"]["inputs"]


@pytest.mark.medium
@pytest.mark.skipif(sys.platform != "linux", reason="other systems have no names that are not Unicode")
def test_a_name_that_is_no_unicode_costs_a_message(tmp_path):
    folder = arm.write_study(tmp_path / "raw" / "arm", periods=3)
    name = os.fsdecode(b"raw/gr\xf6\xdfe")
    folder.rename(tmp_path / name)
    file = f"{name}/roll.csv"
    for words, code in (
        (["all", name], 1),
        (["verify", name], 1),
        (["inspect", file], 0),
        (["new", file, "--study", name], 1),
    ):
        done = subprocess.run([sys.executable, "-m", "davinci_forces", *words], capture_output=True, cwd=tmp_path)
        shown = (done.stdout + done.stderr).decode()
        assert done.returncode == code, shown
        assert "Traceback" not in shown
        assert "gr\\udcf6\\udcdfe" in shown
