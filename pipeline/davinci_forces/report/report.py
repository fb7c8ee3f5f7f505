"""Write the report of a study and the description of its robot (.html, .pdf), its numbers, and its answer in short."""

import hashlib
import json
import re
from collections.abc import Mapping
from dataclasses import replace
from importlib import import_module
from typing import Any

from davinci_forces.files import table
from davinci_forces.records import Contact, LogSummary, Stiffness
from davinci_forces.records.catalogue import Catalogue, Provenance
from davinci_forces.report.changes import StatedValue
from davinci_forces.report.content import Document, Rated, Section, name_of, walk
from davinci_forces.report.content.inline import parse
from davinci_forces.report.context import Context
from davinci_forces.report.results import MANIFEST, collect, identity, manifest
from davinci_forces.report.sections import DOCUMENTS
from davinci_forces.report.sections.methods import bibliography
from davinci_forces.report.sections.parts import trust
from davinci_forces.report.sections.summary import fitted_joints, peaks_in_words, trust_row
from davinci_forces.report.sections.summary.caveats import first_looks_in_order
from davinci_forces.report.sections.summary.opening import feedback, forces_at_tip, masses
from davinci_forces.report.sections.tissue import verdict
from davinci_forces.report.writers import render_all
from davinci_forces.study import Study
from davinci_forces.study.review import Rating

LEGEND = (
    "new path: share of the run's motion that is unlike any fitted path; ceiling: R2 of an exact model; "
    "coverage: of the 95 % band"
)
HEADER = (
    "joint", "verdict", "new path", "model error", "error / effort", "R2", "ceiling", "detection level",
    "alarm level", "coverage",
)  # fmt: skip


def write_report(
    catalogue: Catalogue,
    study: Study,
    provenance: Provenance,
    baseline: Mapping[str, StatedValue] | None = None,
    ratings: tuple[Rating, ...] = (),
) -> dict[str, bytes]:
    """The files of the report, by name; what is shown and results.json come from the same numbers."""
    context = Context(catalogue, study, collect(catalogue), provenance, ratings, baseline=baseline)
    built = {name: (title, parts) for name, (title, names) in DOCUMENTS.items() if (parts := sections(context, names))}
    answers = {"summary.txt": answer(context).encode(), "summary.json": digest(context)}
    numbers = {"results.json": context.results.json(), **answers}
    listed = manifest(provenance, numbers)
    report_id, results = identity(listed), hashlib.sha256(numbers["results.json"]).hexdigest()
    edition = f"report ID {report_id} · davinci-forces {provenance.version}, code {provenance.code}{dates(catalogue)}"
    rated = Rated(results, report_id, tuple(log.name for log in study.logs), ratings)
    documents = []
    for name, (title, parts) in built.items():
        others = [(heading, f"{other}.html") for other, (heading, _) in built.items() if other != name]
        links, asked = (*others, ("Numbers", "results.json")), rated if name == "report" else None
        documents.append(Document(title, study.title, study.simulated, parts, edition, name, links, rated=asked))
    return render_all(tuple(documents)) | numbers | {MANIFEST: listed, "references.bib": bibliography().encode()}


def dates(catalogue: Catalogue) -> str:
    """The dates of the data, as the logs give them; "" if none does."""
    days = sorted(summary.started[:10] for summary in catalogue.records(LogSummary) if summary.started)
    return f" · data of {' to '.join(dict.fromkeys((days[0], days[-1])))}" if days else ""


def sections(context: Context, names: tuple[str, ...]) -> tuple[Section, ...]:
    """The sections of a document that the study has something to say on."""
    built: list[Section] = []
    for name in names:
        labels = {label for section in built for block in walk(section) if (label := name_of(block))}
        module = import_module(f"davinci_forces.report.sections.{name}")
        if section := module.section(replace(context, labels=frozenset(labels))):
            built.append(section)
    return tuple(built)


def answer(context: Context) -> str:
    """The table of verdicts, the three things to look at first, and what was measured, in plain text."""
    trusts = [trust(context, joint) for joint in fitted_joints(context)]
    stiffness = context.catalogue.records(Stiffness)
    measured = [plain(text) for text in (*forces_at_tip(context), *masses(context))]
    measured += [f"tissue {plain(verdict(context, log).text)}" for log in stiffness]
    measured += map(plain, feedback(context))
    if not trusts:
        message = "no joint could be identified: there is no usable identification log, so no effort was tracked"
        return "\n".join([message, *measured]) + "\n"
    rows = [[plain(str(cell)) for cell in trust_row(context, trusted, False)] for trusted in trusts]
    peaks = peaks_in_words(context, context.catalogue.records(Contact)).strip()
    looks = [f"{i}. {plain(text)}" for i, text in enumerate(first_looks_in_order(context, trusts), 1)]
    if looks:
        looks = ["look at these first:", *looks]
    lines = [*table([HEADER, *rows]), LEGEND, *looks, *[plain(peaks)] * bool(peaks), *measured]
    return "\n".join(lines) + "\n"


def plain(text: str) -> str:
    """Remove the marks and references of a marked text."""
    spans = (span.text for span in parse(re.sub(r" See \[@[^]]*\]\.", "", text)) if span.kind != "reference")
    return "".join(spans)


def digest(context: Context) -> bytes:
    """The content of summary.json; each value is a key of results.json, or null if there is no such number."""
    study, summaries = context.study, context.catalogue.records(LogSummary)
    started = min((summary.started for summary in summaries if summary.started), default="")
    about = {"title": study.title, "robot": study.robot.name, "simulated": study.simulated, "started": started}
    content = about | {"joints": [_joint(context, joint) for joint in fitted_joints(context)]}
    return (json.dumps(content, indent=1, ensure_ascii=False) + "\n").encode()


def _joint(context: Context, joint: str) -> dict[str, Any]:
    """The verdict on one joint as on page one, and the keys of its numbers."""
    trusted = trust(context, joint)
    sources = {"model_error": trusted.prediction, "detection_level": trusted.space, "coverage": trusted.space}
    keys = {name: f"{source.prefix}.{name}" for name, source in sources.items() if source is not None}
    result_keys = {name: keys[name] if keys.get(name) in context.results else None for name in sources}
    return {"joint": joint, "verdict": trusted.level, "same_path": trusted.same_path, **result_keys}
