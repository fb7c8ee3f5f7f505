"""Write the reports of a study: report and robot, each as HTML and PDF, results.json, and the answer as text."""

from collections.abc import Mapping

from pipeline.records.catalogue import Catalogue, Provenance
from pipeline.report.changes import Stated
from pipeline.report.content import Document, Section
from pipeline.report.context import Context
from pipeline.report.digest import digest
from pipeline.report.identity import MANIFEST, identity, manifest
from pipeline.report.results import collect
from pipeline.report.sections import DOCUMENTS, section_builder
from pipeline.report.terminal import answer
from pipeline.report.writers import render_all
from pipeline.study import Study


def write(
    catalogue: Catalogue, study: Study, provenance: Provenance, baseline: Mapping[str, Stated] | None = None
) -> dict[str, bytes]:
    """The files of the report, by name; what is shown and results.json come from the same numbers."""
    context = Context(catalogue, study, collect(catalogue), provenance, baseline)
    built = {name: (title, sections(context, names)) for name, (title, names) in DOCUMENTS.items()}
    numbers = {"results.json": context.results.json(), "summary.txt": answer(context).encode()}
    numbers["summary.json"] = digest(context)
    listed = manifest(provenance, numbers)
    edition = f"report ID {identity(listed)} · davinci-forces {provenance.version}"
    documents = tuple(
        Document(title, study.title, study.simulated, content, edition, name, links_beside(name, built))
        for name, (title, content) in built.items()
        if content
    )
    return render_all(documents) | numbers | {MANIFEST: listed}


def links_beside(name: str, built: dict[str, tuple[str, tuple[Section, ...]]]) -> tuple[tuple[str, str], ...]:
    """The other documents of a report, by their titles, and its numbers."""
    others = [(title, f"{other}.html") for other, (title, content) in built.items() if content and other != name]
    return (*others, ("Numbers", "results.json"))


def sections(context: Context, names: tuple[str, ...]) -> tuple[Section, ...]:
    """The sections of a document that the study has something to say on."""
    return tuple(section for name in names if (section := section_builder(name)(context)) is not None)
