"""A process that puts odd files into copies of a small study and runs commands on them, each in a child with limits.

A command that waits for a pipe cannot be stopped from within: its child is ended by an alarm, and that is the answer.
"""

import json
import os
import resource
import shutil
import signal
import socket
import subprocess
import sys
import tempfile
import traceback
from collections.abc import Iterator
from contextlib import contextmanager
from importlib import import_module
from pathlib import Path
from pkgutil import walk_packages

from davinci_forces import files
from tests.forked import LATER

SECONDS = 60  # of the clock, after which a child is ended: it waits for what never comes
MEMORY = 4 << 30  # [bytes] of addresses that a child may have
# Bytes of a file without content: of what is read piece by piece, of results, and of all else.
HUGE, BEYOND = {".csv": 1 << 25, ".json": files.MAX_BYTES + 1}, 1 << 29
KINDS = ("pipe", "device", "folder", "socket", "nowhere", "huge", "link")
FELT = {"title": "Felt", "tissue_stiffness": 1.0, "response": [], "hands": {}}
PAGES = {"report.html": b"<html>", "report.pdf": b"%PDF"}
MORE = '\nhaptics = "feel.toml"\nbaseline = "old.json"\n'
RATING = '[[rating]]\nrun = "check"\nverdict = "doubt"\nresults = "{}"\n'.format(64 * "0")
OLD = '[{"key": "fit.hand_roll.x", "value": 1.0, "std": 0.1, "unit": ""}]'


def replace(file: Path, kind: str) -> None:
    """Put what is no ordinary file in the place of one."""
    kept = file.with_name(f".{file.name}.kept")
    file.rename(kept)
    if kind == "pipe":
        os.mkfifo(file)
    elif kind == "device":
        file.symlink_to("/dev/zero")
    elif kind == "folder":
        file.mkdir()
    elif kind == "socket":
        with socket.socket(socket.AF_UNIX) as bound, at_home(file.parent):  # as addresses are short
            bound.bind(file.name)
    elif kind == "nowhere":
        file.symlink_to("nowhere")
    elif kind == "huge":
        with file.open("wb") as stream:
            stream.truncate(HUGE.get(file.suffix, BEYOND))
    else:
        file.symlink_to(kept.name)


@contextmanager
def at_home(folder: Path) -> Iterator[None]:
    """Work in a folder for a while."""
    before = Path.cwd()
    os.chdir(folder)
    try:
        yield
    finally:
        os.chdir(before)


def linked(folder: Path, other: Path) -> None:
    """A copy of a folder whose files are those of the other until they are replaced, as runs replace files."""
    shutil.copytree(folder, other, copy_function=os.link)


def run(home: Path, words: list[str]) -> dict:
    """What a command says and takes, in a child that works in a folder."""
    with tempfile.TemporaryFile() as said:
        if not (child := os.fork()):
            perform(home, words, said.fileno())
        _, status, used = os.wait4(child, 0)
        said.seek(0)
        return {
            "code": os.waitstatus_to_exitcode(status), "said": said.read().decode(errors="replace"),
            "seconds": used.ru_utime + used.ru_stime, "memory": used.ru_maxrss,
        }  # fmt: skip


def perform(home: Path, words: list[str], said: int) -> None:
    """Run a command in this process, and end it."""
    from davinci_forces import cli

    code = 70
    try:
        os.chdir(home)
        os.dup2(said, 1)
        os.dup2(said, 2)
        resource.setrlimit(resource.RLIMIT_AS, (MEMORY, MEMORY))
        signal.alarm(SECONDS)
        sys.argv = ["davinci-forces", *words]
        cli.main()
    except SystemExit as left:
        code = left.code if isinstance(left.code, int) else int(left.code is not None)
    except BaseException:
        traceback.print_exc()
    sys.stdout.flush()
    sys.stderr.flush()
    os._exit(code)


def prepare(home: Path) -> None:
    """A study that all has run on, with every file beside it that a study may have."""
    from importlib import resources

    import davinci_forces
    from davinci_forces.commands import haptics
    from davinci_forces.identification import search
    from davinci_forces.report import report
    from davinci_forces.robots import load
    from davinci_forces.robots.urdf import writing
    from tests import arm

    report.render_all = lambda documents: PAGES  # drawing takes seconds, and reads no file
    haptics._answer = lambda scenario, csv: FELT  # so does simulating
    vars(search).update(arm.coarse_grids())  # and searching for a model on every value of a grid
    study = arm.write_study(home / "raw" / "arm", periods=3)
    for name in ("slide", "push"):
        (study / f"{name}.csv").unlink()
    text = (study / "study.toml").read_text()
    head, roll, _, check, _ = text.split("[[log]]")
    (study / "study.toml").write_text("[[log]]".join([head + MORE, roll, check]))
    (study / "feel.toml").write_bytes(resources.files("davinci_forces.haptics").joinpath("haptics.toml").read_bytes())
    (study / "truth.toml").write_text("simulated = true\n")
    (study / "review.toml").write_text(RATING)
    (study / "old.json").write_text(OLD)
    (home / "arm.urdf").write_text(writing.text(load("davinci", Path())))
    shipped = resources.files("davinci_forces.simulation").joinpath("shipped", "davinci-joints.toml")
    (home / "scene.toml").write_bytes(shipped.read_bytes())
    own = (module.name for module in walk_packages(davinci_forces.__path__, "davinci_forces."))
    for name in (*LATER, *(name for name in own if not name.endswith("__main__"))):
        import_module(name)  # once, and not by every child
    davinci_forces.run(study, quiet=True)  # here, so that every child has the compiled functions
    made = run(home, ["all", "raw/arm"])
    assert made["code"] == 0, made["said"]


def serve(home: Path) -> None:
    """Answer cases, a line each."""
    prepare(home / "study")
    print(json.dumps(sorted(p.relative_to(home / "study").as_posix() for p in (home / "study").rglob("*"))), flush=True)
    for number, line in enumerate(sys.stdin):
        case, place = json.loads(line), home / str(number)
        linked(home / "study", place)
        replace(place / case["file"], case["kind"])
        answer = run(place, [word.replace("{}", case["file"]) for word in case["words"]])
        shutil.rmtree(place)
        print(json.dumps(answer), flush=True)


class Server:
    """The process, from the tests' side."""

    def __init__(self, home: Path) -> None:
        code = "import sys; from pathlib import Path; from tests.odd_files import serve; serve(Path(sys.argv[1]))"
        self.process = subprocess.Popen(
            [sys.executable, "-c", code, str(home)], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True,
            cwd=Path(__file__).parents[1],
        )  # fmt: skip
        self.files: list[str] = self._answer()

    def ask(self, file: str, kind: str, *words: str) -> dict:
        """What a command says of a study in which a file is of that kind."""
        assert self.process.stdin
        self.process.stdin.write(json.dumps({"file": file, "kind": kind, "words": words}) + "\n")
        self.process.stdin.flush()
        return self._answer()

    @staticmethod
    def alone(home: Path, *words: str) -> dict:
        """What a command says in a folder, in a process of its own."""
        code = "import json, sys; from tests.odd_files import Path, run\n"
        code += "print(json.dumps(run(Path(sys.argv[1]), sys.argv[2:])))"
        done = subprocess.run(
            [sys.executable, "-c", code, str(home), *words], capture_output=True, text=True,
            cwd=Path(__file__).parents[1], check=True,
        )  # fmt: skip
        return json.loads(done.stdout)

    def _answer(self):
        assert self.process.stdout
        return json.loads(self.process.stdout.readline())

    def close(self) -> None:
        """End the process."""
        assert self.process.stdin
        with self.process:
            self.process.stdin.close()
