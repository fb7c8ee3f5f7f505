"""What users expect of a command line, and of the same from Python: help as written, silence, patterns, a version."""

import inspect
import os
import re
import shutil
import subprocess
import sys
from importlib import import_module
from pathlib import Path

import pandas as pd
import pytest
import typer
from typer.testing import CliRunner

import davinci_forces
from davinci_forces import __version__, commands
from davinci_forces.cli import app, escape_tags
from davinci_forces.errors import BadRequest, BadStudy, MissingRecord
from davinci_forces.runner import ALL, runs
from davinci_forces.stages import GROUPS, module
from tests.arm import write_study

EVERY = typer.main.get_command(app).commands


def call(*arguments, code=0, columns=400) -> str:
    environment = {"COLUMNS": str(columns), "TERM": "dumb"}
    result = CliRunner().invoke(app, [str(a) for a in arguments], env=environment)
    assert result.exit_code == code, result.output
    return result.output


@pytest.fixture
def study(tmp_path) -> Path:
    return write_study(tmp_path / "raw" / "arm")


@pytest.fixture
def finished(analysed, tmp_path) -> Path:
    """A copy of an analysed study, to be changed."""
    shutil.copytree(analysed.parent.parent, tmp_path, dirs_exist_ok=True)
    return tmp_path / "raw" / "arm"


def test_the_version_is_that_of_the_package():
    assert call("--version") == f"davinci-forces {__version__}\n"


@pytest.mark.parametrize("name", EVERY)
def test_help_shows_every_description_as_it_is_written(name):
    """Neither `<study>`, which is a tag to Markdown, nor `[s]`, which is a style to rich, is lost."""
    shown = " ".join(call(name, "--help").split())
    signed = inspect.signature(EVERY[name].callback).parameters.values()
    parameters = [parameter for parameter in signed if parameter.annotation is not typer.Context]
    assert parameters
    for parameter in parameters:
        says = parameter.annotation.__metadata__[0].help
        assert says, f"{parameter.name} has no description"
        assert " ".join(says.replace("`", "").split()) in shown, parameter.name


@pytest.mark.parametrize("name", ALL)
def test_a_stage_is_explained_by_its_own_module(name):
    described = import_module("davinci_forces.report.report" if name == "report" else module(name))
    words = re.sub(r"[`\\]", "", " ".join(inspect.getdoc(described).split()))
    assert words[:60] in " ".join(call(name, "--help").split())
    assert "No such command" in call("stage", "raw/mine", code=2)


def test_a_code_span_is_shown_without_a_backslash():
    @(other := typer.Typer(rich_markup_mode="markdown")).command(help=escape_tags("Writes `raw/<study>` and <log>."))
    def command(study: str) -> None: ...

    shown = CliRunner().invoke(other, ["--help"], env={"COLUMNS": "200", "TERM": "dumb"}).output
    assert "Writes raw/<study> and <log>." in shown


def complete(**environment: str) -> str:
    done = subprocess.run(
        [sys.executable, "-c", "from davinci_forces.cli import app; app(prog_name='davinci-forces')"],
        env={**os.environ, **environment},
        capture_output=True,
        text=True,
    )
    assert done.returncode == 0, done.stderr
    return done.stdout


@pytest.mark.parametrize("shell", ["bash", "zsh", "fish", "powershell"])
def test_every_shell_gets_a_script_that_completes_commands(shell):
    assert "davinci-forces" in complete(_DAVINCI_FORCES_COMPLETE=f"source_{shell}")


def test_a_command_is_completed():
    asked = {"_DAVINCI_FORCES_COMPLETE": "complete_bash", "COMP_WORDS": "davinci-forces in", "COMP_CWORD": "1"}
    assert complete(**asked).split() == ["inspect", "ingest"]


def test_importing_the_package_imports_nothing_heavy():
    code = "import sys, davinci_forces; print({'pandas', 'numpy', 'scipy', 'numba', 'typer'} & set(sys.modules))"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "set()"


def test_a_quiet_run_says_nothing_where_all_is_well(study, tmp_path, monkeypatch):
    assert call("ingest", study, "--quiet") == ""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr("davinci_forces.cli.ALL", ("ingest", "resample"))
    elsewhere = tmp_path / "raw" / "elsewhere"  # whose logs are not there
    shutil.copytree(study, elsewhere, ignore=shutil.ignore_patterns("*.csv"))
    assert call("all", "--quiet") == ""


def test_a_quiet_run_still_says_what_went_wrong(study):
    (study / "check.csv").unlink()
    said = call("ingest", study, "-q", code=1)
    assert "warning: " in said
    assert "check.csv" in said
    assert "1 of 4 tasks failed" in said
    assert "first run" not in said


def test_a_verbose_run_names_every_task_with_its_time(study):
    said = call("ingest", study, "--verbose")
    assert re.findall(r"^ingest: (\w+): took \d+\.\d\d s$", said, re.M) == ["roll", "slide", "check", "push"]
    assert "took" not in call("ingest", study, "--force")


@pytest.mark.medium
def test_tasks_that_run_together_say_what_each_took(study, monkeypatch):
    monkeypatch.setattr("davinci_forces.runner.processes.workers.SECONDS_ALONE", -1.0)
    said = call("ingest", study, "--verbose", "--jobs", 2)
    done = re.findall(r"^ingest: (\w+): took \d+\.\d\d s$", said, re.M)
    assert {*done} == {"roll", "slide", "check", "push"}


@pytest.mark.parametrize("name", ["all", "ingest"])
def test_a_run_is_not_both_quiet_and_verbose(study, name):
    assert "leave one out" in call(name, study, "-q", "-v", code=2)


def test_a_pattern_that_the_shell_left_is_expanded(study, tmp_path, monkeypatch):
    shutil.copytree(study, tmp_path / "raw" / "other")
    (tmp_path / "raw" / "notes.txt").touch()
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr("davinci_forces.cli.ALL", ("ingest",))
    call("all", "raw/*")
    assert {folder.name for folder in (tmp_path / "processed").iterdir()} == {"arm", "other"}
    said = call("ingest", "raw/*", code=1)
    assert "raw/* matches 2 studies, raw/arm, raw/other: name one of them" in said
    assert "4 of 4 up to date" in call("ingest", "raw/?rm")
    assert "nothing*: no folder matches" in call("all", "raw/nothing*", code=1)


@pytest.mark.skipif(sys.platform == "win32", reason="Windows has no names with * or ?")
def test_a_folder_whose_own_name_looks_like_a_pattern_is_no_pattern(tmp_path):
    odd = write_study(tmp_path / "raw" / "a*")
    write_study(tmp_path / "raw" / "ab")
    assert list(runs.studies([odd])) == [odd]


def test_stages_run_from_python_in_their_order(study, capsys):
    assert davinci_forces.run(study, "resample", "ingest") is True
    said = capsys.readouterr().out
    assert said.index("ingest: ") < said.index("resample: ")
    assert set(davinci_forces.read(study, "Signal")["joint"]) == {"hand_roll", "instrument_slide"}
    assert davinci_forces.run(str(study), "ingest", quiet=True) is True
    assert capsys.readouterr().out == ""


def test_a_run_from_python_says_whether_all_went_well(study):
    (study / "check.csv").unlink()
    assert davinci_forces.run(study, "ingest", quiet=True) is False


def test_a_run_from_python_that_cannot_begin_raises(study, tmp_path):
    with pytest.raises(BadRequest, match="no stage 'ingets'; there are design, ingest"):
        davinci_forces.run(study, "ingets")
    with pytest.raises(BadStudy, match="there is no such file"):
        davinci_forces.run(tmp_path / "raw" / "nowhere")


@pytest.mark.medium
def test_every_stage_runs_where_none_is_named(finished):
    shutil.rmtree(finished.parent.parent / "reports")
    assert davinci_forces.run(finished, quiet=True) is True
    assert (finished.parent.parent / "reports" / "arm" / "results.json").exists()


@pytest.mark.medium
def test_results_are_read_by_key_with_what_is_known_of_their_error(analysed):
    frame = davinci_forces.results(analysed)
    assert list(frame.columns) == ["value", "std", "unit", "source", "std_reason"]
    assert frame.loc["period.roll", "value"] == pytest.approx(2.0, abs=5 * frame.loc["period.roll", "std"])
    assert frame.loc["period.roll", "unit"] == "s"
    assert pd.isna(frame.loc["log.roll.rows", "std"])
    assert (frame["source"].str.startswith("processed/")).all()
    assert frame.index.is_unique
    assert frame["value"].dtype == frame["std"].dtype == float


def test_results_that_are_not_there_say_what_to_run(study):
    with pytest.raises(MissingRecord, match=r"results.json does not exist; run `davinci-forces all .*arm`"):
        davinci_forces.results(study)


@pytest.mark.parametrize("text", ["{", "7", '["a"]', '[{"key": "a"}]', "[null]"])
def test_results_that_are_not_what_the_report_wrote_say_so(study, text):
    file = study.parent.parent / "reports" / "arm" / "results.json"
    file.parent.mkdir(parents=True)
    file.write_text(text)
    with pytest.raises(MissingRecord, match="is not as the report wrote it"):
        davinci_forces.results(study)


def test_help_shows_where_to_start_then_the_stages_in_panels_of_their_groups_then_the_rest():
    panels: list[tuple[str, list[str]]] = []
    for line in call("--help").splitlines():
        if title := re.match(r"╭─ ([\w ]+) ─", line):
            panels.append((title[1], []))
        elif row := re.match(r"│ ([a-z-]+) ", line):
            panels[-1][1].append(row[1])
    options, first, *groups, others = panels
    assert options[0] == "Options"
    assert first == ("Start here", ["all", "new", "inspect", "compare", "report", "guide"])
    assert groups == [(name, [*dict.fromkeys((name, *stages))]) for name, stages in GROUPS.items()]
    assert others == ("Other commands", [name for name in commands.COMMANDS if name not in first[1]])


def test_every_stage_and_command_is_there():
    assert set(EVERY) == {"all", *ALL, *GROUPS, *commands.COMMANDS}
