"""All records of a study, for stages that read every kind."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cache

from davinci_forces.records.record import AnyRecord, Record


@dataclass(frozen=True)
class Provenance:
    """The origin of a study's results: versions, and every file with its hash."""

    name: str  # of the study
    version: str
    packages: dict[str, str]
    raw: dict[str, str]
    processed: dict[str, str]
    failures: dict[str, str]
    study: str = ""  # text of the study file
    code: str = ""  # fingerprint of the package's code


class Catalogue:
    """The records of a study by kind, each kind read at its first use."""

    def __init__(self, read: Callable[[type[Record]], Sequence[Record]]) -> None:
        self._read = cache(read)

    def records(self, kind: type[AnyRecord]) -> list[AnyRecord]:
        """Return all records of a kind, in the order of the study's logs and the robot's joints."""
        return list(self._read(kind))  # type: ignore[arg-type]

    def select(self, kind: type[AnyRecord], **scalars: str) -> list[AnyRecord]:
        """Return the records of a kind whose scalars have these values."""
        return [r for r in self.records(kind) if all(getattr(r, k) == v for k, v in scalars.items())]
