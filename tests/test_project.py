"""What stands around the code: locks, the Makefile, hooks, and what continuous integration runs."""

import ast
import re
import shutil
import subprocess
import sys
import tomllib
from importlib import import_module
from importlib.util import find_spec

import pytest

from tests.conftest import ROOT
from tests.durations import MEDIUM, SLOW

PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text())
MAKEFILE = (ROOT / "Makefile").read_text()
LOCKS = {  # lock -> what it pins, with all that this needs in turn
    "requirements.lock": [*PROJECT["project"]["dependencies"], *PROJECT["dependency-groups"]["build"]],
    ".ci/install.lock": PROJECT["dependency-groups"]["install"],
    **{f"tests/{group}.lock": PROJECT["dependency-groups"][group] for group in ("test", "check", "oracles")},
}
TARGETS = dict(re.findall(r"^([a-z]+):([^#\n]*)##", MAKEFILE, re.M))


def canonical(name: str) -> str:
    return re.sub(r"[-_.]+", "-", name).lower()


def pins(lock: str) -> dict[str, set[str]]:
    """Versions by package; several where they depend on the machine."""
    found: dict[str, set[str]] = {}
    for name, version in re.findall(r"^([\w.-]+)==(\S+)", (ROOT / lock).read_text(), re.M):
        found.setdefault(canonical(name), set()).add(version)
    return found


def names(requirements: list[str]) -> set[str]:
    return {canonical(re.match(r"[\w.-]+", requirement)[0]) for requirement in requirements}


def test_every_group_of_requirements_has_a_lock_and_every_lock_a_group():
    assert {"build", "install", "test", "check", "oracles"} == set(PROJECT["dependency-groups"])
    found = {
        file.relative_to(ROOT).as_posix() for folder in ("tests", ".ci") for file in (ROOT / folder).rglob("*.lock")
    }
    assert found | {"requirements.lock"} == set(LOCKS)


@pytest.mark.parametrize("lock", LOCKS)
def test_a_lock_pins_what_is_asked_for(lock):
    assert names(LOCKS[lock]) <= set(pins(lock))


def test_running_installs_nothing_that_only_tests_need():
    others = {name for lock, asked in LOCKS.items() if lock != "requirements.lock" for name in names(asked)}
    assert not others & set(pins("requirements.lock"))


@pytest.mark.parametrize("lock", [lock for lock in LOCKS if lock != "requirements.lock"])
def test_locks_agree_with_that_of_running(lock):
    running = pins("requirements.lock")
    assert all(versions <= running[name] for name, versions in pins(lock).items() if name in running)


def test_the_hooks_are_targets_that_set_up_what_they_need():
    entries = re.findall(r"entry: (.*)", (ROOT / ".pre-commit-config.yaml").read_text())
    assert entries
    for entry in entries:
        make, target = re.fullmatch(r"(make) -s (\w+)", entry).groups()
        assert "$(READY_TO_CHECK)" in TARGETS[target], f"{make} {target}"


def test_continuous_integration_checks_what_make_check_checks():
    script = (ROOT / ".ci" / "run").read_text()
    assert re.search(r"^(\w+=\S+ )?make -j2 check all\b", script, re.M)
    assert TARGETS["check"].split() == ["lint", "types", "every-test"]
    assert re.search(r"^every-test: oracles axe\n\t.* test TESTS=--slow$", MAKEFILE, re.M)


def test_continuous_integration_is_a_script_that_a_shell_understands():
    bash = shutil.which("bash")
    if bash is None:
        pytest.skip("no bash to read .ci/run with")
    assert subprocess.run([bash, "-n", str(ROOT / ".ci" / "run")]).returncode == 0


@pytest.mark.parametrize("target", ["quick", "test", "check", "all", "bench", "fit"])
def test_make_can_make_its_targets(target):
    """By name alone: nothing is run."""
    make = shutil.which("make")
    if make is None:
        pytest.skip("no make on the path")
    done = subprocess.run([make, "-n", target], cwd=ROOT, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr


def test_benchmarks_and_long_studies_stay_out_of_the_quick_run():
    quick = re.search(r"^quick:.*\n\t(.*)", MAKEFILE, re.M)[1]
    assert "not medium and not slow" in quick
    assert "$(PYTEST)" in quick
    assert re.search(r"^PYTEST := .*-n \$\(WORKERS\)", MAKEFILE, re.M)


@pytest.mark.parametrize("file", {**MEDIUM, **SLOW})
def test_tests_that_are_called_medium_or_slow_are_there(file):
    module = ast.parse((ROOT / "tests" / file).read_text(encoding="utf-8"))
    there = {node.name for node in module.body if isinstance(node, ast.FunctionDef)}
    named = (*MEDIUM.get(file, ()), *SLOW.get(file, ()))
    assert {name.partition("[")[0] for name in named} <= there


def collected(*arguments: str) -> str:
    """What pytest would run of these, without running it."""
    command = [sys.executable, "-m", "pytest", "--collect-only", "-q", "-p", "no:cacheprovider", *arguments]
    return subprocess.run(command, cwd=ROOT, capture_output=True, text=True).stdout


@pytest.mark.medium
def test_benchmarks_run_only_where_they_are_asked_for():
    others = [f"--ignore={path}" for path in (ROOT / "tests").iterdir() if path.name != "benchmarks"]
    asked = "benchmarks/test_simulation"
    assert asked not in collected("tests", *others)
    assert asked in collected("tests", "--full", *others)
    assert asked in collected("tests/benchmarks/test_simulation.py")


@pytest.mark.medium
@pytest.mark.parametrize("file", sorted((ROOT / "tests" / "benchmarks").glob("*.py")), ids=lambda file: file.name)
def test_what_benchmarks_import_is_there(file):
    """Also in the code that they give to other processes; continuous integration runs no benchmark."""
    for module, brackets, bare in re.findall(
        r"\bfrom ((?:davinci_forces|tests)[\w.]*) import (?:\(([^)]*)\)|([\w, ]+))", file.read_text()
    ):
        for name in re.findall(r"(\w+)(?: as \w+)?", brackets or bare):
            assert hasattr(import_module(module), name) or find_spec(f"{module}.{name}"), f"{module} has no {name}"
