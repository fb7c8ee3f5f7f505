"""A reader who does what a tutorial says, word for word, sees what it shows."""

import os
import re
import shlex
import shutil
import subprocess
from pathlib import Path

import pytest

from tests import forked
from tests.conftest import QUICK_DESIGN, ROOT, quick_limits
from tests.guide.make_logs import LOGS

GUIDE = ROOT / "pipeline" / "davinci_forces" / "guide"
PAGES = {page.stem: page for page in sorted((GUIDE / "tutorials").glob("*.md"))}
BLOCK = re.compile(r"^```(\w+)\n(.*?)^```$", re.M | re.S)
ENVIRONMENT = {**os.environ, "COLUMNS": "200", "TERM": "dumb"}


def pattern(line: str) -> str:
    """A line of a tutorial as an expression: `...` is any text, and blanks between columns are of any width."""
    words = [".*".join(re.escape(part) for part in word.split("...")) for word in line.split()]
    return r"^\s*" + r"\s+".join(words) + r"\s*$"


def command(line: str, folder: Path) -> tuple[int | None, str]:
    """The exit code and the output of a command.  No tutorial shows a number of the design or a limit of a hand."""
    if line.startswith("davinci-forces "):
        return forked.run(shlex.split(line), folder, ENVIRONMENT, QUICK_DESIGN | quick_limits())
    done = subprocess.run(line, shell=True, cwd=folder, stderr=subprocess.STDOUT, stdout=subprocess.PIPE, text=True)
    return done.returncode, done.stdout


def console(text: str, folder: Path) -> None:
    """Run the commands of a block; every line below one is in its output."""
    output = None
    for line in filter(str.strip, text.splitlines()):
        if line.startswith("$ "):
            code, output = command(line[2:], folder)
            assert code == 0, f"{line}\n{output}"
        elif line.strip() != "...":
            assert output is not None, f"{line!r} comes before any command"
            assert re.search(pattern(line), output, re.M), f"{line!r} is not in\n{output}"


def follow(page: Path, folder: Path) -> None:
    for kind, text in BLOCK.findall(page.read_text()):
        if kind == "console":
            console(text, folder)
        elif kind == "toml":
            file = re.match(r"# (\S+)\n", text)
            assert file, f"a block of TOML names no file: {text[:40]!r}"
            (folder / file[1]).write_text(text)
        else:
            assert kind == "python", kind
            code, said = forked.run(["python", "-c", text], folder, ENVIRONMENT)
            assert code == 0, f"{text}\n{said}"


@pytest.mark.medium
@pytest.mark.parametrize("page", PAGES)
def test_what_a_tutorial_says_is_what_a_reader_sees(page, tmp_path):
    LOGS[page](tmp_path)
    follow(PAGES[page], tmp_path)
    for report in tmp_path.glob("reports/*/report.pdf") if shutil.which("pdftotext") else ():
        first = subprocess.run(["pdftotext", "-l", "1", report, "-"], capture_output=True, text=True).stdout
        assert "Reviewed by" in first, f"{report.parent.name}: the answer needs more than a page"


def test_every_tutorial_has_logs_and_every_log_a_tutorial():
    assert PAGES.keys() == LOGS.keys()
    for name, page in PAGES.items():
        title, _, sentence, *_ = page.read_text().splitlines()
        assert title.startswith("# "), name
        assert sentence, name


@pytest.mark.parametrize("line", ["roll  ● Good ... N m", "R2"])
def test_a_line_that_the_output_lacks_is_an_error(line, tmp_path):
    with pytest.raises(AssertionError, match="is not in"):
        console(f"$ echo 'roll ● Fair 0.3 N m, R2'\n{line}\n", tmp_path)
    console("$ echo 'roll   ● Good  0.3 N m'\nroll ● Good ... N m\n", tmp_path)
