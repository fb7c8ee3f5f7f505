"""Write the report of a study and the description of its robot (.html, .pdf), results.json and a short summary.txt."""

import hashlib
from collections.abc import Mapping
from dataclasses import replace

from davinci_forces.records import LogSummary
from davinci_forces.records.catalogue import Catalogue, Provenance
from davinci_forces.report.answer import answer, digest
from davinci_forces.report.changes import StatedValue
from davinci_forces.report.content import Document, Rated, Section, name_of, walk
from davinci_forces.report.context import Context
from davinci_forces.report.results import MANIFEST, collect, identity, manifest
from davinci_forces.report.sections import DOCUMENTS, section_builder
from davinci_forces.report.sections.methods import bibliography
from davinci_forces.report.writers import render_all
from davinci_forces.study import Study
from davinci_forces.study.review import Rating


def write_report(
    catalogue: Catalogue,
    study: Study,
    provenance: Provenance,
    baseline: Mapping[str, StatedValue] | None = None,
    ratings: tuple[Rating, ...] = (),
) -> dict[str, bytes]:
    """The files of the report, by name; what is shown and results.json come from the same numbers."""
    context = Context(catalogue, study, collect(catalogue), provenance, ratings, baseline=baseline)
    built = {name: (title, sections(context, names)) for name, (title, names) in DOCUMENTS.items()}
    numbers = {"results.json": context.results.json(), "summary.txt": answer(context).encode()}
    numbers["summary.json"] = digest(context)
    listed = manifest(provenance, numbers)
    report_id, results = identity(listed), hashlib.sha256(numbers["results.json"]).hexdigest()
    edition = f"report ID {report_id} · davinci-forces {provenance.version}, code {provenance.code}{dates(catalogue)}"
    rated = Rated(results, report_id, tuple(log.name for log in study.logs), ratings)
    documents = []
    for name, (title, content) in built.items():
        others = [(heading, f"{other}.html") for other, (heading, parts) in built.items() if parts and other != name]
        links = (*others, ("Numbers", "results.json"))
        asked = rated if name == "report" else None
        if content:
            documents.append(Document(title, study.title, study.simulated, content, edition, name, links, rated=asked))
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
        section = section_builder(name)(replace(context, labels=frozenset(labels)))
        built += [section] if section is not None else []
    return tuple(built)
