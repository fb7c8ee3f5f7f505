"""What somebody may do to results and their ledger, so that a report seems to be that of other data."""

import hashlib
import json
import multiprocessing.util
import re
import shutil
from collections.abc import Callable
from contextlib import suppress
from dataclasses import replace
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from davinci_forces.errors import BadRecord, NotReproduced, PipelineError
from davinci_forces.files import digest
from davinci_forces.records import KINDS, store
from davinci_forces.runner import reporting, verification
from davinci_forces.runner.ledger import Folders, Ledger
from tests.test_robustness import analysed, finished, flat  # noqa: F401 - fixtures
from tests.test_runs import call, contents, processed, reports

pytestmark = pytest.mark.usefixtures("drawn_once")


def ledger_of(study: Path) -> Ledger:
    return Ledger(Folders(study, processed(study), reports(study)))


def report_id(study: Path) -> str:
    return re.search(r"the report ID is ([0-9a-f]{32})", flat(call("verify", study)))[1]


def remove_raw(study):
    (study / "one.csv").unlink()


def alter_raw(study):
    with (study / "one.csv").open("a") as file:
        file.write("\n")


def remove_record(study):
    (processed(study) / "fit" / "hand_roll" / "independent.lse.parquet").unlink()


def add_record(study):
    folder = processed(study) / "fit" / "hand_roll"
    shutil.copy(folder / "independent.lse.parquet", folder / "independent.other.parquet")


def remove_results(study):
    (reports(study) / "results.json").unlink()


def remove_entry_of_the_report(study):
    (processed(study) / "tasks" / "report" / "report.json").unlink()
    page = reports(study) / "report.html"
    page.write_text(page.read_text().replace("joint", "member", 1))


def remove_entry_of_a_stage(study):
    shutil.rmtree(processed(study) / "tasks" / "fit")


def add_entry(study):
    ledger = ledger_of(study)
    ledger.write(replace(ledger.entry("ingest", "one"), task="another"))


def change_study_file(study):
    file = study / "study.toml"
    file.write_text(file.read_text() + "[settings]\nlowpass = 12.0\n")


def remove_page(study):
    (reports(study) / "report.pdf").unlink()


def forge(study, name: str, content: bytes) -> None:
    """A file of the report with an entry in the ledger that fits it."""
    (reports(study) / name).write_bytes(content)
    ledger = ledger_of(study)
    entry = ledger.entry("report", "report")
    ledger.write(replace(entry, outputs=entry.outputs | {f"reports/{name}": hashlib.sha256(content).hexdigest()}))


def forge_page(study):
    page = (reports(study) / "report.html").read_text()
    forge(study, "report.html", page.replace("joint", "member", 1).encode())


def forge_results(study):
    results = json.loads((reports(study) / "results.json").read_text())
    results[3]["value"] += 1e-9
    forge(study, "results.json", json.dumps(results).encode())


def add_page(study):
    (reports(study) / "report (corrected).html").write_text("all is well")


TAMPERINGS = {
    remove_raw: "one.csv is missing",
    alter_raw: "one.csv was altered",
    remove_record: "independent.lse.parquet is missing",
    add_record: "independent.other.parquet was made by no stage",
    remove_results: "results.json is missing",
    remove_entry_of_the_report: "report: report: it is not in the ledger",
    remove_entry_of_a_stage: "fit: fit: it is not in the ledger",
    add_entry: "ingest: the ledger has entries of tasks that this study does not have: another",
    change_study_file: "lowpass = 17.0 became 12.0",
    remove_page: "report.pdf is missing",
    forge_page: "report.html differs from what its records give",
    forge_results: "but its records give",
    add_page: "report (corrected).html was made by no stage",
}


@pytest.mark.parametrize("tamper", TAMPERINGS, ids=lambda tamper: tamper.__name__)
def test_verify_names_what_was_done(finished, tamper):  # noqa: F811
    tamper(finished)
    assert TAMPERINGS[tamper] in flat(call("verify", finished, code=1))


def add_hidden_page(study):
    (reports(study) / ".report.html").write_text("all is well")


def add_hidden_record(study):
    (processed(study) / "fit" / ".git").mkdir()
    (processed(study) / "fit" / ".git" / "config").write_text("")


def add_junk_among_entries(study):
    (processed(study) / "tasks" / "ingest" / "one.json.bak").write_text("{}")


def add_hidden_entry(study):
    folder = processed(study) / "tasks" / "ingest"
    shutil.copy(folder / "one.json", folder / ".one.json")


def add_folder_among_entries(study):
    (processed(study) / "tasks" / "fit" / "old").mkdir()
    (processed(study) / "tasks" / "fit" / "old" / "fit.json").write_text("{}")


def leave_a_record_half_written(study):
    (processed(study) / "fit" / "hand_roll" / ".independent.lse.parquet.partial").write_text("")


def link(file: Path) -> None:
    """Move a file or folder away, and leave a link to it."""
    away = file.parents[2] / f"{file.name} is here"
    shutil.move(file, away)
    file.symlink_to(away)


def link_a_page(study):
    link(reports(study) / "report.pdf")


def link_a_folder_of_records(study):
    link(processed(study) / "track")


def link_a_folder_of_entries(study):
    link(processed(study) / "tasks" / "ekf")


def link_by_the_name_of_a_file_of_the_system(study):
    (reports(study) / ".DS_Store").symlink_to(study)


STRAYS = {
    add_hidden_page: "reports/lab/.report.html was made by no stage",
    add_hidden_record: "fit/.git/config was made by no stage",
    add_junk_among_entries: "ingest/one.json.bak was made by no stage",
    add_hidden_entry: "ingest/.one.json was made by no stage",
    add_folder_among_entries: "fit/old/fit.json was made by no stage",
    leave_a_record_half_written: ".independent.lse.parquet.partial was made by no stage",
    link_a_page: "report.pdf is a link to",
    link_a_folder_of_records: "processed/lab/track is a link to",
    link_a_folder_of_entries: "processed/lab/tasks/ekf is a link to",
    link_by_the_name_of_a_file_of_the_system: "reports/lab/.DS_Store is a link to",
}


def test_verify_names_every_file_that_no_stage_made_and_every_link_among_results(finished):  # noqa: F811
    for stray in STRAYS:
        stray(finished)
    said = flat(call("verify", finished, code=1))
    assert [words for words in STRAYS.values() if words not in said] == []


def test_verify_passes_files_of_the_system_and_those_in_raw_that_the_study_does_not_name(finished):  # noqa: F811
    of_the_system = [
        processed(finished) / ".lock",
        processed(finished) / ".DS_Store",
        processed(finished) / "fit" / "Thumbs.db",
        processed(finished) / "tasks" / "fit" / "desktop.ini",
        reports(finished) / "._report.html",
    ]
    others = [finished / "notes.txt", finished / "photos" / "arm.jpg"]
    (finished / "photos").mkdir()
    for file in (*of_the_system, *others):
        file.touch()
    said = flat(call("verify", finished))
    assert "are unchanged" in said
    assert f"not checked, since they are not part of the results: {', '.join(sorted(map(str, others)))}" in said


def test_what_a_study_names_in_raw_is_not_said_to_be_left_out(tmp_path):
    for name in ("raw/lab", "disk", "processed/lab", "reports/lab"):
        (tmp_path / name).mkdir(parents=True)
    for name in ("raw/lab/study.toml", "raw/lab/review.toml", "raw/lab/old.csv", "disk/one.csv"):
        (tmp_path / name).touch()
    for link, to in (("data", "disk"), ("photos", "disk"), ("two.csv", "disk/one.csv")):
        (tmp_path / "raw" / "lab" / link).symlink_to(tmp_path / to)
    folders = Folders(*(tmp_path / root / "lab" for root in ("raw", "processed", "reports")))
    read = ["raw/study.toml", "raw/data/one.csv", "raw/two.csv"]
    others = [str(folders.raw / name) for name in ("old.csv", "photos")]
    assert verification.unknown_files(folders, read) == ([], others)


def test_results_may_be_on_a_disk_that_is_linked_to(finished, tmp_path):  # noqa: F811
    link(processed(finished))
    shutil.move(reports(finished), tmp_path / "disk")
    reports(finished).symlink_to(tmp_path / "disk")
    assert "are unchanged" in call("verify", finished)


def forge_everything(study: Path) -> None:
    """A parameter that is altered in its record, with every hash that knows of it, and the report made of that."""
    ledger = ledger_of(study)
    name = "processed/fit/hand_roll/independent.lse.parquet"
    file = ledger.folders.file(name)
    with pq.ParquetFile(file) as stored:
        table, about = stored.read(), stored.metadata.metadata
    theta = table["theta"].to_numpy() * 1.5
    altered = table.set_column(table.schema.get_field_index("theta"), table.schema.field("theta"), pa.array(theta))
    pq.write_table(altered.replace_schema_metadata(about), file)
    sha = digest(file)
    for entry in list(ledger.entries()):
        inputs = {key: sha if key == name else was for key, was in entry.fingerprint["inputs"].items()}
        outputs = {key: sha if key == name else was for key, was in entry.outputs.items()}
        ledger.write(replace(entry, fingerprint=entry.fingerprint | {"inputs": inputs}, outputs=outputs))
    call("report", study, "--force")


def test_a_printed_page_tells_a_report_that_was_forged_with_all_its_files(finished):  # noqa: F811
    printed = report_id(finished)
    assert f"the report ID is {printed}" in flat(call("verify", finished, "--id", printed))
    spaced = f"{printed[:16]} {printed[16:]}".upper()
    call("verify", finished, "--id", spaced)
    forge_everything(finished)
    forged = report_id(finished)  # which without the printed page is one like any other
    assert forged != printed
    said = flat(call("verify", finished, "--id", printed, code=1))
    assert f"the report ID of these files is {forged}, not {printed}" in said


@pytest.fixture
def temporary(tmp_path, monkeypatch) -> Path:
    """Where temporary folders are made; the sockets of processes stay where paths are short enough for them."""
    multiprocessing.util.get_temp_dir()
    folder = tmp_path / "temporary"
    folder.mkdir()
    monkeypatch.setattr("tempfile.tempdir", str(folder))
    return folder


@pytest.fixture
def another_processor(monkeypatch):
    """Results were made here, and from now on this is another processor."""
    reporting.environment.cache_clear()
    monkeypatch.setattr("davinci_forces.runner.processes.arithmetic.description", lambda: "BLAS of another kind")
    yield
    reporting.environment.cache_clear()


@pytest.mark.medium
def test_an_honest_study_comes_from_raw_byte_for_byte_and_is_not_touched(finished, temporary):  # noqa: F811
    before = contents(finished.parent.parent)
    files = sum(not name.startswith(("raw/", "temporary/")) and "/tasks/" not in name for name in before) - 1  # .lock
    said = flat(call("verify", finished, "--again"))
    assert f"recomputed from raw/: {files} files are the same, byte for byte" in said
    assert not [*temporary.iterdir()]
    assert contents(finished.parent.parent) == before


@pytest.mark.medium
def test_what_was_forged_with_all_its_hashes_does_not_come_from_raw(finished, temporary):  # noqa: F811
    forge_everything(finished)
    assert "are unchanged" in call("verify", finished)
    said = flat(call("verify", finished, "--again", "--jobs", 2, code=1))
    forged = processed(finished) / "fit" / "hand_roll" / "independent.lse.parquet"
    assert re.search(rf"error: \d+ of \d+ files differ from those recomputed from raw/: {forged}, ", said)
    assert f"{reports(finished) / 'results.json'}" in said
    assert not [*temporary.iterdir()]


@pytest.mark.medium
def test_on_another_processor_numbers_are_compared(finished, temporary, another_processor):  # noqa: F811
    said = flat(call("verify", finished, "--again"))
    compared = "recomputed from raw/ with another processor or packages, so compared by number and not by byte: of"
    assert compared in said
    assert "0 differ by more than 1e-9 of their size; 0 differ by more than their standard deviation" in said
    forge_everything(finished)
    said = flat(call("verify", finished, "--again", code=1))
    assert compared in said
    assert re.search(r"\d do not agree with raw/ \(fit.hand_roll.independent.lse.inertia, ", said)
    assert not [*temporary.iterdir()]


@pytest.mark.medium
def test_a_stage_that_fails_only_when_it_is_recomputed_is_named(finished, temporary, monkeypatch):  # noqa: F811
    def fail(*_, **__):
        raise BadRecord("no tuning today")

    monkeypatch.setattr("davinci_forces.stages.forces.tune.gather", fail)
    said = flat(call("verify", finished, "--again", code=1))
    assert "error: recomputed from raw/, tune.gather fails on gather: no tuning today" in said
    assert not [*temporary.iterdir()]


def test_a_recomputation_that_is_interrupted_leaves_nothing(finished, temporary, monkeypatch):  # noqa: F811
    def interrupt(folder, names, processed, reports, **_):
        assert processed.parent.parent == temporary
        processed.mkdir()
        raise KeyboardInterrupt

    monkeypatch.setattr("davinci_forces.runner.runs.run", interrupt)
    with pytest.raises(KeyboardInterrupt):
        verification.recompute(ledger_of(finished).folders, by_bytes=True)
    assert not [*temporary.iterdir()]


def row(value: float, std: float | None = None, unit: str = "N") -> dict:
    return {"value": value, "std": std, "unit": unit}


@pytest.mark.parametrize(
    ("key", "stored", "computed", "said"),
    [
        ("fit.a.lse.inertia", row(1.0, 0.1), row(1.0 + 1e-12, 0.1), []),
        ("fit.a.lse.inertia", row(1.009, 0.1), row(1.0, 0.1), ["different"]),
        ("fit.a.lse.inertia", row(1.011, 0.1), row(1.0, 0.1), ["different", "other"]),
        ("fit.a.lse.inertia", row(1.2, 0.1), row(1.0, 0.1), ["different", "far", "other"]),
        ("fit.a.lse.inertia", row(1.2, 9.0), row(1.0, 0.1), ["different", "far", "other"]),
        ("fit.a.lse.inertia", row(1.0, 0.12), row(1.0, 0.1), ["other"]),
        ("fit.a.lse.inertia", row(1.0, 0.1), row(1.0), ["other"]),
        ("fit.a.lse.inertia", row(1.0), row(1.0, 0.1), ["other"]),
        ("fit.a.lse.inertia", row(1.0, unit="kg"), row(1.0), ["other"]),
        ("fit.a.lse.mse", row(1.0 + 9e-7), row(1.0), ["different"]),
        ("fit.a.lse.mse", row(1.0 + 2e-6), row(1.0), ["different", "other"]),
        ("correlation.a.offset.inertia", row(1e-16), row(-7e-17), []),
        ("fit.a.lse.inertia", None, row(1.0), ["new"]),
        ("fit.a.pso.inertia", row(1.0), None, ["gone"]),
        ("fit.a.pso.inertia", row(1.2, 0.1), row(1.0, 0.1), ["different", "searched", "far"]),
        ("ekf-adaptive.one.a.free_rms", row(1.2), row(1.0), ["different", "searched"]),
        ("ekf.one.a.push_delay", row(0.1), row(0.11), ["different", "searched"]),
        ("ekf.one.a.free_rms", row(0.1), row(0.11), ["different", "other"]),
    ],
)
def test_what_is_said_of_a_number_that_another_processor_computes(key, stored, computed, said):
    words = {
        "different": "differ by more than 1e-9 of their size",
        "far": "differ by more than their standard deviation",
        "searched": "differ without a limit, since they come from a search or a count of samples",
        "new": "are not in results.json",
        "gone": "are not computed from raw/",
        "other": "do not agree with raw/",
    }
    assert [*verification.differences(key, stored, computed)] == [words[each] for each in said]
    before, now = ({key: each} if each else {} for each in (stored, computed))
    if {*said} & {"new", "gone", "other"}:
        with pytest.raises(NotReproduced, match=f"1 {words[said[-1]]} \\({key}\\)"):
            verification.compare_numbers(before, now)
    else:
        [line] = verification.compare_numbers(before, now)
        assert all(f"1 {words[each]} ({key})" in line for each in said)


def test_an_entry_knows_the_packages_and_the_processor_that_it_was_made_with(finished, monkeypatch):  # noqa: F811
    ledger = ledger_of(finished)
    reporting.environment.cache_clear()
    here = reporting.environment()
    assert {entry.environment for entry in ledger.entries()} == {here}
    assert verification.has_same_environment(ledger.folders)
    others = ("importlib.metadata.version", "platform.python_version", "platform.machine")
    for changed in (*others, "davinci_forces.runner.processes.arithmetic.description"):
        with monkeypatch.context() as patched:
            patched.setattr(changed, lambda *_: "another")
            reporting.environment.cache_clear()
            assert reporting.environment() != here, changed
            assert not verification.has_same_environment(ledger.folders)
    reporting.environment.cache_clear()


def test_the_id_on_the_page_is_the_hash_of_a_manifest_of_all_files(finished):  # noqa: F811
    manifest = (reports(finished) / "manifest.txt").read_bytes()
    shown = hashlib.sha256(manifest).hexdigest()[:32]
    assert shown == report_id(finished)
    assert shown in (reports(finished) / "report.html").read_text()
    listed = dict(line.split("  ")[::-1] for line in manifest.decode().splitlines())
    root = finished.parent.parent
    assert {name: digest(root / name) for name in listed} == listed
    records = {file.relative_to(root).as_posix() for file in processed(finished).rglob("*.parquet")}
    pages = {"report.html", "report.pdf", "robot.html", "robot.pdf", "manifest.txt", "references.bib"}
    made = {f.relative_to(root).as_posix() for f in reports(finished).iterdir() if f.name not in pages}
    raw = {f"raw/lab/{file.name}" for file in finished.iterdir()}
    assert {*listed} == records | made | raw


def test_a_study_that_ran_in_part_is_not_one_that_is_reproduced(finished):  # noqa: F811
    shutil.rmtree(processed(finished))
    shutil.rmtree(reports(finished))
    call("ingest", finished)
    said = flat(call("verify", finished, code=1))
    assert "resample: one/hand_roll: it is not in the ledger, so it has not run" in said


def columns_at(file: Path) -> Callable[[int], set[str]]:
    """For each byte of a file, the columns that it may change: that of the values it is among, else all."""
    with pq.ParquetFile(file) as stored:
        about, names = stored.metadata, set(stored.schema_arrow.names)
    chunks = [about.row_group(i).column(j) for i in range(about.num_row_groups) for j in range(about.num_columns)]
    places = []
    for chunk in chunks:
        first = min(place for place in (chunk.dictionary_page_offset, chunk.data_page_offset) if place)
        places.append((range(first, first + chunk.total_compressed_size), chunk.path_in_schema))
    return lambda at: next(({name} for where, name in places if at in where), names)


@pytest.mark.parametrize("kind", KINDS.values(), ids=lambda kind: kind.__name__)
def test_a_flipped_byte_in_any_record_is_a_message(analysed, tmp_path, kind):  # noqa: F811
    """Anywhere in the file, its metadata among it; what cannot be noticed by reading is noticed by its hash."""
    rng = np.random.default_rng(0)
    for file in sorted((processed(analysed) / kind.folder()).rglob("*.parquet"))[:1]:
        good, held = file.read_bytes(), columns_at(file)
        place = Path(file.name)
        for at in rng.integers(len(good), size=150).tolist():
            flipped = bytearray(good)
            flipped[at] ^= 1 << int(rng.integers(8))
            (tmp_path / place).write_bytes(flipped)
            with suppress(PipelineError):
                read, names = store.read(kind, tmp_path, place, longest=0), held(at)
                _ = [getattr(read, name) for name in kind.columns() if name in names]
            with suppress(PipelineError):
                store.read(kind, tmp_path, place)
