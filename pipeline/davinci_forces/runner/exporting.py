"""Export the model of a study: run what it needs, check that it may leave, and write its files together."""

from collections.abc import Sequence
from pathlib import Path

from davinci_forces.errors import BadRequest
from davinci_forces.exports import FORMATS, renderer
from davinci_forces.exports.identified import Export, ExportOrigin, export_of
from davinci_forces.files import read_bytes, write_folder
from davinci_forces.records import KINDS
from davinci_forces.report.results import MANIFEST, identity
from davinci_forces.runner import ALL, reporting, runs
from davinci_forces.runner.ledger import Folders, Ledger
from davinci_forces.runner.plan import VERSION, Plan
from davinci_forces.runner.results.campaign import read_summary
from davinci_forces.study import Study, reading
from davinci_forces.study.review import STUDY


def export(
    folders: Folders, form: str, out: Path, joints: Sequence[str], replaces: bool, despite_verdict: bool
) -> list[Path]:
    """Export a study in a format to a folder, after a run of all that is not up to date; return the files.

    Raises
    ------
    BadRequest
        If there is no such format, the folder may not be written, a task fails, or a verdict forbids the export.
    """
    if form not in FORMATS:
        raise BadRequest(f"there is no format {form!r}; there are {', '.join(FORMATS)}")
    check_folder(folders, out, replaces)
    if not runs.run(folders.raw, ALL, folders.processed.parent, folders.reports.parent):
        raise BadRequest(f"{folders.raw}: a task failed, so nothing is exported; correct its log, or leave it out")
    study, ledger = reading.read(folders.raw), Ledger(folders)
    catalogue = reporting.catalogue(ledger, Plan(study, ledger).places().find(tuple(KINDS.values())))
    verdicts = {j["joint"]: j["verdict"] for j in read_summary(folders.reports / "summary.json")["joints"]}
    origin = ExportOrigin(VERSION, identity(read_bytes(folders.reports / MANIFEST)), verdicts)
    model = export_of(study, catalogue, origin, joints)
    reasons = objections(study, model)
    if reasons and not despite_verdict:
        raise BadRequest(f"{folders.raw}: {'; '.join(reasons)}; --despite-verdict exports it, and every file says so")
    model = export_of(study, catalogue, origin._replace(despite=reasons), joints)
    files = {name: text.encode() for name, text in renderer(form)(model).items()}
    write_folder(out, files, replaces)
    return [out / name for name in files]


def check_folder(folders: Folders, out: Path, replaces: bool) -> None:
    """Check that a folder may hold an export: not below results, and nothing is replaced by mistake."""
    place = out.resolve()
    for results in (folders.processed, folders.reports):
        if place.is_relative_to(results.parent.resolve()):
            raise BadRequest(f"{out} is below {results.parent}, which holds results only; choose another folder")
    if out.exists() and not replaces:
        raise BadRequest(f"{out} exists; --replace replaces it, or --out names another folder")


def objections(study: Study, model: Export) -> tuple[str, ...]:
    """Why a model should not leave: verdicts of page one on its joints, and rejections by reviewers."""
    bad = [
        f"joint {j.name} has the verdict Problem" for j in model.joints if model.origin.verdicts.get(j.name) == "bad"
    ]
    used = {STUDY: {""}, "run": {log for fit, _ in model.fits.values() for log in fit.logs}}
    rejected = [
        f"{' '.join([r.subject, r.name]).strip()} is rejected by {r.reviewer or 'a reviewer'}"
        for r in reporting.ratings(study)
        if r.verdict == "reject" and r.name in used.get(r.subject, ())
    ]
    return (*bad, *rejected)
