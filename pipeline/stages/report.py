"""Write the report of a study: report.html, report.pdf and results.json."""

from pipeline.records.catalogue import Catalogue, Provenance
from pipeline.report.content import Document
from pipeline.report.context import Context
from pipeline.report.results import collect
from pipeline.report.sections import SECTIONS, section_builder
from pipeline.report.writers import WRITERS, renderer
from pipeline.study import Study


def run(catalogue: Catalogue, study: Study, provenance: Provenance) -> dict[str, bytes]:
    """The files of the report, by name; what is shown and results.json come from the same numbers."""
    context = Context(catalogue, study, collect(catalogue), provenance)
    sections = (section_builder(name)(context) for name in SECTIONS)
    document = Document(
        title="Contact forces without a force sensor",
        study=study.title,
        simulated=study.simulated,
        sections=tuple(section for section in sections if section is not None),
    )
    return {file: renderer(file)(document) for file in WRITERS} | {"results.json": context.results.json()}
