"""Every symbol that the pipeline stores or plots, once: what it means and what it is measured in.

A revolute joint turns in rad and pushes in N m; a prismatic one slides in m and pushes in N.  Units are
therefore written with {position} and {effort}, and a joint fills them in.
"""

from davinci_forces.records.quantities.arm import ARM
from davinci_forces.records.quantities.forces import FORCES
from davinci_forces.records.quantities.models import MODELS, PER_ROW, Quantity

__all__ = ["PER_ROW", "QUANTITIES", "Quantity"]

QUANTITIES = MODELS | FORCES | ARM
