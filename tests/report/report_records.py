"""Records with nothing in them but what a test is about."""

from dataclasses import fields
from typing import Any

import numpy as np

from davinci_forces.records import FreeSpace, Prediction, Stiffness, Weight
from davinci_forces.records.catalogue import AnyRecord

NOTHING = np.zeros(0)


def prediction(**scores: Any) -> Prediction:
    """A prediction of a run; its effort has a root mean square of 1."""
    about = {"log": "run", "joint": "roll", "model": "independent", "estimator": "lse", "role": "validation"}
    about |= {"scheme": "validation", "path": "another path"}
    columns = dict.fromkeys(Prediction.columns(), NOTHING)
    values = dict.fromkeys(Prediction.scalars(), 0.0) | {"effort_rms": 1.0} | columns | about
    return Prediction(**(values | scores))  # type: ignore[arg-type]


def free_space(**levels: Any) -> FreeSpace:
    """The free space of a run."""
    names = ("free_rms", "free_level", "detection_level", "coverage")
    about = {"log": "run", "joint": "roll", "filter": "rts", "role": "validation", "tested": 100}
    motion = ("free_max", "crossings", "band_width")
    quartiles = dict.fromkeys(("quartile_coverage", "quartile_coverage_std"), NOTHING)
    values = about | quartiles | dict.fromkeys((*names, *(f"{name}_std" for name in names), *motion), 0.0)
    return FreeSpace(**(values | levels))  # type: ignore[arg-type]


def weight(**scores: Any) -> Weight:
    """The mass of a weight log."""
    about = {"log": "run", "moves_with": "roll", "tare": "", "side": "as stated", "differing": ""}
    return Weight(**(dict.fromkeys(Weight.scalars(), 0.0) | dict.fromkeys(Weight.columns(), NOTHING) | about | scores))


def stiffness(contacts: int, **scores: Any) -> Stiffness:
    """The stiffness of a log with this number of pushes in contact."""
    columns = dict.fromkeys(Stiffness.columns(), np.zeros(contacts))
    about = {"log": "run", "source": "force sensor"}
    return Stiffness(**(dict.fromkeys(Stiffness.scalars(), 0.0) | columns | about | scores))


def record(kind: type[AnyRecord], length: int, **values: Any) -> AnyRecord:
    """A record of any kind: columns of a length, and nothing in them but the values given."""
    declared = {field.name: field.type for field in fields(kind)}  # type: ignore[arg-type]
    empty = {name: "" if declared[name] in ("str", str) else 0.0 for name in kind.scalars()}
    return kind(**(empty | dict.fromkeys(kind.columns(), np.zeros(length)) | values))
