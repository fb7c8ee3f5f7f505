"""What `verify` says of a run to which something was done since: each altered byte is named by its file."""

import json
import shutil
from hashlib import sha256
from pathlib import Path

import numpy as np
import pytest

from davinci_forces.runner import reporting
from tests.test_runs import call, finished, processed, reports  # noqa: F401 - fixtures

pytestmark = pytest.mark.usefixtures("drawn_once")


def flip(file: Path, at: int) -> None:
    content = bytearray(file.read_bytes())
    content[at % len(content)] ^= 1
    file.write_bytes(content)


def files_in(folder: Path) -> list[Path]:
    return sorted(f for f in folder.rglob("*") if f.is_file() and f.stat().st_size)


@pytest.mark.parametrize(
    ("where", "seed"),
    [("raw", 0), ("raw", 1), ("raw", 2), ("processed", 0), ("processed", 1), ("reports", 0)],
)
def test_verify_names_a_file_in_which_one_byte_was_altered(finished, where, seed):  # noqa: F811
    rng = np.random.default_rng(seed)
    files = files_in(finished.parent.parent / where)
    target = files[rng.integers(len(files))]
    flip(target, int(rng.integers(target.stat().st_size)))
    said = " ".join(call("verify", finished, code=1).split())
    assert target.name in said


@pytest.mark.slow
def test_verify_names_every_file_in_which_one_byte_was_altered(finished):  # noqa: F811
    """All of reports/ and many of the others at once, but the study's own, without which there is nothing to verify."""
    rng, home = np.random.default_rng(3), finished.parent.parent
    logs = [file for file in files_in(home / "raw") if file.suffix == ".csv"]
    records = [files_in(home / "processed")[i] for i in rng.permutation(len(files_in(home / "processed")))[:24]]
    altered = [*logs, *records, *files_in(home / "reports")]
    for file in altered:
        flip(file, int(rng.integers(file.stat().st_size)))
    said = " ".join(call("verify", finished, code=1).split())
    assert [file for file in altered if str(file) not in said] == []


def test_a_page_that_differs_is_explained_where_files_were_made_in_another_environment(finished, monkeypatch):  # noqa: F811
    page, hint = reports(finished) / "report.html", "where numpy was loaded before"
    page.write_bytes(page.read_bytes().replace(b"Contact", b"Kontakt", 1))
    assert hint not in " ".join(call("verify", finished, code=1).split())
    monkeypatch.setattr(reporting, "environment", lambda: "another")
    assert hint in " ".join(call("verify", finished, code=1).split())


def test_a_number_is_traced_to_the_raw_files_on_which_it_rests(finished):  # noqa: F811
    key = "contact.push.hand_roll.1.peak"
    [number] = [of for of in json.loads((reports(finished) / "results.json").read_text()) if of["key"] == key]
    first, record, *steps = call("verify", finished, "--number", key).splitlines()
    assert first.startswith(f"{key} = {number['value']:.6g} ± ")
    file = processed(finished) / "contact/push/hand_roll.parquet"
    assert str(file) in record
    assert sha256(file.read_bytes()).hexdigest()[:16] in record
    stages = [step.split()[1].rstrip(":") for step in steps if step.startswith("  by ")]
    assert stages[0] == "measure"
    assert stages.index("ekf") < stages.index("ingest")
    raw = {step.split()[1].rstrip(","): step.split()[-1].rstrip(")") for step in steps if step.startswith("  from ")}
    assert Path(next(iter(raw))).name == "push.csv"  # the number's own log comes first
    assert sum("for the model" in step for step in steps) == len(raw) - 1
    assert {Path(name).name for name in raw} >= {"push.csv", "roll.csv"}
    assert all(sha256(Path(name).read_bytes()).hexdigest().startswith(sha) for name, sha in raw.items())
    said = call("verify", finished, "--number", "contact.push.hand_rol.1.peak", code=1)
    assert f"did you mean {key}" in " ".join(said.split())
    said = call("verify", finished, "--number", "foo", code=1)
    listed = f"has no number foo; {reports(finished) / 'results.json'} lists the key of every number"
    assert listed in " ".join(said.split())


def test_verify_names_a_number_that_was_altered(finished):  # noqa: F811
    file = reports(finished) / "results.json"
    results = json.loads(file.read_text())
    for result in results:
        if result["key"] == "fit.hand_roll.independent.lse.inertia":
            result["value"] += 1e-9
    file.write_text(json.dumps(results))
    said = " ".join(call("verify", finished, code=1).split())
    assert "fit.hand_roll.independent.lse.inertia: has" in said


def test_verify_notices_files_that_are_gone_or_of_unknown_origin(finished):  # noqa: F811
    (processed(finished) / "fit" / "hand_roll" / "independent.lse.parquet").unlink()
    shutil.copy(
        processed(finished) / "track" / "roll" / "hand_roll.parquet",
        processed(finished) / "track" / "roll" / "stray.parquet",
    )
    said = " ".join(call("verify", finished, code=1).split())
    assert "independent.lse.parquet is missing" in said
    assert "stray.parquet was made by no stage" in said
