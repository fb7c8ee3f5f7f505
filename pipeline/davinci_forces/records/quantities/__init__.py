"""All symbols that the pipeline stores or plots: the meaning and the unit of each.

A revolute joint has positions in rad and efforts in N m; a prismatic joint has positions in m and efforts in N.
Units are therefore written with {position} and {effort}, which each joint replaces by its own.
"""

from dataclasses import fields

from davinci_forces.records import KINDS
from davinci_forces.records.quantities.arm import ARM
from davinci_forces.records.quantities.forces import FORCES
from davinci_forces.records.quantities.models import MODELS, PER_ROW, Quantity

__all__ = ["PER_ROW", "QUANTITIES", "Quantity"]

MEASURED = MODELS | FORCES | ARM
FIELDS = dict.fromkeys(field.name for kind in KINDS.values() for field in fields(kind))  # type: ignore[arg-type]
QUANTITIES = MEASURED | {  # with the standard errors that records have
    name: Quantity(f"standard error: {MEASURED[measured].meaning}", MEASURED[measured].unit)
    for name in FIELDS
    if name not in MEASURED and (measured := name.removesuffix("_std")) in MEASURED
}
