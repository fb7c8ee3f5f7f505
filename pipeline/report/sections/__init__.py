"""What a report says, in order: one module per section, exporting `section`, and its name in the list below.

section(context: Context) -> Section | None        None where a study has nothing to say on it
"""

from collections.abc import Callable
from importlib import import_module

from pipeline.report.content import Section
from pipeline.report.context import Context

SECTIONS = (
    "summary", "recorded", "noise", "identification", "prediction", "filter", "ground_truth", "robot", "control",
    "excitation", "methods", "provenance",
)  # fmt: skip


def section_builder(name: str) -> Callable[[Context], Section | None]:
    """The function that builds the section of that name."""
    build: Callable[[Context], Section | None] = import_module(f"pipeline.report.sections.{name}").section
    return build
