"""Runs of a whole study: what is current is skipped, the same data give the same bytes, and nothing is half written."""

import json
import os
import re
import shutil
import subprocess
import sys
from collections import Counter
from pathlib import Path
from types import SimpleNamespace

import pyarrow.parquet as pq
import pytest
from typer.testing import CliRunner

import davinci_forces
from davinci_forces.cli import app
from davinci_forces.errors import BadRequest, BadStudy, MissingRecord
from davinci_forces.estimators import ESTIMATORS
from davinci_forces.runner import ledger, reporting, runner, runs
from davinci_forces.runner.console import console
from davinci_forces.runner.ledger import Ledger
from davinci_forces.runner.processes import arithmetic
from davinci_forces.runner.runs import folders
from davinci_forces.runner.signature import stage_of
from davinci_forces.stages import GROUPS, STAGES
from tests.arm import write_robot, write_study

FIRST = '[[log]]\nname = "roll"'  # how the first log of the study begins


def call(*arguments, code=0) -> str:
    result = CliRunner().invoke(app, [str(a) for a in arguments])
    assert result.exit_code == code, result.output
    return result.output


def stages(study: Path, *options, names=STAGES) -> str:
    return "".join(call(name, study, *options) for name in names)


def contents(folder: Path) -> dict[str, bytes]:
    return {f.relative_to(folder).as_posix(): f.read_bytes() for f in sorted(folder.rglob("*")) if f.is_file()}


@pytest.fixture
def study(tmp_path) -> Path:
    return write_study(tmp_path / "raw" / "arm")


@pytest.fixture
def finished(analysed, tmp_path) -> Path:
    """A copy of an analysed study, to be damaged."""
    shutil.copytree(analysed.parent.parent, tmp_path, dirs_exist_ok=True)
    return tmp_path / "raw" / "arm"


def reports(study: Path) -> Path:
    return study.parent.parent / "reports" / study.name


def processed(study: Path) -> Path:
    return study.parent.parent / "processed" / study.name


def test_a_report_of_long_records_whose_columns_are_read_when_asked_for_is_the_same(finished, monkeypatch):
    monkeypatch.setattr(reporting, "MAX_CACHED_ROWS", 0)
    before = contents(reports(finished))
    call("report", finished, "--force")
    assert contents(reports(finished)) == before


def test_a_second_run_runs_no_stage_and_says_so(finished):
    before = contents(processed(finished)) | contents(reports(finished))
    said = call("all", finished)
    assert "nothing to do, all stages are up to date" in said
    assert "it has not run" not in said
    assert " of 1 up to date" not in said  # no line for each stage
    assert contents(processed(finished)) | contents(reports(finished)) == before


def test_a_second_run_imports_no_statistics(finished):
    code = (
        "import sys; from davinci_forces.cli import main\n"
        "sys.argv = ['davinci-forces', 'all', sys.argv[1]]\n"
        "try: main()\n"
        "except SystemExit as done: assert not done.code, done.code\n"
        "assert 'statsmodels' not in sys.modules\n"
    )
    done = subprocess.run([sys.executable, "-c", code, str(finished)], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    assert "nothing to do" in done.stdout + done.stderr


def test_a_dry_run_says_what_would_run_and_why_and_changes_nothing(study, finished):
    new = write_study(study.parent / "new")
    said = call("all", new, "--dry-run")
    assert "design: would run: first run" in said
    assert "resample: waits for the results of ingest" in said
    assert not processed(new).exists()
    assert "would run" not in call("all", finished, "--dry-run")
    log = next(study.glob("*.csv"))
    log.write_bytes(log.read_bytes() + b"\n")
    before = contents(processed(finished))
    said = call("all", finished, "--dry-run")
    assert re.search(r"^ingest: \S+: would run: raw/\S+ changed$", said, re.M), said
    assert contents(processed(finished)) == before


def test_a_run_ends_with_the_answer_the_times_and_where_it_is(finished):
    edit(finished / "study.toml", 'title = "A test"', 'title = "A trial"')
    (processed(finished) / "tasks" / "design" / "design.json").unlink()
    said = call("all", finished)
    answer = (reports(finished) / "summary.txt").read_text()
    assert answer in said
    assert answer.startswith("joint")
    assert re.search(r"^took \d+\.\d s: ", said[said.index(answer) :], re.M)
    for file in ("report.html", "report.pdf", "results.json"):
        assert str(reports(finished) / file) in said
    assert "\ndesign: first run\n" in f"\n{said}"


def test_the_same_data_give_the_same_bytes_whatever_the_number_of_processes(study, analysed):
    call("all", study, "--jobs", 2)
    assert contents(processed(study)) == contents(processed(analysed))
    assert contents(reports(study)) == contents(reports(analysed))


@pytest.mark.parametrize(
    ("change", "reruns", "keeps"),
    [
        (
            ("study.toml", FIRST, f"[settings]\nlowpass = 12.0\n{FIRST}"),
            ("predict", "lowpass = 17.0 became 12.0"),
            "ingest",
        ),
        (
            ("study.toml", FIRST, f"[robot_overrides.hand_roll]\nharmonics = 3\n{FIRST}"),
            ("fit", "the robot changed"),
            None,
        ),
        (
            ("study.toml", "contact = [[4.0, 6.0]]", "contact = [[4.0, 6.1]]"),
            ("ekf", "the entry changed"),
            "differentiate",
        ),
    ],
)  # fmt: skip
def test_a_stage_runs_again_and_says_why(finished, change, reruns, keeps):
    name, old, new = change
    file = finished / name
    text = file.read_text()
    assert old in text
    file.write_text(text.replace(old, new, 1))
    stage, why = reruns
    lines = stages(finished, names=(*([keeps] if keeps else []), stage)).splitlines()
    assert any(line.startswith(f"{stage}:") and why in line for line in lines), lines
    if keeps:
        assert any(line.startswith(f"{keeps}:") and line.endswith("up to date") for line in lines), lines


def test_a_changed_sample_runs_what_depends_on_it_and_nothing_else(finished):
    file = finished / "slide.csv"
    lines = file.read_text().splitlines()
    lines[5] = lines[5].replace("1", "2", 1)
    file.write_text("\n".join(lines) + "\n")
    said = call("ingest", finished)
    assert "ingest: slide: raw/slide.csv changed" in said
    assert "ingest: 3 of 4 up to date" in said


def test_many_reasons_of_one_step_are_one_line_with_the_first():
    few = {f"raw/{i}.csv changed": [f"log-{i}"] for i in range(runner.MAX_REASONS)}
    assert runner._grouped(few) == few
    many = few | {"raw/x.csv changed": ["log-x", "log-y"]}
    assert runner._grouped(many) == {"raw/0.csv changed; more such reasons: 1": ["log-0", "log-x", "log-y"]}
    made = {"processed/a.parquet changed": ["a"], "the entry changed": ["b"]}
    assert list(runner._grouped(made)) == ["the entry changed; more such reasons: 1"]


def test_several_warnings_of_a_run_are_printed_once_more_at_its_end(capsys):
    warnings = [f"ingest: warning: {'abcdefghijklmnopq'[i]}" for i in range(runs.MAX_REPEATED + 2)]
    made = SimpleNamespace(warnings=warnings, console=console("normal"), ran=1, seconds={}, folders=None)
    made.ledger = SimpleNamespace(entry=lambda *_: None)
    runs.print_results(made, Path("raw/a"))
    said = capsys.readouterr().err.splitlines()
    assert said == [
        "the warnings of this run once more, one of each kind:",
        *(f"  {line}" for line in warnings[: runs.MAX_REPEATED]),
        "  and 2 more, above",
    ]
    alike = [f"resample: warning: log-{i}/roll: it stands still from {i} s" for i in range(3)]
    failed = "average: error: log-3: no joint moves"
    made.warnings = [*alike, warnings[0], failed, "report: error: review.toml:3: right above"]
    runs.print_results(made, Path("raw/a"))
    assert capsys.readouterr().err.splitlines() == [
        "the warnings and errors of this run once more, one of each kind:",
        f"  {alike[0]} (2 more remarks of this kind)",
        f"  {warnings[0]}",
        f"  {failed}",
    ]
    made.warnings = warnings[:1]
    runs.print_results(made, Path("raw/a"))
    assert not capsys.readouterr().err


def test_an_altered_processed_file_is_made_again(finished):
    target = processed(finished) / "signal" / "roll" / "hand_roll.parquet"
    good = target.read_bytes()
    target.write_bytes(good[:200] + bytes([good[200] ^ 1]) + good[201:])
    said = call("resample", finished)
    assert "processed/signal/roll/hand_roll.parquet was altered" in said
    assert target.read_bytes() == good


@pytest.fixture
def package(tmp_path) -> Path:
    """A copy of the package, so that its code can be edited."""
    copy = tmp_path / "code" / "davinci_forces"
    return shutil.copytree(Path(davinci_forces.__file__).parent, copy, ignore=shutil.ignore_patterns("__pycache__"))


def run_by(package: Path, *arguments: object) -> str:
    """What a copy of the package says."""
    command = [sys.executable, "-m", "davinci_forces", *map(str, arguments)]
    compiled = str(package.parent / "compiled")  # else what each copy compiles would fill the user's cache
    environment = {**os.environ, "PYTHONPATH": str(package.parent), "NUMBA_CACHE_DIR": compiled}
    done = subprocess.run(command, env=environment, cwd=package.parent, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    return done.stdout


def edit(file: Path, old: str, new: str) -> None:
    text = file.read_text()
    assert old in text
    file.write_text(text.replace(old, new))


@pytest.mark.slow
def test_editing_a_term_of_the_model_makes_the_fit_run_again_and_says_why(finished, package):
    assert "fit: 5 of 5 up to date" in run_by(package, "fit", finished)
    edit(package / "maths" / "models" / "terms.py", 'b={"sign(dq)": 1.0}', 'b={"sign(dq)": 2.0}')
    said = run_by(package, "fit", finished)
    assert "the robot changed" in said
    assert "the code of maths/models/terms.py changed" in said


@pytest.mark.slow
def test_a_reworded_meaning_runs_what_stores_it_and_what_reads_that(finished, package):
    edit(
        package / "records" / "quantities.csv",
        "measured effort minus the model's",
        "the effort that the model does not explain",
    )
    edit(package / "records" / "prediction.py", "The scores.", "How good it is.")
    said = run_by(package, "all", finished)
    for stage in ("design", "ingest", "resample", "average", "differentiate", "fit", "predict"):
        [line] = [line for line in said.splitlines() if line.startswith(f"{stage}: ")]
        assert line.endswith(" up to date"), line
    assert re.search(r"^ekf: .* and 1 more: the declaration of Track changed$", said, re.M), said
    assert re.search(r"^whiteness: track/.*: processed/track/.*parquet changed; more such reasons: 3$", said, re.M), (
        said
    )
    assert re.search(r"^report: the code of records/prediction.py changed", said, re.M), said


def test_entries_and_files_are_read_once_a_run(finished, monkeypatch):
    hashed, read = Counter(), Counter()
    digest, entry = ledger.digest, ledger._read
    monkeypatch.setattr(ledger, "digest", lambda file: hashed.update([Path(file)]) or digest(file))
    monkeypatch.setattr(ledger, "_read", lambda file: read.update([Path(file)]) or entry(file))
    assert "nothing to do" in call("all", finished)
    assert set(processed(finished).rglob("*.parquet")) <= set(hashed)
    assert set(hashed.values()) == {1}
    assert set(read) == set((processed(finished) / "tasks").glob("*/*.json"))
    assert set(read.values()) == {1}


def test_an_entry_that_somebody_altered_counts_for_nothing(finished):
    entry = processed(finished) / "tasks" / "average" / "roll.json"
    good = entry.read_bytes()
    entry.write_bytes(good.replace(b'"failed": ""', b'"failed": "x"'))
    assert "average: roll: first run" in call("average", finished)
    assert "nothing to do" in call("all", finished)
    assert entry.read_bytes() == good


def test_the_report_is_written_again_when_what_it_shows_or_it_itself_changed(finished):
    page = reports(finished) / "report.html"
    good = page.read_bytes()
    page.write_bytes(b"")
    assert "report: reports/report.html was altered" in call("report", finished)
    assert page.read_bytes() == good
    edit(finished / "study.toml", 'title = "A test"', 'title = "A trial"')
    assert "report: the study changed; raw/study.toml changed" in call("report", finished)
    assert "report: 1 of 1 up to date" in call("report", finished)


def test_a_report_that_fails_says_so_costs_no_stage_and_is_tried_again(finished, monkeypatch):
    def fail(*_):
        raise ZeroDivisionError("for a test")

    with monkeypatch.context() as patch:
        patch.setattr("davinci_forces.report.report.collect", fail)
        edit(finished / "study.toml", 'title = "A test"', 'title = "A trial"')
        assert "report: error: ZeroDivisionError: for a test (test_runs.py:" in call("report", finished, code=1)
    assert "report: it failed last time" in call("report", finished)
    assert "are unchanged" in call("verify", finished)


def test_a_log_that_leaves_the_study_takes_its_records_with_it(finished):
    text = (finished / "study.toml").read_text()
    first, *logs = text.split("[[log]]")
    (finished / "study.toml").write_text("[[log]]".join([first, *(log for log in logs if '"check"' not in log)]))
    stages(finished)
    assert not [name for name in contents(processed(finished)) if "check" in name]


def ran(study: Path) -> set[str]:
    """The stages that have run, by their entries."""
    return {stage_of(entry.stage) for entry in Ledger(folders(study, None, None)).entries()}


def test_a_stage_of_a_fresh_study_runs_what_it_needs_and_nothing_else(study):
    said = call("fit", study)
    assert ran(study) == {"ingest", "resample", "average", "differentiate", "fit"}
    assert "fit: first run" in said
    again = call("fit", study).splitlines()[1:]
    assert again == ["fit: 5 of 5 up to date", f"{study}: nothing to do, all stages are up to date"]


UNGUARDED = """
import sys, numpy, davinci_forces
print(davinci_forces.run(sys.argv[1], jobs=2))
"""


def test_a_script_that_loaded_numpy_first_makes_the_bytes_of_the_command_line_in_two_processes(finished, tmp_path):
    before = contents(reports(finished))
    (reports(finished) / "report.html").unlink()
    script = tmp_path / "script.py"
    script.write_text(UNGUARDED)
    unpinned = {name: value for name, value in os.environ.items() if name not in arithmetic.blas_variables()}
    done = subprocess.run([sys.executable, script, finished], env=unpinned, capture_output=True, text=True, check=True)
    assert done.stdout.count("report: reports/report.html was altered") == 1
    assert done.stdout.endswith("True\n")
    assert contents(reports(finished)) == before


def test_a_run_in_a_new_process_raises_and_says_what_it_would_here(finished, monkeypatch, capfd):
    monkeypatch.setattr(arithmetic, "_loaded_unpinned", True)
    assert davinci_forces.run(finished)
    assert "nothing to do" in capfd.readouterr().out
    assert davinci_forces.run(finished, quiet=True)
    assert capfd.readouterr().out == ""
    (finished / "push.csv").write_text("no numbers")
    assert not davinci_forces.run(finished, "ingest")
    assert "push.csv" in capfd.readouterr().out
    (finished / "study.toml").write_text('robot = "no such"')
    with pytest.raises(BadStudy, match=r"study.toml:1: there is no robot 'no such'"):
        davinci_forces.run(finished)
    monkeypatch.setattr(sys, "executable", shutil.which("false"))
    with pytest.raises(BadRequest, match="ended with code 1"):
        davinci_forces.run(finished)


def test_a_group_of_a_fresh_study_runs_its_stages_and_what_they_need(study):
    said = call("model", study, "--dry-run")
    assert "ingest: roll, slide, check and 1 more: would run: first run" in said
    assert "predict: waits for" in said
    assert not [line for line in said.splitlines() if line.startswith(("design", "tune", "ekf", "report"))]
    assert davinci_forces.run(study, "model", quiet=True)
    assert ran(study) == {*GROUPS["recordings"], *GROUPS["model"]}


def test_what_a_stage_needs_runs_where_it_is_not_current_and_is_not_forced(finished):
    tasks = processed(finished) / "tasks"
    (tasks / "average" / "slide.json").unlink()
    said = call("fit", finished, "--force").splitlines()[1:]
    assert said[:2] == ["average: slide: first run", "fit: --force"]
    assert not [line for line in said if line.startswith(("ingest", "resample", "differentiate"))]


def test_units_meanings_and_origins_travel_with_the_file(analysed):
    file = pq.ParquetFile(processed(analysed) / "average" / "slide" / "instrument_slide.parquet")
    field = file.schema_arrow.field("tau_var")
    assert field.metadata[b"unit"] == b"N^2"
    assert field.metadata[b"meaning"] == b"variance of the effort between periods"
    made_from = json.loads(file.metadata.metadata[b"made_from"])
    assert made_from["inputs"].keys() == {"processed/signal/slide/instrument_slide.parquet"}
    assert made_from["settings"] == {"harmonics": 0, "lowpass": 17.0}
    assert "maths/periods/averaging.py" in made_from["code"]


def test_floats_are_stored_byte_by_byte_and_compressed(analysed):
    group = pq.ParquetFile(processed(analysed) / "recording" / "roll" / "hand_roll.parquet").metadata.row_group(0)
    for i in range(group.num_columns):
        column = group.column(i)
        assert column.compression == "LZ4"
        if column.physical_type == "DOUBLE":
            assert "BYTE_STREAM_SPLIT" in column.encodings
            assert not column.has_dictionary_page


def test_no_processed_file_knows_this_machine(analysed):
    home = str(analysed.parent.parent).encode()
    assert not [name for name, content in contents(processed(analysed)).items() if home in content]


def test_a_study_is_read_back_as_a_frame_with_its_units(analysed):
    frame = davinci_forces.read(analysed, "Track", joint="hand_roll")
    assert set(frame["log"]) == {"roll", "check", "push"}
    assert frame.attrs["units"]["tau_ext"] == "N m"
    both = davinci_forces.read(analysed, "Track")
    assert both.attrs["units"]["q"] == {"hand_roll": "rad", "instrument_slide": "m"}
    own = davinci_forces.read(analysed, "Fit", model="independent")
    assert set(own["estimator"]) >= set(ESTIMATORS)
    assert len(own[own["estimator"] == "lse"]) == 4 + 4


def test_reading_what_is_not_there_says_what_there_is(analysed, study):
    with pytest.raises(BadRequest, match="no kind of record 'Tracks'; the kinds are Links, Pose"):
        davinci_forces.read(analysed, "Tracks")
    with pytest.raises(BadRequest, match="Track has no arm; it has log, joint"):
        davinci_forces.read(analysed, "Track", arm="left")
    with pytest.raises(MissingRecord, match="run `davinci-forces all"):
        davinci_forces.read(study, "Track")


def test_results_hold_what_the_study_found(analysed):
    results = {r["key"]: r for r in json.loads((reports(analysed) / "results.json").read_text())}
    assert results["period.roll"]["value"] == pytest.approx(2.0, abs=5 * results["period.roll"]["std"])
    assert results["fit.hand_roll.independent.lse.inertia"]["unit"] == "kg m^2"
    assert results["predict.check.hand_roll.independent.lse.r2"]["value"] > 0.5
    assert "cv.roll.hand_roll.independent.lse.r2" in results
    for name in ("tau_ext_rms", "acf1_q", "acf1_dq", "ljung_box_p_q", "ljung_box_p_dq", "nis_mean", "white"):
        assert f"ekf.push.hand_roll.{name}" in results


def test_a_push_is_found_in_the_contact_log(analysed):
    track = davinci_forces.read(analysed, "Track", log="push")
    inside = track["t"].between(4.5, 5.9)
    assert track["tau_ext"][inside].mean() == pytest.approx(1.0, abs=0.15)


def test_verify_passes_what_was_made(analysed):
    assert "are unchanged, all" in call("verify", analysed)


def test_all_takes_the_studies_of_raw_and_skips_those_without_logs(study, monkeypatch, tmp_path):
    monkeypatch.chdir(tmp_path)
    other = tmp_path / "raw" / "elsewhere"
    other.mkdir()
    write_robot(other)
    (other / "study.toml").write_text((study / "study.toml").read_text())
    monkeypatch.setattr("davinci_forces.cli.ALL", ("ingest",))
    said = call("all")
    assert said.startswith("raw/elsewhere: skipped, as none of its logs is here; the study.toml of each says where")
    assert (tmp_path / "processed" / "arm" / "recording" / "roll" / "hand_roll.parquet").exists()


def test_folders_may_lie_elsewhere(study, tmp_path):
    call("ingest", study, "--processed", tmp_path / "p", "--reports", tmp_path / "r")
    assert (tmp_path / "p" / "arm" / "log_summary" / "roll.parquet").exists()


def test_raw_files_are_never_touched(analysed, study):
    assert contents(analysed) == contents(study)
