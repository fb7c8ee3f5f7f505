"""What somebody may do to results and their ledger, so that a report seems to be that of other data."""

import hashlib
import json
import re
import shutil
from contextlib import suppress
from dataclasses import replace
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from davinci_forces.errors import PipelineError
from davinci_forces.records import KINDS, store
from davinci_forces.runner.ledger import Folders, Ledger
from tests.test_robustness import analysed, finished, flat  # noqa: F401 - fixtures
from tests.test_runs import call, processed, reports


def ledger_of(study: Path) -> Ledger:
    return Ledger(Folders(study, processed(study), reports(study)))


def report_id(study: Path) -> str:
    return re.search(r"its ID is ([0-9a-f]{32})", flat(call("verify", study)))[1]


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
    remove_raw: "one.csv is gone",
    alter_raw: "one.csv was altered",
    remove_record: "independent.lse.parquet is gone",
    add_record: "independent.other.parquet was made by no stage",
    remove_results: "results.json is gone",
    remove_entry_of_the_report: "report: report: it is not in the ledger",
    remove_entry_of_a_stage: "fit: fit: it is not in the ledger",
    add_entry: "ingest: the ledger has entries of what this study has no call for: another",
    change_study_file: "lowpass = 17.0 became 12.0",
    remove_page: "report.pdf is gone",
    forge_page: "report.html is not what its records give",
    forge_results: "but its records give",
    add_page: "report (corrected).html was made by no stage",
}


@pytest.mark.parametrize("tamper", TAMPERINGS, ids=lambda tamper: tamper.__name__)
def test_verify_names_what_was_done(finished, tamper):  # noqa: F811
    tamper(finished)
    assert TAMPERINGS[tamper] in flat(call("verify", finished, code=1))


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
    sha = store.digest(file)
    for entry in list(ledger.entries()):
        inputs = {key: sha if key == name else was for key, was in entry.fingerprint["inputs"].items()}
        outputs = {key: sha if key == name else was for key, was in entry.outputs.items()}
        ledger.write(replace(entry, fingerprint=entry.fingerprint | {"inputs": inputs}, outputs=outputs))
    call("report", study, "--force")


def test_a_printed_page_tells_a_report_that_was_forged_with_all_its_files(finished):  # noqa: F811
    printed = report_id(finished)
    assert f"its ID is {printed}" in flat(call("verify", finished, "--id", printed))
    spaced = f"{printed[:16]} {printed[16:]}".upper()
    call("verify", finished, "--id", spaced)
    forge_everything(finished)
    forged = report_id(finished)  # which without the printed page is one like any other
    assert forged != printed
    said = flat(call("verify", finished, "--id", printed, code=1))
    assert f"the report ID of these files is {forged}, not {printed}" in said


def test_the_id_on_the_page_is_the_hash_of_a_manifest_of_all_files(finished):  # noqa: F811
    manifest = (reports(finished) / "manifest.txt").read_bytes()
    shown = hashlib.sha256(manifest).hexdigest()[:32]
    assert shown == report_id(finished)
    assert shown in (reports(finished) / "report.html").read_text()
    listed = dict(line.split("  ")[::-1] for line in manifest.decode().splitlines())
    root = finished.parent.parent
    assert {name: store.digest(root / name) for name in listed} == listed
    records = {file.relative_to(root).as_posix() for file in processed(finished).rglob("*.parquet")}
    pages = {"report.html", "report.pdf", "robot.html", "robot.pdf", "manifest.txt"}
    made = {f.relative_to(root).as_posix() for f in reports(finished).iterdir() if f.name not in pages}
    raw = {f"raw/lab/{file.name}" for file in finished.iterdir()}
    assert {*listed} == records | made | raw


def test_a_study_that_ran_in_part_is_not_one_that_is_reproduced(finished):  # noqa: F811
    shutil.rmtree(processed(finished))
    shutil.rmtree(reports(finished))
    call("ingest", finished)
    said = flat(call("verify", finished, code=1))
    assert "resample: one/hand_roll: it is not in the ledger, so it has not run" in said


@pytest.mark.parametrize("kind", KINDS.values(), ids=lambda kind: kind.__name__)
def test_a_flipped_byte_in_any_record_is_a_message(finished, kind):  # noqa: F811
    """Anywhere in the file, its metadata among it; what cannot be noticed by reading is noticed by its hash."""
    rng = np.random.default_rng(0)
    for file in sorted((processed(finished) / kind.folder()).rglob("*.parquet"))[:1]:
        good = file.read_bytes()
        for at in rng.integers(len(good), size=150):
            flipped = bytearray(good)
            flipped[at] ^= 1 << int(rng.integers(8))
            file.write_bytes(flipped)
            with suppress(PipelineError):
                read = store.read(kind, processed(finished), file.relative_to(processed(finished)), longest=0)
                _ = [getattr(read, name) for name in kind.columns()]
            with suppress(PipelineError):
                store.read(kind, processed(finished), file.relative_to(processed(finished)))
        file.write_bytes(good)
