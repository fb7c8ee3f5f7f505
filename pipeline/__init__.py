"""Contact forces of a da Vinci arm from its motor currents, offline: from raw logs to reports."""

from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    import pandas as pd

__all__ = ["read"]


def read(study: str | Path, record: str, **about: str) -> "pd.DataFrame":
    """The records of one kind of an analysed study as one DataFrame: `read("raw/mine", "Track", joint="hand_roll")`.

    The scalars that tell records apart (log, joint, ...) are columns of their own.  `attrs["units"]` gives the unit of
    each column; where it differs between joints, a dict by joint.  Keyword arguments keep records whose scalars have
    these values.

    Raises
    ------
    BadRequest
        If there is no such kind of record.
    MissingRecord
        If the study has none: run its stages first.
    """
    from pipeline.runner.dataframes import read as read_frames

    return read_frames(Path(study), record, about)
