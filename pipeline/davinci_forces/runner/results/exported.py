"""What of a study may leave for an arm."""

from dataclasses import replace

from davinci_forces import __version__
from davinci_forces.errors import BadRequest
from davinci_forces.exports.identified import Export, ExportOrigin, export_of
from davinci_forces.files import read_bytes
from davinci_forces.records import KINDS
from davinci_forces.report.results import MANIFEST, identity
from davinci_forces.runner import reporting
from davinci_forces.runner.ledger import Folders, Ledger
from davinci_forces.runner.plan import Plan
from davinci_forces.runner.results import campaign
from davinci_forces.study import reading
from davinci_forces.study.review import STUDY


def permitted_export(folders: Folders, joints: list[str], despite_verdict: bool) -> Export:
    """Return the export of joints; raises BadRequest if a verdict or a reviewer forbids it, or a joint has no model."""
    study, ledger = reading.read(folders.raw), Ledger(folders)
    catalogue = reporting.catalogue(ledger, Plan(study, ledger).places().find(tuple(KINDS.values())))
    verdicts = {j["joint"]: j["verdict"] for j in campaign.read_summary(folders.reports / "summary.json")["joints"]}
    origin = ExportOrigin(__version__, identity(read_bytes(folders.reports / MANIFEST)), verdicts)
    export = export_of(study, catalogue, origin, joints)
    reasons = [f"joint {j.name} has the verdict Problem" for j in export.joints if verdicts.get(j.name) == "bad"]
    used = {STUDY: {""}, "run": {log for fit, _ in export.fits.values() for log in fit.logs}}
    for r in reporting.ratings(study):
        if r.verdict == "reject" and r.name in used.get(r.subject, ()):
            reasons.append(f"{' '.join([r.subject, r.name]).strip()} is rejected by {r.reviewer or 'a reviewer'}")
    if reasons and not despite_verdict:
        raise BadRequest(f"{folders.raw}: {'; '.join(reasons)}; --despite-verdict exports it, and every file says so")
    return replace(export, origin=origin._replace(despite=tuple(reasons)))
