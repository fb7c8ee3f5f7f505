"""Numbers of a study file, and between which bounds they make sense."""

from davinci_forces.toml import TomlTable, shown

# The least and the greatest value, and the unit: beyond these a slip of the pen or of the unit is the likelier reason.
PLAUSIBLE = {
    "period": (1e-6, 1e6, "s"),
    "rate": (1e-3, 1e7, "Hz"),
    "skip": (0.0, 1e6, "s"),
    "until": (1e-3, 1e6, "s"),
    "lowpass": (1e-6, 1e5, "Hz"),
    "harmonics": (0, 100, ""),
    "effort": (1e-9, 1e6, "N m or N"),
    "tool": (1e-3, 10.0, "m"),
    "q_tau": (0.0, 1e6, "effort/s^0.5"),
}


def optional(table: TomlTable, key: str) -> float | None:
    """A number that may be missing."""
    return checked(table, key, table.number(key)) if key in table else None


def checked(table: TomlTable, key: str, value: float, kind: str = "") -> float:
    """A number as it is, noted where it is not plausible; `kind` says as what, where the key is a name."""
    least, most, unit = PLAUSIBLE[kind or key]
    if value < 0 or (value == 0 and least > 0):
        table.problem(f"{key} must be positive, not {shown(value)}", key)
    elif value < least or value > most:
        table.problem(f"{key} must lie between {least:g} and {most:g} {unit}".rstrip() + f", not {shown(value)}", key)
    return value
