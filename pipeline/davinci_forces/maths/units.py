"""Units of the quantities in logs, and their size in SI."""

import math

# name -> (what it measures, its size in SI)
UNITS: dict[str, tuple[str, float]] = {
    "rad": ("angle", 1.0),
    "deg": ("angle", math.pi / 180),
    "rev": ("angle", 2 * math.pi),
    "m": ("length", 1.0),
    "mm": ("length", 1e-3),
    "um": ("length", 1e-6),
    "s": ("time", 1.0),
    "ms": ("time", 1e-3),
    "A": ("current", 1.0),
    "mA": ("current", 1e-3),
    "N": ("force", 1.0),
    "mN": ("force", 1e-3),
    "N m": ("torque", 1.0),
    "mN m": ("torque", 1e-3),
}
UNITS |= {f"{u}/s": (f"{kind} rate", size) for u, (kind, size) in UNITS.items() if kind in ("angle", "length")}
UNITS["rpm"] = ("angle rate", 2 * math.pi / 60)

# the default units, where neither the study nor the log states one
SI = {
    "angle": "rad", "length": "m", "angle rate": "rad/s", "length rate": "m/s", "time": "s", "current": "A",
    "force": "N", "torque": "N m", "count": "",
}  # fmt: skip

SPELLINGS = {
    "°": "deg", "degree": "deg", "degrees": "deg", "radian": "rad", "radians": "rad", "µm": "um", "μm": "um",
    "Nm": "N m", "N*m": "N m", "N.m": "N m", "N·m": "N m", "N-m": "N m", "mNm": "mN m", "sec": "s",
    "second": "s", "seconds": "s", "Seconds": "s", "Amperes": "A", "Amps": "A", "meter": "m", "meters": "m",
    "Newtons": "N", "Newton": "N", "1/min": "rpm", "rev/min": "rpm", "°/s": "deg/s",
}  # fmt: skip


def canonical(unit: str) -> str:
    """The listed spelling of a unit, or the unit as it stands."""
    return SPELLINGS.get(unit.strip(), unit.strip())


def measures(unit: str) -> str | None:
    """The kind of quantity of a unit, or None for a unit that is not listed."""
    return UNITS.get(canonical(unit), (None, 0.0))[0]


def size(unit: str) -> float:
    """The size of a unit in SI."""
    return UNITS[canonical(unit)][1]
