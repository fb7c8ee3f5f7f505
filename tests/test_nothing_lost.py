"""What a run may replace and remove: files of its own study, and the pages of a report only all at once."""

import gzip
import json
import shutil
from contextlib import suppress
from pathlib import Path

import numpy as np
import pytest

from davinci_forces.files import PARTIAL, leftovers
from davinci_forces.runner import reporting
from davinci_forces.runner.fingerprint import Fingerprint, hash_of_text
from davinci_forces.runner.ledger import OUTPUT, Entry, Folders, Ledger, seal
from davinci_forces.runner.plan import Task
from tests.test_robustness import analysed, finished, flat, raw, small  # noqa: F401 - fixtures
from tests.test_runs import call, contents, processed, reports

pytestmark = pytest.mark.usefixtures("drawn_once")
EARLIER = Path(__file__).parent / "earlier"
PAGES = ("report.html", "report.pdf", "robot.html", "robot.pdf", "results.json", "summary.txt", "summary.json")


def snapshot(folder: Path) -> dict[str, str]:
    """Every file and folder below a folder, with the content of files and the target of links."""
    return {
        place.relative_to(folder).as_posix(): (
            f"-> {place.readlink()}"
            if place.is_symlink()
            else place.read_bytes().hex()
            if place.is_file()
            else "folder"
        )
        for place in sorted(folder.rglob("*"))
    }


def test_a_report_that_fails_leaves_the_last_one_and_says_that_it_is_older(finished):  # noqa: F811
    before = contents(reports(finished))
    assert "report.html" in before
    (finished / "review.toml").write_text('[[rating]]\nverdict = "fine"\n')
    said = flat(call("all", finished, code=1))
    assert "review.toml:2: " in said
    assert f"the pages in {reports(finished)} are those of an earlier run" in said
    assert "see " not in said
    assert contents(reports(finished)) == before
    assert "it failed last time" in flat(call("report", finished, code=1))
    assert contents(reports(finished)) == before
    (finished / "review.toml").unlink()
    call("report", finished)
    assert contents(reports(finished)) == before


def test_a_first_report_that_fails_speaks_of_no_earlier_one(raw):  # noqa: F811
    folder = small(raw / "lab", ("one",))
    (folder / "review.toml").write_text('[[rating]]\nverdict = "fine"\n')
    assert "an earlier run" not in flat(call("all", folder, code=1))
    assert not contents(reports(folder))


class Killed(BaseException):
    """The process ends here: nothing after it happens."""


@pytest.mark.parametrize("seed", range(200))
def test_a_report_is_replaced_whole_or_by_the_next_run(tmp_path, monkeypatch, seed):
    """Writing fails, or the run is killed, at any step of writing any files over any others."""
    rng = np.random.default_rng(seed)

    def pages(edition: str) -> dict[str, bytes]:
        names = rng.permutation(PAGES)[: rng.integers(1, len(PAGES) + 1)]
        return {name: f"{name} {edition}".encode() for name in names} | {"manifest.txt": edition.encode()}

    def write(files: dict[str, bytes]) -> bool:
        monkeypatch.setattr(reporting, "render", lambda *_: files)
        ledger = Ledger(folders)
        outcome = reporting.perform(ledger, task)
        ledger.write(Entry(task.step, task.name, vars(task.fingerprint), outcome.outputs, outcome.failed))
        return not outcome.failed

    folders = Folders(tmp_path / "raw", tmp_path / "processed", tmp_path / "reports")
    task = Task("report", "report", Fingerprint({}, {}, {}, {}, {}, "1"))
    old, new = pages("old"), pages("new")
    assert write(old)
    assert contents(folders.reports) == old
    last, error = rng.integers(1, 2 * len(new) + 1), rng.choice([Killed, OSError])
    steps = 0

    def counted(operation):
        def step(path, *arguments):
            nonlocal steps
            steps += 1
            if steps == last or (steps > last and error is Killed):
                raise error("here it ends")
            return operation(path, *arguments)

        return step

    with monkeypatch.context() as patch:
        for name in ("write_bytes", "replace"):
            patch.setattr(Path, name, counted(getattr(Path, name)))
        if error is Killed:
            patch.setattr(Path, "unlink", lambda *_, **__: None)
        with suppress(Killed):
            assert not write(new)
    there = {name: content for name, content in contents(folders.reports).items() if not name.endswith(PARTIAL)}
    renamed = [*new][: max(last - len(new) - 1, 0)]
    assert there == old | {name: new[name] for name in renamed}
    assert ("manifest.txt" in renamed) <= (len(renamed) == len(new))
    after = Ledger(folders)
    reasons = after.reasons(after.entry("report", "report"), task.fingerprint)
    seen = "was altered" if error is Killed else "it failed last time"
    assert any(seen in reason for reason in reasons) == bool(error is OSError or {*renamed} & {*old})
    for leftover in leftovers(folders.reports):
        leftover.unlink()
    assert write(new)
    assert contents(folders.reports) == new


OUTSIDE = (  # of the study `lab`, in the folder that all studies are in
    "raw/lab/one.csv", "raw/lab/study.toml", "raw/other/log.csv", "processed/other/fit/roll/a.parquet",
    "processed/other/tasks/fit/roll.json", "reports/other/report.html", "notes.txt", "fit/notes.parquet",
    "processed/lab/notes.txt", "processed/lab/notes/mine.parquet", "reports/lab/notes.txt", "reports/lab/my.html",
)  # fmt: skip


def names_of(place: str, rng: np.random.Generator) -> str:
    """A way to write the name of a file in the folder that holds raw/, processed/ and reports/ as that of an output."""
    root = rng.choice(["raw", "processed", "reports"])
    if place.startswith(f"{root}/lab/") and rng.random() < 0.5:
        return place.replace("/lab/", "/", 1)
    start = rng.choice(["", "fit/", "fit/hand_roll/", "notes/", "report.html/", "./", "fit/./", "fit//"])
    up = start.rstrip("/").count("/") + (start not in ("", "./")) - start.count("./") - start.count("//")
    forms = [f"{root}/{start}{'../' * (up + 2)}{place}", f"{root}//LAB/{place}", f"{root}/{start}/LAB/{place}"]
    name = rng.choice(forms)
    return name.replace("/", "\\") if rng.random() < 0.1 else str(name)


def lab(folder: Path) -> Path:
    """A study of one log that has been read, among files of others."""
    study = small(folder / "raw" / "lab", ("one",))
    call("ingest", study)
    for place in OUTSIDE[2:]:
        (folder / place).parent.mkdir(parents=True, exist_ok=True)
        (folder / place).write_text(f"{place} of somebody\n")
    return study


def plant(study: Path, entry: Entry, file: Path | None = None) -> None:
    """Put an entry in the ledger as another hand does, its seal right."""
    file = file or processed(study) / "tasks" / entry.stage / f"{entry.task}.json"
    file.parent.mkdir(parents=True, exist_ok=True)
    file.write_text(seal(entry))


@pytest.mark.slow
def test_no_entry_of_another_hand_reaches_a_file_outside(tmp_path):
    """200 entries of stages that are and were, in files or in the index, of one or several names."""
    study, rng = lab(tmp_path), np.random.default_rng(0)
    honest = Ledger(Folders(study, processed(study), reports(study))).entry("ingest", "one")
    clean, tasks = snapshot(tmp_path), processed(study) / "tasks"
    good = {name: (tmp_path / name).read_bytes() for name in clean if (tmp_path / name).is_file()}
    for case in range(200):
        victims = [str(place) for place in rng.choice(OUTSIDE, size=rng.integers(1, 4))]
        names = [names_of(place, rng).replace("LAB", str(tmp_path)) for place in victims]
        stage, task = [("ingest", "one"), ("ingest", "gone"), ("settle", "settle"), ("fit", "hand_roll")][
            rng.integers(4)
        ]
        outputs = (
            {**honest.outputs, **dict.fromkeys(names, "0" * 64)} if rng.random() < 0.5 else dict.fromkeys(names, "")
        )
        entry = Entry(stage, task, honest.fingerprint, outputs)
        plant(study, entry)
        said = flat(call("verify", study, code=1) if case % 10 == 0 else call("ingest", study))
        assert f"{stage}/{task}.json" in said.replace("\\", "/"), names
        assert any(repr(name) in said for name in names) or not any(names)
        now = snapshot(tmp_path)
        assert {place: now.get(place) for place in OUTSIDE} == {place: clean[place] for place in OUTSIDE}
        (tasks / stage / f"{task}.json").unlink(missing_ok=True)
        for name, content in good.items():
            (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
            (tmp_path / name).write_bytes(content)


@pytest.mark.parametrize("stage", ["../..", "../../../raw/lab", ".", "ingest/../../.."])
def test_an_entry_that_says_to_be_elsewhere_does_not_have_that_place_removed(tmp_path, stage):
    study = lab(tmp_path)
    victim = processed(study) / "tasks" / stage / "victim.json"
    victim.write_text("{}")
    plant(study, Entry(stage, "victim", {}, {}), processed(study) / "tasks" / "settle" / "victim.json")
    call("ingest", study)
    assert victim.read_text() == "{}"


def test_what_is_behind_a_link_to_a_folder_is_not_removed(tmp_path):
    """`ledger` alone: a run refuses such a folder before it removes anything."""
    study = lab(tmp_path)
    ledger = Ledger(Folders(study, processed(study), reports(study)))
    elsewhere = tmp_path / "elsewhere"
    (elsewhere / "roll").mkdir(parents=True)
    (elsewhere / "roll" / "a.parquet").write_text("of somebody")
    (processed(study) / "fit").symlink_to(elsewhere)
    entry = Entry("settle", "settle", ledger.entry("ingest", "one").fingerprint, {"processed/fit/roll/a.parquet": ""})
    ledger.write(entry)
    ledger.remove(entry)
    assert (elsewhere / "roll" / "a.parquet").read_text() == "of somebody"


@pytest.mark.parametrize("part", ["outputs", "inputs", "code", "stage", "fingerprint", "deep"])
def test_an_entry_of_another_shape_is_none(tmp_path, part):
    study = lab(tmp_path)
    honest = Ledger(Folders(study, processed(study), reports(study))).entry("ingest", "one")
    values = json.loads(json.dumps(vars(honest)))
    (values["fingerprint"] if part in values["fingerprint"] else values)[part] = [{"a": []}, 3]
    if part == "deep":
        values = {**vars(honest), "failed": 0}
    text = json.dumps(values, indent=1, ensure_ascii=False, sort_keys=True)
    if part == "deep":
        text = text.replace(": 0,", f": {'[' * 100_000}{']' * 100_000},", 1)
    seal = f',\n "seal": "{hash_of_text(text)}"\n}}\n'
    (processed(study) / "tasks" / "ingest" / "one.json").write_text(text.removesuffix("\n}") + seal)
    assert "tasks/ingest/one.json was altered" in flat(call("verify", study, code=1)).replace("\\", "/")
    assert "first run" in call("ingest", study)
    assert Ledger(Folders(study, processed(study), reports(study))).entry("ingest", "one") == honest


@pytest.mark.medium
def test_what_an_earlier_version_made_goes_and_the_rest_is_as_if_it_had_never_been(raw):  # noqa: F811
    """The ledger is that of this study as commit eca45f8 wrote it; what it names is there, with other content."""
    study = small(raw / "lab", ("one",))
    call("all", study)
    clean = contents(processed(study)), contents(reports(study))
    shutil.rmtree(processed(study))
    shutil.rmtree(reports(study))
    index = gzip.decompress((EARLIER / "index-eca45f8.json.gz").read_bytes())
    written = json.loads(index.partition(b"\n")[2])
    folders = Folders(study, processed(study), reports(study))
    for stage, named in written["entries"].items():
        for name, values in named.items():
            shared = {part: written["shared"][i] for part, i in values.pop("shared").items()}
            values["fingerprint"] |= shared
            plant(study, Entry(**values), processed(study) / "tasks" / stage / f"{name}.json")
            for output in values["outputs"]:
                folders.file(output).parent.mkdir(parents=True, exist_ok=True)
                folders.file(output).write_text("of an earlier version")
    (processed(study) / "tasks" / "index.json").write_bytes(index)
    notes = processed(study) / "smoothed" / "notes.txt"
    notes.write_text("of somebody")
    said = call("all", study)
    assert "which an earlier version made" in said
    assert "is ignored" not in said
    assert notes.read_text() == "of somebody"
    notes.unlink()
    notes.parent.rmdir()
    for folder, before in zip((processed(study), reports(study)), clean, strict=True):
        now = contents(folder)
        assert sorted(now) == sorted(before)
        assert [name for name in now if now[name] != before[name]] == []


def test_every_output_of_a_run_is_one_that_may_be_removed(finished):  # noqa: F811
    ledger = Ledger(Folders(finished, processed(finished), reports(finished)))
    names = [name for entry in ledger.entries() for name in entry.outputs]
    assert len(names) > 50
    assert all(map(OUTPUT.fullmatch, names))
