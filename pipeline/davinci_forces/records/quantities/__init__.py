"""All symbols that the pipeline stores or plots: the meaning and the unit of each.

A revolute joint has positions in rad and efforts in N m; a prismatic joint has positions in m and efforts in N.
Units are therefore written with {position} and {effort}, which each joint replaces by its own.
"""

from davinci_forces.records.quantities.arm import ARM
from davinci_forces.records.quantities.forces import FORCES
from davinci_forces.records.quantities.models import MODELS, PER_ROW, Quantity

__all__ = ["PER_ROW", "QUANTITIES", "Quantity"]

MEASURED = MODELS | FORCES | ARM
STANDARD_ERRORS = (  # of these symbols, whose names end in _std
    "sigma_q", "sigma_dq", "sigma_tau", "relative_noise", "acf1", "skewness", "kurtosis", "nis_own", "k_t_response",
    "k_t_simulated", "k_t_settles", "k_t_best", "rmse", "nrmse", "r2", "fit_percent", "r2_ceiling", "effort_rms",
    "relative_error", "relative_error_1111", "mse", "training", "over_periods", "tau_ext_rms", "nis_mean",
    "joint_offset", "left_rms", "free_error", "stiffness_q1", "stiffness_q3", "onset", "force_error_max", "k_t_loading",
    "k_t_unloading", "lost", "lost_share", "tangent", "damping", "exponent", "day_offset", "model_part", "free_rms",
    "free_level", "detection_level", "coverage", "quartile_coverage", "release", "duration", "peak", "mean", "impulse",
    "mass_mirrored", "mass_scale", "tare_mass", "mass_alone", "mirrored_alone", "free_mass", "force_rms", "force_level",
    "force_detection", "force_coverage", "model_force", "total_force", "sigma_1", "sigma_2", "sigma_3", "force_error",
    "force_bias", "force_relative_error", "sensor_lag", "sensor_coverage", "band_rms", "onset_depth", "error",
    "filter_lag", "filter_share", "period", "score", "model_error", "mean_error", "torque_constant",
)  # fmt: skip
QUANTITIES = MEASURED | {
    f"{name}_std": Quantity(f"standard error: {MEASURED[name].meaning}", MEASURED[name].unit)
    for name in STANDARD_ERRORS
}
