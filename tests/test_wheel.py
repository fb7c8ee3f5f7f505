"""The package as others install it: from a wheel, in an environment and a folder that know nothing of the checkout."""

import os
import re
import shutil
import subprocess
import sys
import sysconfig
import venv
import zipfile
from collections.abc import Callable
from pathlib import Path

import pytest

from davinci_forces.runner.fingerprint import package_fingerprint
from tests.conftest import ROOT

Run = Callable[..., str]


def run(*command: object, cwd: Path) -> str:
    environment = {name: value for name, value in os.environ.items() if name != "PYTHONPATH"}
    environment["NUMBA_CACHE_DIR"] = str(cwd.parent / "compiled")  # else each environment would fill the user's cache
    done = subprocess.run([str(word) for word in command], cwd=cwd, env=environment, capture_output=True, text=True)
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout


@pytest.fixture(scope="module")
def wheel(tmp_path_factory) -> Path:
    """Built from a copy, so that the checkout stays as it is."""
    source, out = tmp_path_factory.mktemp("source"), tmp_path_factory.mktemp("wheel")
    skip = shutil.ignore_patterns("__pycache__")
    shutil.copytree(ROOT / "pipeline", source / "pipeline", ignore=skip)
    for name in ("pyproject.toml", "README.md", "LICENSE"):
        shutil.copy(ROOT / name, source)
    options = ("--no-deps", "--no-build-isolation", "--no-index", "--disable-pip-version-check", "-q")
    run(sys.executable, "-m", "pip", "wheel", *options, "-w", out, source, cwd=out)
    [file] = out.glob("*.whl")
    return file


@pytest.fixture(scope="module")
def installed(wheel, tmp_path_factory) -> Path:
    """The folder of an environment's programs; what the package needs is lent by the environment of the tests."""
    home = tmp_path_factory.mktemp("fresh") / "venv"
    venv.create(home, with_pip=False, symlinks=os.name != "nt")
    paths = sysconfig.get_paths("venv", vars={"base": str(home), "platbase": str(home)})
    python = Path(paths["scripts"]) / Path(sys.executable).name
    options = ("--no-deps", "--no-index", "--disable-pip-version-check", "-q")
    run(sys.executable, "-m", "pip", "--python", python, "install", *options, wheel, cwd=home)
    (Path(paths["purelib"]) / "lent.pth").write_text(sysconfig.get_paths()["purelib"] + "\n")
    return Path(paths["scripts"])


@pytest.mark.medium
def test_the_wheel_holds_every_file_of_the_package(wheel):
    home = ROOT / "pipeline"
    files = (
        file for file in (home / "davinci_forces").rglob("*") if file.is_file() and "__pycache__" not in file.parts
    )
    wanted = {file.relative_to(home).as_posix() for file in files}
    with zipfile.ZipFile(wheel) as archive:
        held = {name for name in archive.namelist() if ".dist-info/" not in name}
    assert held == wanted
    assert {"davinci_forces/py.typed", "davinci_forces/simulation/shipped/davinci-joints.toml"} <= held
    suffixes = {Path(name).suffix for name in held}
    assert suffixes == {
        ".py", ".toml", ".html", ".typ", ".css", ".js", ".png", ".bib", ".typed", ".json", ".c", ".h", ".md",
        ".ipynb", ".in", ".cff", ".csv",
    }  # fmt: skip


@pytest.mark.medium
def test_the_wheel_installs_one_package_only(wheel):
    with zipfile.ZipFile(wheel) as archive:
        tops = {name.split("/")[0] for name in archive.namelist()}
    assert {top for top in tops if not top.endswith(".dist-info")} == {"davinci_forces"}


@pytest.mark.medium
def test_a_pipeline_of_the_user_s_hides_nothing_and_is_not_hidden(installed, tmp_path):
    (tmp_path / "pipeline").mkdir()
    (tmp_path / "pipeline" / "__init__.py").write_text("raise RuntimeError('the folder of the user')\n")
    (tmp_path / "other").mkdir()
    (tmp_path / "other" / "pipeline.py").write_text("USER = 1\n")
    python = next(installed.glob("python*"))
    assert run(python, "-m", "davinci_forces", "--version", cwd=tmp_path).startswith("davinci-forces ")
    assert run(installed / "davinci-forces", "--version", cwd=tmp_path).startswith("davinci-forces ")
    assert run(python, "-c", "import pipeline; print(pipeline.USER)", cwd=tmp_path / "other") == "1\n"
    empty = "import importlib.util; print(importlib.util.find_spec('pipeline'))"
    assert run(python, "-c", empty, cwd=installed) == "None\n"


@pytest.mark.medium
def test_the_code_of_a_wheel_has_the_fingerprint_of_the_checkout(installed, tmp_path):
    code = "from davinci_forces.runner.fingerprint import package_fingerprint; print(package_fingerprint())"
    assert run(next(installed.glob("python*")), "-c", code, cwd=tmp_path).strip() == package_fingerprint()
    assert re.fullmatch("[0-9a-f]{12}", package_fingerprint())


@pytest.mark.slow
def test_an_installed_package_simulates_and_analyses_in_an_empty_folder(installed, tmp_path):
    program = installed / "davinci-forces"
    python = next(installed.glob("python*"))
    place = run(python, "-c", "import davinci_forces; print(davinci_forces.__file__)", cwd=tmp_path).strip()
    assert Path(place).is_relative_to(installed.parent)
    run(program, "simulate", "davinci-filter", "raw/filter", cwd=tmp_path)
    run(program, "all", "--jobs", 2, cwd=tmp_path)
    assert {file.name for file in (tmp_path / "reports" / "filter").iterdir()} == {
        "report.html", "report.pdf", "robot.html", "robot.pdf", "results.json", "summary.txt", "summary.json",
        "manifest.txt", "references.bib",
    }  # fmt: skip
    assert "are unchanged" in run(program, "verify", "raw/filter", cwd=tmp_path)
