"""Records of what a stage wants the reviewer to know."""

from dataclasses import dataclass

import numpy as np

from davinci_forces.records.record import Labels, Record


@dataclass(frozen=True, eq=False)
class Diagnostic(Record):
    """What a stage wants the reviewer to know: something left out, assumed, or wrong."""

    KEY = ("stage", "subject")

    stage: str
    subject: str
    severity: Labels
    text: Labels


def diagnostic(stage: str, subject: str, severity: str, *texts: str) -> Diagnostic:
    """A diagnostic of one or more lines of one severity."""
    return Diagnostic(stage, subject, np.array([severity] * len(texts), object), np.array(texts, object))
