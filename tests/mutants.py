"""Change the code in one place at a time, and see whether a test fails: `make mutants` (SEED=n, COUNT=n).

A mutant is one operator, comparison or number of a module that is changed to another.  Test files that import the
module run first, then those that import what imports it, up to `MAX_FILES`.  A mutant that no
test notices survives: either a test is missing, or the change is of no consequence.
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
from pathlib import Path
from typing import NamedTuple

ROOT = Path(__file__).resolve().parent.parent
PACKAGE = "pipeline/davinci_forces"
ROOMS = ("maths", "stages", "filters", "estimators", "report/sections")
SWAPS = {"+": "-", "-": "+", "*": "/", "/": "*", "<": ">=", "<=": ">", ">": "<=", ">=": "<", "==": "!=", "!=": "=="}
OPERATORS = {
    ast.Add: "+", ast.Sub: "-", ast.Mult: "*", ast.Div: "/", ast.Lt: "<", ast.LtE: "<=", ast.Gt: ">", ast.GtE: ">=",
    ast.Eq: "==", ast.NotEq: "!=",
}  # fmt: skip
MAX_FILES = 12  # test files of a mutant
TIMEOUT = 600  # [s]; a mutant that never ends is noticed


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
    """Return the test files for a mutant, those that import its module first."""
    dotted = mutant.file.removeprefix("pipeline/").removesuffix(".py").removesuffix("/__init__").replace("/", ".")
    sources = {p: p.read_text() for p in (ROOT / PACKAGE).rglob("*.py")}
    importers = [p for p, text in sources.items() if imports(text, dotted)]
    near = [p.relative_to(ROOT / "pipeline").with_suffix("").as_posix().replace("/", ".") for p in importers]
    near.append(dotted.rpartition(".")[0])  # choices of a room are imported by name
    files = {p: p.read_text() for p in sorted((ROOT / "tests").rglob("test_*.py")) if "benchmarks" not in p.parts}
    rank = {p: 0 if imports(t, dotted) else 1 if any(imports(t, n) for n in near) else 3 for p, t in files.items()}
    rank[ROOT / "tests" / "contracts" / "test_approved.py"] = 0
    for name in ("contracts/test_stages.py", "contracts/test_sections.py", "contracts/test_results.py"):
        rank[ROOT / "tests" / name] = min(rank[ROOT / "tests" / name], 2)
    chosen = sorted((p for p in rank if rank[p] < 3), key=lambda p: (rank[p], p))[:MAX_FILES]
    return [p.relative_to(ROOT).as_posix() for p in chosen]


def imports(text: str, dotted: str) -> bool:
    """Whether a source imports a module, by its whole name or from its package."""
    package, _, name = dotted.rpartition(".")
    return bool(re.search(rf"(?m)^\s*(from|import) {re.escape(dotted)}\b", text)) or bool(
        re.search(rf"(?ms)^\s*from {re.escape(package)} import [^\n]*\b{re.escape(name)}\b", text)
    )


def is_noticed(mutant: Mutant, tree: Path) -> str:
    """Return the test that fails with a mutant in a copy of the tree; "" if none does."""
    file = tree / mutant.file
    whole = file.read_bytes()
    try:
        replace_source(file, whole[: mutant.start] + mutant.after.encode() + whole[mutant.end :])
        for test in tests_for(mutant):
            command = [sys.executable, "-m", "pytest", "-x", "-q", "-p", "no:cacheprovider", test]
            environment = os.environ | {"PYTHONDONTWRITEBYTECODE": "", "PYTHONPATH": str(tree / "pipeline")}
            try:
                done = subprocess.run(command, cwd=tree, env=environment, capture_output=True, timeout=TIMEOUT)
            except subprocess.TimeoutExpired:
                return f"{test} (it does not end)"
            if done.returncode not in (0, 5):
                return test
    finally:
        replace_source(file, whole)
    return ""


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
        tree = Path(folder, "tree")
        left_out = shutil.ignore_patterns(".git", ".venv", "processed", "reports", ".*_cache")
        shutil.copytree(ROOT, tree, ignore=left_out)
        for name in ("processed", "reports"):
            (tree / name).mkdir()
        for number, mutant in enumerate(draw(asked.seed, asked.count), 1):
            test = is_noticed(mutant, tree)
            survivors += [] if test else [mutant]
            print(f"{number}. {mutant}: {test or 'SURVIVES'}", flush=True)
    print(f"{asked.count - len(survivors)} of {asked.count} mutants of seed {asked.seed} are noticed")


if __name__ == "__main__":
    main()
