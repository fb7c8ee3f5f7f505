"""Write the report of a study: report.html, report.pdf and results.json."""

import hashlib

from pipeline.records.catalogue import Catalogue, Provenance
from pipeline.report.content import Document
from pipeline.report.context import Context
from pipeline.report.results import collect
from pipeline.report.sections import SECTIONS, section_builder
from pipeline.report.writers import WRITERS, renderer
from pipeline.study import Study


def write(catalogue: Catalogue, study: Study, provenance: Provenance) -> dict[str, bytes]:
    """The files of the report, by name; what is shown and results.json come from the same numbers."""
    context = Context(catalogue, study, collect(catalogue), provenance)
    built = [section_builder(name)(context) for name in SECTIONS]
    sections = tuple(section for section in built if section is not None)
    results = context.results.json()
    document = Document(
        title="Contact forces without a force sensor",
        study=study.title,
        simulated=study.simulated,
        sections=sections,
        edition=f"report ID {identity(provenance, results)} · davinci-forces {provenance.version}",
    )
    return {file: renderer(file)(document) for file in WRITERS} | {"results.json": results}


def identity(provenance: Provenance, results: bytes) -> str:
    """128 bits of the sha256 of all that the report is made from: raw inputs, study file, records, results.json."""
    files = {**provenance.raw, **provenance.processed, "results.json": hashlib.sha256(results).hexdigest()}
    manifest = "\n".join(f"{sha} {name}" for name, sha in sorted(files.items()))
    return hashlib.sha256(manifest.encode()).hexdigest()[:32]
