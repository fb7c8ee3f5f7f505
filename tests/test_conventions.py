"""The rules of the house, which a reader should be able to rely on without reading everything."""

import ast
import inspect
import pkgutil
import re
import subprocess
import sys
from dataclasses import fields
from importlib import import_module
from pathlib import Path

import pytest
from typer.testing import CliRunner

import pipeline
from pipeline import commands, estimators, logs, robots, stages
from pipeline.cli import app
from pipeline.quantities import QUANTITIES
from pipeline.records import KINDS, Record
from pipeline.report import sections
from pipeline.signature import declaration
from pipeline.study import Settings

ROOT = Path(pipeline.__file__).parent
HOME = ROOT.parent
SOURCES = sorted(ROOT.rglob("*.py"))

DATA = {"errors", "quantities", "units"}
MAY_IMPORT = {  # package or module -> what of the pipeline it may import, besides itself and the errors
    "errors": set(),
    "quantities": set(),
    "units": set(),
    "maths": set(),
    "records": set(),
    "store": {"quantities", "records"},
    "robots": {"maths"},
    "study": {"robots"},
    "study_problems": {"robots"},
    "study_channels": {"robots", "study", "study_problems", "units"},
    "study_file": {"estimators", "robots", "study", "study_channels", "study_problems"},
    "logs": {"units"},
    "estimators": {"maths"},
    "catalogue": {"records"},
    "report": {"quantities", "records", "catalogue", "study"},
    "stages": {"estimators", "catalogue", "logs", "maths", "records", "report", "robots", "study", "units"},
    "ledger": {"store"},
    "signature": {"catalogue", "logs", "records", "robots", "stages", "study"},
    "lock": set(),
    "plan": {"ledger", "records", "signature", "stages", "study"},
    "execution": {"ledger", "catalogue", "logs", "plan", "records", "robots", "signature", "store", "study"},
    "runner": {"execution", "ledger", "lock", "plan", "signature", "stages", "store", "study"},
    "runs": {"ledger", "runner", "study", "study_file"},
    "frames": {"ledger", "records", "runs", "store"},
    "verification": {"ledger", "catalogue", "records", "report", "store"},
    "new_study": {"logs", "robots", "units"},
    "simulation": {"logs", "maths", "robots", "store", "study", "study_file", "units"},
    "commands": {
        "logs",
        "maths",
        "new_study",
        "report",
        "robots",
        "runs",
        "simulation",
        "store",
        "units",
        "verification",
    },
    "cli": {"commands", "runs", "stages"},
    "__main__": {"cli"},
    "__init__": {"frames"},
}


def imports(source: Path) -> set[str]:
    names = set()
    for node in ast.walk(ast.parse(source.read_text(encoding="utf-8"))):
        if isinstance(node, ast.ImportFrom):
            names |= {f"{node.module}.{a.name}" if node.module == "pipeline" else node.module for a in node.names}
        elif isinstance(node, ast.Import):
            names |= {a.name for a in node.names}
    return names


@pytest.mark.parametrize("source", SOURCES, ids=lambda s: str(s.relative_to(ROOT)))
def test_imports_point_inwards(source):
    home = source.relative_to(ROOT).parts[0].removesuffix(".py")
    inside = {name.split(".")[1] for name in imports(source) if name.startswith("pipeline.")}
    assert inside - {home, "errors"} <= MAY_IMPORT[home]


@pytest.mark.parametrize("source", sorted((ROOT / "maths").glob("*.py")), ids=lambda s: s.name)
def test_maths_is_numpy_scipy_and_numba_only(source):
    outside = {name.split(".")[0] for name in imports(source)}
    assert outside - set(sys.stdlib_module_names) <= {"numpy", "scipy", "numba", "pipeline"}
    assert not {
        name for name in imports(source) if name.startswith("pipeline.") and not name.startswith("pipeline.maths")
    }


@pytest.mark.parametrize("source", sorted((ROOT / "stages").glob("*.py")), ids=lambda s: s.name)
def test_a_stage_opens_no_file(source):
    assert not imports(source) & {"pathlib", "os", "pyarrow", "pyarrow.parquet", "pipeline.store", "shutil", "io"}
    called = {
        n.func.id
        for n in ast.walk(ast.parse(source.read_text()))
        if isinstance(n, ast.Call) and isinstance(n.func, ast.Name)
    }
    assert "open" not in called


def exporting(package, name: str) -> set[str]:
    """Modules of a package that define a name at their top."""
    found = set()
    for module in pkgutil.iter_modules(package.__path__):
        tree = (
            ast.parse((Path(package.__path__[0]) / f"{module.name}.py").read_text(encoding="utf-8"))
            if not module.ispkg
            else None
        )
        tops = ast.walk(tree) if tree is None else tree.body
        for node in tops:
            targets = getattr(node, "targets", [getattr(node, "target", None)])
            names = {getattr(node, "name", None), *(getattr(t, "id", None) for t in targets)}
            if name in names:
                found.add(module.name)
    return found


@pytest.mark.parametrize(
    ("package", "exported", "listed"),
    [
        (robots, "ROBOT", robots.ROBOTS),
        (estimators, "estimate", estimators.ESTIMATORS),
        (logs, "recognises", logs.FORMATS),
        (stages, "run", stages.STAGES),
        (sections, "section", sections.SECTIONS),
        (commands, "run", commands.COMMANDS),
    ],
    ids=lambda x: getattr(x, "__name__", None),
)
def test_every_choice_of_an_extension_folder_is_listed(package, exported, listed):
    assert exporting(package, exported) == set(listed)
    assert len(set(listed)) == len(listed)


def test_every_field_of_every_record_is_a_quantity_and_every_quantity_is_used():
    named = {f.name for kind in KINDS.values() for f in fields(kind)}
    assert named <= set(QUANTITIES)
    assert set(QUANTITIES) <= named | {"value"}


def test_every_record_is_listed():
    from pipeline import records

    made = {k for _, k in inspect.getmembers(records, inspect.isclass) if issubclass(k, Record) and k is not Record}
    assert made == set(KINDS.values())


def test_every_unit_template_is_filled_by_both_kinds_of_joint():
    for quantity in QUANTITIES.values():
        for kind in robots.Kind:
            if quantity.unit != "{unit}":
                assert "{" not in kind.unit(quantity.unit)


def test_a_stage_reads_only_what_an_earlier_stage_made():
    made: set = set()
    for name in stages.STAGES:
        asks = declaration(name)
        assert set(asks.reads) <= made, name
        made |= set(asks.makes)


def test_every_setting_is_asked_for_by_a_stage():
    asked = {s for name in stages.STAGES for s in declaration(name).settings}
    assert asked == {f.name for f in fields(Settings)}


def test_the_makefile_says_what_the_signatures_say():
    text = (HOME / "Makefile").read_text()
    lines = dict(re.findall(r"^# (\w+) *: (.*)$", text, re.M))
    assert list(lines) == list(stages.STAGES)
    assert re.search(r"^STAGES := (.*)$", text, re.M)[1].split() == list(stages.STAGES)
    for name, line in lines.items():
        asks = declaration(name)
        reads, makes = (set(part.split()) for part in line.split(" -> "))
        if name == "report":
            continue
        assert makes == {k.__name__ for k in asks.makes}, name
        given = {"logs" if "log" in asks.given.values() else "robot"}
        assert reads == ({k.__name__ for k in asks.reads} or given), name


@pytest.mark.parametrize("name", [*stages.STAGES, *commands.COMMANDS])
def test_every_stage_and_command_explains_itself(name):
    shown = CliRunner().invoke(app, [name, "--help"], env={"COLUMNS": "200", "TERM": "dumb"})
    assert shown.exit_code == 0
    package = "stages" if name in stages.STAGES else "commands"
    said = " ".join(import_module(f"pipeline.{package}.{name}").__doc__.split())
    assert said in " ".join(shown.output.split())


def test_the_readme_names_every_command():
    text = (HOME / "README.md").read_text()
    for name in ("all", *stages.STAGES, *commands.COMMANDS):
        assert f"`{name}`" in text or f"davinci-forces {name}" in text, name


def test_help_imports_nothing_heavy():
    code = (
        "import sys; sys.argv = ['davinci-forces', '--help']\n"
        "from pipeline.cli import main\n"
        "try: main()\n"
        "except SystemExit as done: assert done.code == 0\n"
        "heavy = {'pandas', 'scipy', 'matplotlib', 'statsmodels', 'numba', 'bokeh', 'nptdms'} & set(sys.modules)\n"
        "assert not heavy, heavy\n"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    assert "ingest" in done.stdout


def test_no_index_host_is_named():
    for lock in [HOME / "requirements.lock", *(HOME / "tests").rglob("*.lock")]:
        text = lock.read_text()
        assert "://" not in text
        assert "--hash=sha256:" in text


def test_the_top_level_is_the_design_card():
    listed = subprocess.run(["git", "ls-files"], cwd=HOME, capture_output=True, text=True).stdout.split("\n")
    tops = {name.split("/")[0] for name in listed if name and not name.startswith(".")}
    if tops:  # a source archive has no list of its files
        allowed = {
            "pyproject.toml",
            "pipeline",
            "raw",
            "processed",
            "reports",
            "tests",
            "Makefile",
            "README.md",
            "LICENSE",
            "requirements.lock",
        }
        assert tops <= allowed
