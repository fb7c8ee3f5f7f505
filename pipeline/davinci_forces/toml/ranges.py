"""Likely sizes of the numbers in TOML files: wide enough for micro-robots and for excavators.

Beyond them, a typing error or a wrong unit is more likely, and results computed from them overflow.
"""

# Smallest and largest size other than 0, and the unit, by kind.  A trace may be rounding next to 0.
KINDS = {
    "number": (1e-30, 1e30, ""), "trace": (1e-100, 1e30, ""), "count": (1, 1e6, ""), "seed": (1, 1e40, ""),
    "harmonics": (0, 100, ""), "period": (1e-6, 1e6, "s"), "until": (1e-3, 1e6, "s"), "time": (1e-9, 1e6, "s"),
    "rate": (1e-3, 1e7, "Hz"), "lowpass": (1e-6, 1e5, "Hz"), "tool": (1e-3, 10, "m"), "length": (1e-100, 1e4, "m"),
    "step": (1e-15, 1e4, "m, rad or A"), "motion": (1e-100, 1e9, "rad or m, and their rates"),
    "mass": (1e-15, 1e9, "kg"), "inertia": (1e-100, 1e12, "kg m^2 or kg"), "stiffness": (1e-9, 1e15, "N/m"),
    "damping": (1e-15, 1e15, "N s/m"), "effort": (1e-9, 1e6, "N m or N"), "force": (1e-15, 1e12, "N or N m"),
    "q_tau": (1e-15, 1e6, "effort/s^0.5"), "delay": (1e-3, 10, "s"), "gear_ratio": (1e-6, 1e9, "or rad/m"),
    "torque_constant": (1e-9, 1e6, "N m/A"), "resistance": (1e-9, 1e9, "ohm"), "inductance": (1e-12, 1e6, "H"),
    "current_limit": (1e-9, 1e6, "A"), "voltage_limit": (1e-9, 1e6, "V"), "gain": (1e-12, 1e12, ""),
}  # fmt: skip
KEYS = {
    "time": "skip start end duration lead lag correlation tick position_delay force_delay velocity_filter contact free",
    "length": "d reach surface centre position stops", "step": "encoder_step current_step position_step",
    "motion": "q dq ddq alpha a theta held path plan b a0 stribeck_velocity xyz rpy lower upper velocity",
    "trace": "offset", "mass": "value",
    "force": "strongest tau drift noise peak coulomb static gravity",
    "damping": "viscous bristle_damping", "stiffness": "bristle_stiffness",
    "inertia": "rotor_inertia ixx ixy ixz iyy iyz izz",
    "gain": "motion_scale force_scale friction proportional derivative integral position_p position_i velocity_p "
    "velocity_i current_p current_i multiplier",
    "count": "columns",
}  # fmt: skip
KIND_OF = {key: kind for kind, keys in KEYS.items() for key in keys.split()}


def unlikely(key: str, value: float, kind: str = "") -> str:
    """The problem of the size of a number, "" if it is likely; `kind` is the quantity if the key does not name it."""
    least, most, unit = KINDS[kind or KIND_OF.get(key, key if key in KINDS else "number")]
    if not value or least <= abs(value) <= most:
        return ""
    return f"{key} must lie between {least:g} and {most:g} {unit}".rstrip() + (" in size" if value < 0 else "")
