"""The rules of the house, which a reader should be able to rely on without reading everything."""

import ast
import inspect
import pkgutil
import re
import shutil
import subprocess
import sys
from collections import defaultdict
from dataclasses import fields
from functools import cache
from importlib import import_module
from pathlib import Path

import pytest
from typer.testing import CliRunner

import davinci_forces
from davinci_forces import commands, estimators, exports, filters, logs, robots, stages
from davinci_forces.cli import ALL, app
from davinci_forces.records import KINDS, Record
from davinci_forces.records.quantities import QUANTITIES
from davinci_forces.report import sections, writers
from davinci_forces.runner.graph import every_step
from davinci_forces.runner.signature import declaration
from davinci_forces.study import Settings

ROOT = Path(davinci_forces.__file__).parent
HOME = ROOT.parents[1]
SOURCES = sorted(ROOT.rglob("*.py"))
LISTS = {  # extension folder -> its choices
    "robots": robots.ROBOTS,
    "estimators": estimators.ESTIMATORS,
    "filters": filters.FILTERS,
    "logs": logs.FORMATS,
    "report.sections": sections.SECTIONS,
    "report.writers": writers.WRITERS,
    "commands": commands.COMMANDS,
    "exports": exports.FORMATS,
}
EXPORTED = {  # extension folder -> the name that a choice exports
    "robots": "ROBOT",
    "estimators": "estimate",
    "filters": "blocks",
    "logs": "recognises",
    "report.sections": "section",
    "report.writers": "render",
    "commands": "run",
    "exports": "render",
}

# From the top down: what stands in a row may import what stands below it, and of its own row itself only.
TIERS = (
    ("__main__",),
    ("cli",),
    ("__init__", "commands"),
    ("guide",),
    ("arrays",),
    ("runner",),
    ("exports",),
    ("stages",),
    ("report",),
    ("simulation",),
    ("study",),
    ("haptics",),
    ("identification",),
    ("estimators", "filters"),
    ("logs", "records", "robots"),
    ("maths", "toml"),
    ("files",),
    ("errors",),
)
# The same inside maths, where what is computed from motion stands above what motion is.
MATHS = (
    ("simulation", "excitation", "contact", "tissue", "selection"),
    ("estimation", "periods"),
    ("models", "uncertainty"),
    ("mechanics", "signals"),
    ("arrays", "compiled", "constants", "units"),
)


SOLVERS = {
    "solver.py": {"clarabel"},
    "lmi.py": {"clarabel"},
    "conic.py": {"clarabel"},
    "whiteness.py": {"statsmodels"},
    "drift.py": {"statsmodels"},
}  # what modules of maths import beside them, where it is called


@cache
def imports(source: Path) -> frozenset[str]:
    """Modules that a module imports, wherever it does; a name from a package may be a module of it."""
    names = set()
    for node in ast.walk(ast.parse(source.read_text(encoding="utf-8"))):
        if isinstance(node, ast.ImportFrom):
            # The version stands in the package itself, which is there before any of its modules.
            names |= {f"{node.module}.{a.name}" for a in node.names if a.name != "__version__"}
        elif isinstance(node, ast.Import):
            names |= {a.name for a in node.names}
    return frozenset(names)


def rooms(source: Path, below: str = "davinci_forces") -> set[str]:
    """The modules and folders right below a package that a module imports."""
    return {name.removeprefix(f"{below}.").split(".")[0] for name in imports(source) if name.startswith(f"{below}.")}


def tier(room: str, tiers) -> int:
    return next(i for i, row in enumerate(tiers) if room in row)


def test_imports_point_downwards():
    for source in SOURCES:
        home = source.relative_to(ROOT).parts[0].removesuffix(".py")
        for room in rooms(source) - {home}:
            assert tier(room, TIERS) > tier(home, TIERS), f"{home} imports {room}"


def test_imports_of_maths_point_downwards():
    for source in sorted((ROOT / "maths").rglob("*.py")):
        home = source.relative_to(ROOT / "maths").parts[0].removesuffix(".py")
        if home == "__init__":
            continue
        for room in rooms(source, "davinci_forces.maths") - {home}:
            assert tier(room, MATHS) > tier(home, MATHS), f"maths.{home} imports maths.{room}"


@pytest.mark.parametrize("folder", ["report.sections", "estimators", "filters", "commands", "exports"])
def test_choices_of_a_folder_do_not_import_each_other(folder):
    package = f"davinci_forces.{folder}"
    listed = {name for name, _ in choices(import_module(package))}
    for name in sorted(listed):
        for source in sources(import_module(f"{package}.{name}")):
            assert not rooms(source, package) & listed - {name}, f"{package}.{name}"


@pytest.mark.parametrize("stage", stages.STAGES)
def test_a_stage_imports_no_other(stage):
    assert not rooms(Path(import_module(stages.module(stage)).__file__), "davinci_forces.stages")


def test_every_stage_is_listed_in_the_group_whose_folder_it_is_in():
    modules = [dotted(source) for source in (ROOT / "stages").rglob("*.py") if source.name != "__init__.py"]
    assert sorted(modules) == sorted(map(stages.module, stages.STAGES))
    assert len(set(stages.STAGES)) == len(stages.STAGES)


def test_a_group_of_one_stage_has_its_name_and_any_other_a_name_of_its_own():
    rooms_of_the_package = {place.stem for place in ROOT.iterdir()}
    for group, members in stages.GROUPS.items():
        if len(members) == 1:
            assert members == (group,)
        else:
            assert group not in {*ALL, *commands.COMMANDS, *rooms_of_the_package}


def test_no_two_modules_import_each_other():
    names = {dotted(source) for source in SOURCES}
    graph = {}
    for source in SOURCES:
        needs = {name if name in names else name.rpartition(".")[0] for name in imports(source)}
        graph[dotted(source)] = needs & names - {dotted(source)}
    assert not cycle(graph)


def dotted(source: Path) -> str:
    """The name by which a module is imported."""
    return ".".join(source.relative_to(ROOT.parent).with_suffix("").parts).removesuffix(".__init__")


def cycle(graph: dict[str, set[str]]) -> list[str]:
    """Names that import each other, found by leaving out what imports nothing that is left."""
    left = dict(graph)
    while free := [name for name, needs in left.items() if not needs & set(left)]:
        for name in free:
            del left[name]
    return sorted(left)


def test_a_newcomer_finds_his_way_in_the_package():
    entries = [p for p in ROOT.iterdir() if p.name not in ("__pycache__", "py.typed")]  # which nobody reads
    assert len(entries) <= 23, sorted(p.name for p in entries)


def test_a_class_that_leaves_its_package_has_a_name_of_its_own():
    """Of two classes of one name, a reader of an import cannot tell which is meant."""
    made = defaultdict(set)
    for source in SOURCES:
        for node in ast.parse(source.read_text(encoding="utf-8")).body:
            if isinstance(node, ast.ClassDef):
                made[node.name].add(source.parent.relative_to(ROOT.parent).as_posix().replace("/", "."))
    for source in SOURCES:
        home = source.parent.relative_to(ROOT.parent).as_posix().replace("/", ".")
        for name in imports(source):
            package, _, last = name.rpartition(".")
            if len(made[last]) > 1:
                assert package.startswith(home), f"{name} in {source}: {sorted(made[last])}"


def test_arrays_are_named_once():
    aliases = re.compile(r"^\w+ = NDArray\[np\.(float64|bool_)\]", re.M)
    assert [s.name for s in SOURCES if aliases.search(s.read_text(encoding="utf-8"))] == ["arrays.py"]


def test_maths_is_numpy_scipy_and_numba_only():
    for source in sorted((ROOT / "maths").rglob("*.py")):
        outside = {name.split(".")[0] for name in imports(source)}
        assert outside - set(sys.stdlib_module_names) <= {"numpy", "scipy", "numba", "davinci_forces"} | SOLVERS.get(
            source.name, set()
        )
        assert rooms(source) <= {"maths", "errors"}, source


def test_statistics_are_imported_where_they_are_called():
    for source in SOURCES:
        module = ast.parse(source.read_text(encoding="utf-8"))
        module.body = [node for node in module.body if isinstance(node, ast.Import | ast.ImportFrom)]
        assert "statsmodels" not in ast.unparse(module), source


def test_a_stage_opens_no_file():
    for source in sorted((ROOT / "stages").rglob("*.py")):
        opening = {"pathlib", "os", "pyarrow", "pyarrow.parquet", "davinci_forces.records.store", "shutil", "io"}
        assert not imports(source) & opening, source
        called = {
            n.func.id
            for n in ast.walk(ast.parse(source.read_text()))
            if isinstance(n, ast.Call) and isinstance(n.func, ast.Name)
        }
        assert "open" not in called, source


def test_the_report_computes_no_physics():
    for source in sorted((ROOT / "report").rglob("*.py")):
        physics = {
            name for name in imports(source) if name.startswith(("davinci_forces.maths", "davinci_forces.robots"))
        }
        normal = "davinci_forces.maths.uncertainty.error_band.NORMAL_95"
        data = ("davinci_forces.maths.arrays.", "davinci_forces.robots.robot.", normal)
        assert not [name for name in physics if not name.startswith(data)], source


OPENING = {
    "open", "read_text", "read_bytes", "write_text", "write_bytes", "memory_map", "OSFile", "ParquetFile", "read_table",
    "open_file", "File", "loadmat", "whosmat", "fromfile", "memmap", "cmp",
}  # fmt: skip
OPENS = {  # a module that opens files otherwise than through `files`, and why it may
    "files.py": "it is the door",
    "guide/__init__.py": "the package's own pages",
    "cli.py": "the package's own code",
    "maths/compiled.py": "the package's own code",
    "runner/signature.py": "the package's own code",
    "report/writers/html.py": "the package's own templates",
    "report/writers/typesetting.py": "the package's own templates",
    "simulation/scenario/reading.py": "the package's own scenarios",
    "simulation/thesis.py": "the package's own index",
    "commands/haptics.py": "the package's own scenario",
    "runner/processes/arithmetic.py": "what Linux says of the processor",
    "runner/lock.py": "its own lock, which may be no file, and what Linux says of processes",
    "records/quantities.py": "the package's own table",
    "records/store.py": "a library in C, after `require_file`",
    "logs/arrow/table.py": "a library in C, after `open_log`",
    "logs/hdf5/datasets.py": "a library in C, after `open_log`",
    "logs/mat/variables.py": "a library in C, after `open_log`",
    "logs/mat/objects.py": "a library in C, given bytes",
    "logs/npz.py": "a member of a file, after `open_log`",
    "logs/ros/storage.py": "a library in C, after `isolated` has asked of every file of a bag",
    "logs/tdms/samples.py": "a library, given an opened file",
    "logs/parts.py": "a library, given what is a file",
    "simulation/sensors.py": "it writes into a new folder",
    "simulation/study_folder.py": "it writes into a new folder",
    "commands/excite.py": "it writes where it is asked to, be it to /dev/stdout",
}


def opening(source: Path) -> set[str]:
    """Names of what a module calls that opens files; the door's own functions, called by name, are not among them."""
    calls = [n.func for n in ast.walk(ast.parse(source.read_text(encoding="utf-8"))) if isinstance(n, ast.Call)]
    methods = {func.attr for func in calls if isinstance(func, ast.Attribute)} & OPENING
    functions = {func.id for func in calls if isinstance(func, ast.Name)} & {"open", "loadmat", "whosmat", "cmp"}
    return methods | functions


def test_files_are_opened_through_one_door():
    """A pipe or a device keeps whoever opens it waiting; an exception that is none any more is to be removed."""
    opens = {source.relative_to(ROOT).as_posix(): found for source in SOURCES if (found := opening(source))}
    assert opens.keys() == OPENS.keys(), opens


def test_what_is_printed_goes_through_one_place():
    prints = [s for s in SOURCES if re.search(r"typer\.s?echo|\bprint\(", s.read_text(encoding="utf-8"))]
    assert [source.relative_to(ROOT).as_posix() for source in prints] == ["runner/console.py"]


def sources(module) -> list[Path]:
    """The files of a module, or of a package."""
    file = Path(module.__file__)
    return sorted(file.parent.rglob("*.py")) if file.name == "__init__.py" else [file]


def choices(package) -> list[tuple[str, object]]:
    """The modules of an extension folder that its `__init__` lists, and what they export."""
    listed = LISTS[package.__name__.removeprefix("davinci_forces.")]
    return [(name, import_module(f"{package.__name__}.{name}")) for name in listed]


def exporting(package, name: str) -> set[str]:
    """Modules of a package that define, or hand on, a name."""
    modules = (module.name for module in pkgutil.iter_modules(package.__path__))
    return {module for module in modules if hasattr(import_module(f"{package.__name__}.{module}"), name)}


@pytest.mark.parametrize(("folder", "exported"), EXPORTED.items())
def test_every_choice_of_an_extension_folder_is_listed(folder, exported):
    assert exporting(import_module(f"davinci_forces.{folder}"), exported) == set(LISTS[folder])
    assert len(set(LISTS[folder])) == len(LISTS[folder])


def test_every_field_of_every_record_is_a_quantity_and_every_quantity_is_used():
    named = {f.name for kind in KINDS.values() for f in fields(kind)}
    assert named <= set(QUANTITIES)
    assert set(QUANTITIES) <= named | {"value"}


def test_a_record_is_a_declaration_and_what_it_does_is_for_the_report_alone():
    """A stage's fingerprint holds the fields of records; their code is not in it."""
    for kind in KINDS.values():
        made = set(vars(kind)) - {f.name for f in fields(kind)}
        public = {name for name in made if not name.startswith("_")}
        assert public <= {"KEY", "ROWS", "PUBLISHED", "UNKNOWN", "published", "prefix"}, kind
    code = "".join(s.read_text() for room in ("stages", "estimators", "filters") for s in (ROOT / room).rglob("*.py"))
    assert not re.findall(r"(?<!joint)\.(?:published|prefix)\b|QUANTITIES", code)


def test_every_record_is_listed():
    from davinci_forces import records

    made = {k for _, k in inspect.getmembers(records, inspect.isclass) if issubclass(k, Record) and k is not Record}
    assert made == set(KINDS.values())


def test_every_unit_template_is_filled_by_both_kinds_of_joint():
    for quantity in QUANTITIES.values():
        for kind in robots.Kind:
            if quantity.unit != "{unit}":
                assert "{" not in kind.unit(quantity.unit)


def test_a_stage_reads_only_what_an_earlier_stage_made():
    made: set = set()
    for step in every_step():
        asks = declaration(step)
        assert set(asks.reads) <= made, step
        made |= set(asks.makes)


def test_every_setting_is_asked_for_by_a_stage_but_for_what_the_user_wants_to_see():
    asked = {s for step in every_step() for s in declaration(step).settings}
    assert asked | {"effort"} == {f.name for f in fields(Settings)}


@pytest.mark.skipif(shutil.which("make") is None, reason="no make on the path")
def test_make_knows_every_stage_and_group():
    said = subprocess.run(["make", "-s", "help"], cwd=HOME, capture_output=True, text=True, check=True).stdout
    [listed] = re.findall(r"^  one stage of STUDY .*: (.*)$", said, re.M)
    assert sorted(listed.split()) == sorted(ALL)
    [listed] = re.findall(r"^  or one group of stages: (.*)$", said, re.M)
    assert sorted(listed.split()) == sorted(stages.GROUPS.keys() - {*ALL})


@pytest.mark.parametrize("name", [*ALL, *stages.GROUPS, *commands.COMMANDS])
def test_every_stage_and_command_explains_itself(name):
    shown = CliRunner().invoke(app, [name, "--help"], env={"COLUMNS": "200", "TERM": "dumb"})
    assert shown.exit_code == 0
    modules = {
        **{group: f"davinci_forces.stages.{group}" for group in stages.GROUPS},
        **{stage: stages.module(stage) for stage in stages.STAGES},
        **{command: f"davinci_forces.commands.{command}" for command in commands.COMMANDS},
        "report": "davinci_forces.report.report",
    }
    said = " ".join(import_module(modules[name]).__doc__.split())
    assert said in " ".join(shown.output.split())


def test_the_readme_names_every_command():
    text = (ROOT / "guide" / "reference" / "commands.md").read_text() + (
        ROOT / "guide" / "reference" / "stages.md"
    ).read_text()
    for name in ("all", *ALL, *commands.COMMANDS):
        assert f"`{name}`" in text or f"davinci-forces {name}" in text, name


def test_help_imports_nothing_heavy():
    code = (
        "import sys; sys.argv = ['davinci-forces', '--help']\n"
        "from davinci_forces.cli import main\n"
        "try: main()\n"
        "except SystemExit as done: assert done.code == 0\n"
        "heavy = {'pandas', 'scipy', 'matplotlib', 'statsmodels', 'numba', 'nptdms', 'clarabel', 'h5py', 'rosbags'}\n"
        "heavy &= set(sys.modules)\n"
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
