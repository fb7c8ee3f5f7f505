"""All symbols that the pipeline stores or plots: the meaning and the unit of each.

A revolute joint has positions in rad and efforts in N m; a prismatic joint has positions in m and efforts in N.
Units are therefore written with {position} and {effort}, which each joint replaces by its own.
"""

from davinci_forces.records.quantities.arm import ARM
from davinci_forces.records.quantities.forces import FORCES
from davinci_forces.records.quantities.models import MODELS, PER_ROW, Quantity

__all__ = ["PER_ROW", "QUANTITIES", "Quantity"]

QUANTITIES = MODELS | FORCES | ARM
