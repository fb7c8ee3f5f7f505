"""Records of tissue that was pushed into."""

from collections.abc import Iterator
from dataclasses import dataclass

from davinci_forces.records.record import Column, Counts, Labels, Published, Record, slug

EACH = 20  # pushes of a log, up to which every one of them is in results.json


@dataclass(frozen=True, eq=False)
class Push(Record):
    """One push into tissue: force against depth, the straight line through its contact, and where that begins."""

    KEY = ("log", "push")
    UNKNOWN = ("t", "x", "y", "z", "fitted")

    log: str
    push: int
    contact: str  # "found", "stated", "all", or "contact from the first sample"
    k_t: float
    k_t_std: float
    k_t_std_model: float
    intercept: float
    r2: float
    onset_depth: float
    onset_depth_std: float
    release_depth: float
    t: Column
    depth: Column
    force: Column
    fitted: Column  # by the model that was chosen; NaN where nothing is touched
    x: Column
    y: Column
    z: Column
    inside: Counts
    loading: Counts


@dataclass(frozen=True, eq=False)
class Stiffness(Record):
    """How stiff the tissue of one log is: the pushes, one a row, and their median."""

    KEY = ("log",)
    ROWS = "push"
    UNKNOWN = (
        "k_t_std", "onset_depth", "onset_depth_std", "onset", "k_t_loading", "k_t_unloading", "lost", "lost_share",
        "x", "y", "z",
    )  # fmt: skip

    log: str
    source: str  # what the force was measured by
    swings: int  # pushes that were looked at
    stiffness: float
    stiffness_std: float
    stiffness_std_model: float
    stiffness_q1: float
    stiffness_q3: float
    pushes: int
    push: Counts
    counted: Counts
    k_t: Column
    k_t_std: Column
    r2: Column
    onset_depth: Column
    onset_depth_std: Column
    onset: Column
    k_t_loading: Column
    k_t_unloading: Column
    lost: Column
    lost_share: Column
    x: Column
    y: Column
    z: Column

    def published(self) -> Iterator[Published]:
        """The median over the pushes that count, its quartiles, how many they are; and each push where they are few."""
        prefix = f"tissue.{self.log}"
        yield Published(f"{prefix}.stiffness", "stiffness", std="stiffness_std")
        yield from self.publish(prefix, "stiffness_q1", "stiffness_q3", "pushes")
        for i in range(len(self) if len(self) <= EACH else 0):
            own = f"{prefix}.{self.push[i]}"
            yield Published(f"{own}.k_t", "k_t", std="k_t_std", row=i)
            yield Published(f"{own}.onset_depth", "onset_depth", std="onset_depth_std", row=i)
            for name in ("r2", "k_t_loading", "k_t_unloading", "lost", "lost_share", "onset"):
                yield Published(f"{own}.{name}", name, row=i)


@dataclass(frozen=True, eq=False)
class TissueModel(Record):
    """Which model of tissue predicts the pushes of one log best that it has not seen."""

    KEY = ("log",)
    ROWS = "law"

    log: str
    chosen: str
    why: str
    middle: float
    law: Labels
    error: Column
    error_std: Column
    tangent: Column
    damping: Column
    exponent: Column

    def published(self) -> Iterator[Published]:
        """What each model comes to."""
        for i, name in enumerate(self.law):
            prefix = f"tissue.{self.log}.{slug(str(name))}"
            yield Published(f"{prefix}.error", "error", std="error_std", row=i)
            for field in ("tangent", "damping", "exponent"):
                yield Published(f"{prefix}.{field}", field, row=i)
