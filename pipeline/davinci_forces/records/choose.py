"""Records of which model was chosen, and from among what."""

from collections.abc import Iterator
from dataclasses import dataclass

from davinci_forces.records.record import Column, Counts, Labels, Names, Published, Record, slug


@dataclass(frozen=True, eq=False)
class Choice(Record):
    """The model that describes a joint, or the arm, as cross-validation chose it from candidates."""

    KEY = ("group",)
    UNKNOWN = ("over_periods",)
    ROWS = "candidate"

    group: str
    model: str
    friction: str
    estimator: str
    chosen: str  # the candidate, by name
    best: str  # the one of the least score
    why: str
    logs: Names
    candidate: Labels
    variant: Labels
    parameters: Counts
    physical: Counts
    score: Column
    score_std: Column
    training: Column
    over_periods: Column

    def published(self) -> Iterator[Published]:
        """The scores of every candidate."""
        for i, candidate in enumerate(self.candidate):
            prefix = f"choice.{self.group}.{slug(candidate)}"
            yield Published(f"{prefix}.score", "score", std="score_std", row=i)
            for name in ("training", "over_periods", "parameters"):
                yield Published(f"{prefix}.{name}", name, row=i)
