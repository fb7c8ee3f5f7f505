"""Compiled code is kept where only its user can write, under a name that says what it was compiled from."""

import ast
import os
import shutil
import subprocess
import sys
import time
from pathlib import Path

import pytest

import davinci_forces
from davinci_forces.maths import compiled

PACKAGE = Path(davinci_forces.__file__).parent
KERNEL = """
import numpy as np
from davinci_forces.maths.compiled import folder
from davinci_forces.maths.models import kernels
out = np.empty(2)
kernels.deflections(np.ones(2), 0.01, 0.1, 0.5, out)
print(out[1], sum(kernels.deflections.stats.cache_hits.values()), folder())
"""
SHARED = """
import os
os.environ["XDG_CACHE_HOME"] = "relative"
from davinci_forces.maths.compiled import folder
from davinci_forces.runner.processes import workers
if __name__ == "__main__":
    with workers.pool(1) as pool:
        print(folder(), pool.submit(folder).result())
"""
COLD = """
from dataclasses import replace
from numba.core import event

class Compiled(event.Listener):
    def on_start(self, event):
        function = event.data["dispatcher"].py_func
        print(function.__module__ + "." + function.__qualname__.replace(" ", ""))
    def on_end(self, event):
        pass

event.register("numba:compile", Compiled())
import numpy as np
from davinci_forces.filters import FILTERS, tracker
from davinci_forces.filters.innovations import coloured
from davinci_forces.filters.problem import FilterInput, NoiseModel
from davinci_forces.haptics import loop, scenario
from davinci_forces.maths.estimation import kernels
from davinci_forces.maths.models.model import JointDynamics
from davinci_forces.robots.davinci import ROBOT
from davinci_forces.stages import design
t, noise = np.arange(20) * 1e-3, NoiseModel(1e-4, 1e-3, 1e-5, 1e-3, 0.05)
recording = FilterInput(JointDynamics(1.0 + t, (0.0,) * 7, 0.0 * t), t, t, t, t, 1e-3, 1.0)
for name in FILTERS:
    tracker(name)(recording, noise)
coloured.log_likelihood(recording, coloured.Noise(noise, (0.5, 0.5)))
haptic = replace(loop.complete_scenario(scenario.HapticScenario()), plan=((0.0, -0.01), (0.1, 0.01)))
loop.simulate_plan(haptic, dict(haptic.hands)["firm"])
brief = replace(ROBOT, control=tuple(replace(study, duration=0.01) for study in ROBOT.control))
list(design.control(brief, brief.chain, brief.bodies))
kernels.triangularise(np.ones((3, 1)), np.ones(3), np.ones(3), np.zeros((2, 2)))
x, r = np.ones((2, 3)), np.ones((1, 2, 2, 2))
bounds = np.zeros(2), np.ones(2), np.zeros((1, 3), int), np.ones((2, 1)), np.ones(2)
kernels.fly(x, np.ones((2, 2)), x.copy(), np.ones(2), *bounds, r, np.ones(1), 1.0, 1.0, True, np.zeros(1))
"""
MAX_COMPILED = 75  # functions and specialisations, numba's too; each takes about a tenth of a second
unix = pytest.mark.skipif(os.name == "nt", reason="Windows has no mode that says who may write")


def environment(home: Path, **others: str) -> dict[str, str]:
    """What a user's process starts with, whose home is that folder."""
    skip = ("HOME", "XDG_CACHE_HOME", "NUMBA_CACHE_DIR", "LOCALAPPDATA")
    return {name: value for name, value in os.environ.items() if name not in skip} | {
        "HOME": str(home), "XDG_CACHE_HOME": str(home / ".cache"), "LOCALAPPDATA": str(home / ".cache"), **others,
    }  # fmt: skip


def printed(code: str, environment: dict[str, str]) -> list[str]:
    done = subprocess.run([sys.executable, "-c", code], env=environment, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    return done.stdout.split()


@pytest.fixture
def package(tmp_path: Path) -> Path:
    """A copy of the package, so that its code can be edited."""
    copy = tmp_path / "code" / "davinci_forces"
    return shutil.copytree(PACKAGE, copy, ignore=shutil.ignore_patterns("__pycache__"))


@pytest.fixture
def home(tmp_path: Path, monkeypatch) -> Path:
    """The folder of compiled code of a user who has none yet; temporary folders are made beside it."""
    for name, value in environment(tmp_path).items():
        monkeypatch.setenv(name, value)
    monkeypatch.setenv("NUMBA_CACHE_DIR", "")
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path))
    functions = (compiled.folder, compiled.home, compiled.temporary)
    for function in functions:
        function.cache_clear()
    yield tmp_path / ".cache" / "davinci-forces"
    for function in functions:
        function.cache_clear()


def forget() -> None:
    """Have this process choose its folder again."""
    compiled.folder.cache_clear()
    compiled.home.cache_clear()


def test_a_module_that_is_inlined_gives_its_new_numbers_even_where_its_time_is_older(package, tmp_path):
    user = environment(tmp_path, PYTHONPATH=str(package.parent))
    before, _, first = printed(KERNEL, user)
    assert printed(KERNEL, user) == [before, "1", first]  # compiled once
    terms = package / "maths" / "models" / "terms.py"
    code = terms.read_text()
    assert code.count("return sign - (sign - z)") == 1
    terms.write_text(code.replace("return sign - (sign - z)", "return sign + (sign - z)"))
    os.utime(terms, (0, time.time() - 86400))
    after, hits, second = printed(KERNEL, user)
    assert float(after) > 1.0 > float(before)
    assert hits == "0"
    assert first != second


def test_a_package_that_cannot_be_written_to_keeps_its_compiled_code_in_the_user_s_folder(package, tmp_path):
    user = environment(tmp_path, PYTHONPATH=str(package.parent), PYTHONDONTWRITEBYTECODE="1")
    files = sorted(package.rglob("*"))
    for file in files:
        file.chmod(file.stat().st_mode & ~0o222)
    try:
        number, _, place = printed(KERNEL, user)
        assert printed(KERNEL, user) == [number, "1", place]
        assert sorted(package.rglob("*")) == files  # an administrator could write to it all the same
    finally:
        for file in files:
            file.chmod(file.stat().st_mode | 0o200)
    assert Path(place).parent == tmp_path / ".cache" / "davinci-forces"


@unix
def test_the_folder_and_those_above_it_that_are_made_are_the_user_s_alone(home):
    place = compiled.folder()
    assert place.parent == home
    for folder in (place, home, home.parent):
        assert folder.stat().st_mode & 0o777 == 0o700, folder


def test_a_folder_that_the_user_names_is_where_compiled_code_is_kept(home, tmp_path, monkeypatch):
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path / "named" / "here"))
    assert compiled.folder().parent == tmp_path / "named" / "here" / "davinci-forces"


@unix
@pytest.mark.parametrize("which", ["compiled", "home", "cache"])
@pytest.mark.parametrize("how", ["group", "everybody", "another's", "link"])
def test_a_folder_that_somebody_else_could_write_to_is_not_used(home, tmp_path, which, how):
    if how == "another's" and os.geteuid() != 0:
        pytest.skip("only an administrator can give a folder to another user")
    place = {"compiled": compiled.folder(), "home": home, "cache": home.parent}[which]
    forget()
    if how == "link":
        place.rename(tmp_path / "elsewhere")
        place.symlink_to(tmp_path / "elsewhere", target_is_directory=True)
    elif how == "another's":
        os.chown(place, 12345, -1)
    else:
        place.chmod({"group": 0o720, "everybody": 0o702}[how])
    chosen = compiled.folder()
    if which == "cache" and how == "link":  # which is the user's own to lay
        assert chosen.parent == tmp_path / "elsewhere" / "davinci-forces"
    else:
        assert chosen.parent.parent.name.startswith("davinci-forces-")
        assert compiled.private(chosen).name == chosen.name


@pytest.mark.medium
def test_without_a_home_a_run_and_its_workers_share_a_temporary_folder_that_is_removed(tmp_path_factory):
    tmp_path = tmp_path_factory.mktemp("t")  # a short name: the address of a socket in it has at most 107 letters
    user = environment(tmp_path, TMPDIR=str(tmp_path), TEMP=str(tmp_path))
    for name in ("HOME", "LOCALAPPDATA"):
        del user[name]
    (tmp_path / "run.py").write_text(SHARED)
    done = subprocess.run([sys.executable, tmp_path / "run.py"], env=user, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    of_run, of_worker = done.stdout.split()
    assert of_run == of_worker
    assert Path(of_run).is_relative_to(tmp_path)
    assert [file.name for file in tmp_path.iterdir()] == ["run.py"]


def test_folders_unused_for_a_month_are_removed_but_for_the_last_five(home):
    """None with another name, and nothing behind a link."""
    place = compiled.folder()
    names = [f"compiled-{number:032x}" for number in range(9)]
    for days, name in zip((29, 31, 32, 33, 34, 35, 36, 37, 38), names, strict=True):
        (home / name / "sub").mkdir(parents=True)
        os.utime(home / name, (0, time.time() - 86400 * days))
    (home / "notes").mkdir()
    os.utime(home / "notes", (0, 0))
    outside = home.parent / "outside"
    (outside / "sub").mkdir(parents=True)
    (home / f"compiled-{9:032x}").symlink_to(outside, target_is_directory=True)
    os.utime(outside, (0, 0))
    os.utime(place, (0, time.time() - 86400 * 40))
    forget()
    assert compiled.folder() == place
    assert place.stat().st_mtime > time.time() - 86400  # it has been used now
    left = {entry.name for entry in home.iterdir()}
    assert left == {place.name, *names[:4], "notes", f"compiled-{9:032x}"}
    assert (outside / "sub").is_dir()


@pytest.mark.medium
def test_a_first_run_compiles_few_functions_once_each_and_no_text(tmp_path):
    """Array expressions bring error messages, and with them the compiler's functions for text: a second or two."""
    compiled_functions = printed(COLD, environment(tmp_path))
    stored = [name for name in compiled_functions if name.startswith("davinci_forces.")]
    assert {name for name in stored if stored.count(name) > 1} <= {"davinci_forces.maths.mechanics.link.times"}
    assert len(stored) > 30
    assert len(compiled_functions) <= MAX_COMPILED
    assert not [name for name in compiled_functions if "unicode" in name]


KERNELS = [f for f in PACKAGE.rglob("*.py") if "maths.compiled import" in f.read_text(encoding="utf-8")]


@pytest.mark.parametrize("source", KERNELS, ids=lambda file: file.relative_to(PACKAGE).as_posix())
def test_all_that_compiled_code_takes_from_the_package_counts_for_its_folder(source):
    rooms = tuple(f"{room}/" for room in compiled.SOURCES)
    assert source.relative_to(PACKAGE).as_posix().startswith(rooms)
    for node in ast.walk(ast.parse(source.read_text(encoding="utf-8"))):
        if isinstance(node, ast.ImportFrom) and (node.module or "").startswith("davinci_forces."):
            assert f"{node.module.partition('.')[2].replace('.', '/')}/".startswith(rooms), node.module
