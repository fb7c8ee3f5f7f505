"""Change the code in one place at a time, and see whether a test fails: `make mutants` (SEED=n, COUNT=n).

A mutant is one operator, comparison or number of a module that is changed to another.  Up to `MAX_FILES` test files
run, until a test fails: those that import the module, the small studies, then those that import what imports it.  If
none does, the slow tests of these files run, too.  A mutant that no test notices survives: either a test is missing, or
the change is of no consequence.
"""

import argparse
import ast
import os
import random
import re
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from functools import cache
from pathlib import Path
from typing import NamedTuple

import pytest

from davinci_forces.maths.compiled import SOURCES
from davinci_forces.runner.fingerprint import code
from davinci_forces.runner.processes import arithmetic

ROOT = Path(__file__).resolve().parent.parent
PACKAGE = "pipeline/davinci_forces"
ROOMS = ("maths", "stages", "filters", "estimators", "identification", "report/sections")
SWAPS = {"+": "-", "-": "+", "*": "/", "/": "*", "<": ">=", "<=": ">", ">": "<=", ">=": "<", "==": "!=", "!=": "=="}
OPERATORS = {
    ast.Add: "+", ast.Sub: "-", ast.Mult: "*", ast.Div: "/", ast.Lt: "<", ast.LtE: "<=", ast.Gt: ">", ast.GtE: ">=",
    ast.Eq: "==", ast.NotEq: "!=",
}  # fmt: skip
SMALL_STUDIES = "tests/contracts/test_approved.py"
MAX_FILES = 12  # test files of a mutant
TIMEOUT = 3600  # [s]; a mutant that never ends is noticed


class Mutant(NamedTuple):
    """A place of a file, and what stands there instead."""

    file: str
    line: int
    start: int
    end: int
    before: str
    after: str

    def __str__(self) -> str:
        return f"{self.file}:{self.line}: {self.before!r} -> {self.after!r}"


def mutants_of(file: Path) -> Iterator[Mutant]:
    """All mutants of a module: operators between two operands, and numbers, outside of docstrings and annotations."""
    text = file.read_text()
    starts = [0]
    for line in text.splitlines(keepends=True):
        starts.append(starts[-1] + len(line.encode()))
    data, name = text.encode(), file.relative_to(ROOT).as_posix()

    def place(node: ast.expr, at_end: bool) -> int:
        line, column = (node.end_lineno, node.end_col_offset) if at_end else (node.lineno, node.col_offset)
        return starts[(line or 1) - 1] + (column or 0)

    for node in ast.walk(ast.parse(text)):
        if isinstance(node, ast.BinOp | ast.Compare):
            left, right, operator = (
                (node.left, node.right, node.op)
                if isinstance(node, ast.BinOp)
                else (node.left, node.comparators[0], node.ops[0])
            )
            symbol = OPERATORS.get(type(operator))
            between = data[place(left, True) : place(right, False)]
            if symbol and isinstance(right, ast.expr) and not isinstance(left, ast.JoinedStr | ast.Constant | ast.List):
                at = between.find(symbol.encode())
                if at >= 0 and not isinstance(right, ast.JoinedStr):
                    start = place(left, True) + at
                    yield Mutant(name, left.end_lineno or 0, start, start + len(symbol), symbol, SWAPS[symbol])
        elif isinstance(node, ast.Constant) and type(node.value) in (int, float):
            start, end = place(node, False), place(node, True)
            after = repr(node.value + 1 if isinstance(node.value, int) else 1.5 * node.value + 0.01)
            yield Mutant(name, node.lineno, start, end, data[start:end].decode(), after)


def draw(seed: int, count: int) -> list[Mutant]:
    """Draw mutants: a room and a module by chance, then one of its places, so that long modules do not dominate."""
    chance, drawn = random.Random(seed), []
    modules = {room: sorted((ROOT / PACKAGE / room).rglob("*.py")) for room in ROOMS}
    while len(drawn) < count:
        every = list(mutants_of(chance.choice(modules[chance.choice(ROOMS)])))
        drawn += [chance.choice(every)] if every else []
    return drawn


def tests_for(mutant: Mutant) -> list[str]:
    """Return the test files for a mutant: those that import its module, the small studies, those near to it."""
    dotted = dotted_name(ROOT / mutant.file)
    sources = {p: p.read_text() for p in (ROOT / PACKAGE).rglob("*.py")}
    importers = [p for p, text in sources.items() if imports(text, dotted)]
    near = [dotted_name(p) for p in importers]
    near.append(dotted.rpartition(".")[0])  # choices of a room are imported by name
    files = {p: p.read_text() for p in sorted((ROOT / "tests").rglob("test_*.py")) if "benchmarks" not in p.parts}
    rank = {p: 0 if imports(t, dotted) else 2 if any(imports(t, n) for n in near) else 4 for p, t in files.items()}
    helpers = [p for p in (ROOT / "tests").rglob("*.py") if p not in files and imports(p.read_text(), dotted)]
    names = [p.relative_to(ROOT).with_suffix("").as_posix().replace("/", ".") for p in helpers]
    rank = {p: min(rank[p], 3) if any(imports(t, name) for name in names) else rank[p] for p, t in files.items()}
    rank[ROOT / SMALL_STUDIES] = 1
    for name in ("contracts/test_stages.py", "contracts/test_sections.py", "contracts/test_results.py"):
        rank[ROOT / "tests" / name] = min(rank[ROOT / "tests" / name], 3)
    chosen = sorted((p for p in rank if rank[p] < 4), key=lambda p: (rank[p], p))[:MAX_FILES]
    return [p.relative_to(ROOT).as_posix() for p in chosen]


def imports(text: str, dotted: str) -> bool:
    """Whether a source imports a module, by its whole name or from its package."""
    package, _, name = dotted.rpartition(".")
    return bool(re.search(rf"(?m)^\s*(from|import) {re.escape(dotted)}\b", text)) or bool(
        re.search(rf"(?m)^\s*from {re.escape(package)} import (\([^)]*|[^\n]*)\b{re.escape(name)}\b", text)
    )


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Leave the tests that take seconds to the end of a run, which the others may end before."""
    items.sort(key=lambda item: "medium" in item.keywords)


class Tree:
    """A copy of the project in which tests run; its compiled code serves the mutants that it does not depend on."""

    def __init__(self, folder: Path) -> None:
        self.root = folder / "tree"
        left_out = shutil.ignore_patterns(".git", ".venv", "processed", "reports", ".*_cache")
        shutil.copytree(ROOT, self.root, ignore=left_out)
        for name in ("processed", "reports"):
            (self.root / name).mkdir()
        self.environment = os.environ | arithmetic.blas_variables()  # this module loads numpy before tests pin it
        self.environment |= {
            "PYTHONDONTWRITEBYTECODE": "",
            "PYTHONPATH": str(self.root / "pipeline"),
            "NUMBA_CACHE_DIR": str(folder / "compiled"),
        }
        if failed := self.failing_test([SMALL_STUDIES]):
            raise SystemExit(f"without a mutant, a test fails: {failed}")
        self.compiled = self.folder_of_compiled_code()

    def failing_test(self, files: list[str]) -> str:
        """Return the first test that fails; "" if none does."""
        command = [sys.executable, "-m", "pytest", "-x", "-q", "-p", "no:cacheprovider", "-p", "tests.mutants", *files]
        try:
            run = subprocess.run(
                command, cwd=self.root, env=self.environment, capture_output=True, timeout=TIMEOUT, text=True
            )
        except subprocess.TimeoutExpired:
            return "it does not end"
        failed = re.search(r"(?m)^(?:FAILED|ERROR) (\S+)", run.stdout)
        return "" if run.returncode in (0, 5) else failed[1] if failed else f"pytest ends with {run.returncode}"

    def folder_of_compiled_code(self) -> Path:
        """The folder in which the sources as they are now find their compiled code."""
        ask = "from davinci_forces.maths.compiled import folder; print(folder())"
        command = [sys.executable, "-c", ask]
        answer = subprocess.run(
            command, cwd=self.root, env=self.environment, capture_output=True, check=True, text=True
        )
        return Path(answer.stdout.strip())

    def reuse_compiled_code(self) -> None:
        """Let the sources as they are now find the code that was compiled for those without a mutant."""
        folder = self.folder_of_compiled_code()
        if folder != self.compiled:
            shutil.copytree(self.compiled, folder, dirs_exist_ok=True)

    def notices(self, mutant: Mutant) -> str:
        """Return the test that fails with a mutant; "" if none does."""
        file = self.root / mutant.file
        whole = file.read_bytes()
        try:
            replace_source(file, whole[: mutant.start] + mutant.after.encode() + whole[mutant.end :])
            if mutant.file.removeprefix(f"{PACKAGE}/") not in behind_compiled_code():
                self.reuse_compiled_code()
            files = tests_for(mutant)
            return self.failing_test(files) or self.failing_test([*files, "--slow"])
        finally:
            replace_source(file, whole)


@cache
def behind_compiled_code() -> frozenset[str]:
    """The modules that compile functions, and all that they import: what compiled code depends on."""
    files = [file for folder in SOURCES for file in (ROOT / PACKAGE / folder).rglob("*.py")]
    files = [file for file in files if imports(file.read_text(), "davinci_forces.maths.compiled")]
    return frozenset(code(*(dotted_name(file) for file in files)))


def dotted_name(file: Path) -> str:
    """The name by which a module is imported."""
    name = file.relative_to(ROOT / "pipeline").with_suffix("").as_posix()
    return name.removesuffix("/__init__").replace("/", ".")


def replace_source(file: Path, code: bytes) -> None:
    """Write a module, and remove its bytecode, which Python takes for current if the time is the same."""
    for compiled in (file.parent / "__pycache__").glob(f"{file.stem}.*"):
        compiled.unlink()
    file.write_bytes(code)


def main() -> None:
    """Draw, try and count."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--count", type=int, default=20)
    asked = parser.parse_args()
    survivors = []
    with tempfile.TemporaryDirectory() as folder:
        tree = Tree(Path(folder))
        for number, mutant in enumerate(draw(asked.seed, asked.count), 1):
            test = tree.notices(mutant)
            survivors += [] if test else [mutant]
            print(f"{number}. {mutant}: {test or 'SURVIVES'}", flush=True)
    print(f"{asked.count - len(survivors)} of {asked.count} mutants of seed {asked.seed} are noticed")


if __name__ == "__main__":
    main()
