"""Write the report of a study: report.html, report.pdf and results.json."""

from importlib import import_module

from pipeline.catalogue import Catalogue, Provenance
from pipeline.report import html, pdf
from pipeline.report.content import Document
from pipeline.report.context import Context
from pipeline.report.results import collect
from pipeline.report.sections import SECTIONS
from pipeline.study import Study


def run(catalogue: Catalogue, study: Study, provenance: Provenance) -> dict[str, bytes]:
    """The files of the report, by name; what is shown and results.json come from the same numbers."""
    context = Context(catalogue, study, collect(catalogue), provenance)
    found = (import_module(f"pipeline.report.sections.{name}").section(context) for name in SECTIONS)
    document = Document(
        title="Contact forces without a force sensor",
        study=study.title,
        simulated=study.simulated,
        sections=tuple(section for section in found if section is not None),
    )
    return {
        "report.html": html.render(document),
        "report.pdf": pdf.render(document),
        "results.json": context.results.json(),
    }
