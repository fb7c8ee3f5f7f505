"""What the tests of the report may ask for."""

import pytest
from report_documents import document

from davinci_forces.report.content import Document


@pytest.fixture(scope="session")
def full() -> Document:
    """The document, once: its figures are drawn once as well."""
    return document()
