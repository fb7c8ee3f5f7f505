"""The records that flow between stages: a few scalars, and columns of one length; see `record`."""

import numpy as np

from pipeline.records.findings import Fit, Note, Prediction, Residual, Track, Whiteness
from pipeline.records.periods import Average, Noise, Spectrum, Trajectory
from pipeline.records.record import COLUMN_DTYPES, AnyRecord, Column, Counts, Labels, Names, Origin, Record
from pipeline.records.recordings import Intake, Recording, Signal
from pipeline.records.rehearsal import Control, Excitation, Links, Lyapunov, Pose, Workspace

__all__ = [
    "COLUMN_DTYPES",
    "KINDS",
    "AnyRecord",
    "Average",
    "Column",
    "Control",
    "Counts",
    "Excitation",
    "Fit",
    "Intake",
    "Labels",
    "Links",
    "Lyapunov",
    "Names",
    "Noise",
    "Note",
    "Origin",
    "Pose",
    "Prediction",
    "Record",
    "Recording",
    "Residual",
    "Signal",
    "Spectrum",
    "Track",
    "Trajectory",
    "Whiteness",
    "Workspace",
    "note",
]

KINDS: dict[str, type[Record]] = {
    kind.__name__: kind
    for kind in (
        Links, Pose, Workspace, Control, Lyapunov, Excitation, Intake, Recording, Signal, Average, Noise, Trajectory,
        Spectrum, Fit, Residual, Prediction, Track, Whiteness, Note,
    )
}  # fmt: skip


def note(stage: str, subject: str, severity: str, *texts: str) -> Note:
    """A note of one or more lines of one severity."""
    return Note(stage, subject, np.array([severity] * len(texts), object), np.array(texts, object))
