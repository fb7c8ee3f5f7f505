"""All symbols that the pipeline stores or plots: the meaning and the unit of each, from `quantities.csv`.

A revolute joint has positions in rad and efforts in N m; a prismatic joint has positions in m and efforts in N.
Units are therefore written with {position} and {effort}, which each joint replaces by its own; {torque_constant} is in
N/A of a prismatic joint without a gear.  The unit of a pure number is 1, and that of a text is empty.
"""

import csv
from dataclasses import fields
from pathlib import Path
from typing import NamedTuple

from davinci_forces.records import KINDS

PER_ROW = "see unit"  # unit of a quantity whose rows have their units in the column `unit`


class Quantity(NamedTuple):
    """The meaning of a symbol, for labels and schemas, and its unit."""

    meaning: str
    unit: str


TABLE = Path(__file__).with_suffix(".csv").read_text(encoding="utf-8").splitlines()
MEASURED = {row["symbol"]: Quantity(row["meaning"], row["unit"]) for row in csv.DictReader(TABLE)}
FIELDS = dict.fromkeys(field.name for kind in KINDS.values() for field in fields(kind))  # type: ignore[arg-type]
QUANTITIES = MEASURED | {  # with the standard errors that records have
    name: Quantity(f"standard error: {MEASURED[measured].meaning}", MEASURED[measured].unit)
    for name in FIELDS
    if name not in MEASURED and (measured := name.removesuffix("_std")) in MEASURED
}
