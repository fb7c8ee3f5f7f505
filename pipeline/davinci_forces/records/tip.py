"""Records of the force at the tip, and of a force sensor that measures the same force."""

from davinci_forces.records.record import Column, Counts, Labels, LogRecord, RobotRecord


class JointCorrelation(LogRecord):
    """The correlation of the external efforts of the joints that carry the tip, in one log of free motion."""

    tested: int
    rho_12: float
    rho_13: float
    rho_23: float


class ArmCorrelation(RobotRecord):
    """The correlation of the external efforts of the joints that carry the tip, in free space, of at most 20 logs."""

    source: Labels  # the log of the row; the correlation for a log uses the rows of the others
    rho_12: Column
    rho_13: Column
    rho_23: Column


class TipForce(LogRecord):
    """The force that the tip exerts on its environment during one log, in base axes, with its covariance."""

    UNKNOWN = ("f_x", "f_y", "f_z", "c_xx", "c_yy", "c_zz", "c_xy", "c_xz", "c_yz")
    PUBLISHED = (
        "tip.{log}: free_rms=force_rms± free_level=force_level± detection_level=force_detection± "
        "coverage=force_coverage± condition=median_condition near_singular=near_share",
    )

    role: str
    filter: str
    model: str
    tested: int
    force_rms: float
    force_rms_std: float
    force_level: float
    force_level_std: float
    force_detection: float
    force_detection_std: float
    force_coverage: float
    force_coverage_std: float
    rho_12: float
    rho_13: float
    rho_23: float
    correlation_from: str
    median_condition: float
    near_share: float
    t: Column
    x: Column
    y: Column
    z: Column
    f_x: Column  # without delay, for contact at the tip alone; NaN at singular poses
    f_y: Column
    f_z: Column
    c_xx: Column
    c_yy: Column
    c_zz: Column
    c_xy: Column
    c_xz: Column
    c_yz: Column
    condition: Column
    near_singular: Counts


class TipContact(LogRecord):
    """The force at the tip in each contact of one log, at the time at which it is largest."""

    UNKNOWN = "f_middle", "f_middle_std"
    PUBLISHED = (
        "tip.{log}.{row}: onset release f_x± f_y± f_z± peak=f_peak± middle_mean=f_middle± sigma_1± sigma_2± sigma_3±",
    )

    filter: str
    stated: Counts  # whether the study states the window; these come first, then other contacts of any joint
    onset: Column
    release: Column
    t_peak: Column
    f_x: Column
    f_x_std: Column
    f_y: Column
    f_y_std: Column
    f_z: Column
    f_z_std: Column
    f_peak: Column
    f_peak_std: Column
    f_middle: Column
    f_middle_std: Column
    sigma_1: Column
    sigma_1_std: Column
    sigma_2: Column
    sigma_2_std: Column
    sigma_3: Column
    sigma_3_std: Column
    weak_x: Column
    weak_y: Column
    weak_z: Column
    x: Column
    y: Column
    z: Column
    condition: Column
    near_singular: Counts


class TipBudget(LogRecord):
    """The contribution of each joint's error to the tip force, at the median pose of one log's free space."""

    ROWS = "of_joint"
    PUBLISHED = ("tip.{log}.{name}: filter_part=filter_force model_part=model_force± total=total_force±",)

    of_joint: Labels
    lever: Column
    filter_force: Column
    model_force: Column
    model_force_std: Column
    total_force: Column
    total_force_std: Column


class SensorForce(LogRecord):
    """The estimated force in one log, the force of a sensor, and their difference.

    `axis` is x, y or z of the base, `vector` for all three, `size` if the sensor measures only the magnitude, or the
    prismatic joint along the sensor's axis.  For a vector, the columns are the magnitudes of both forces.
    """

    KEY = ("log", "axis")
    UNKNOWN = ("measured_force", "estimated_force", "estimated_force_std")
    PUBLISHED = (
        "sensor.{log}.{axis}: rmse=force_error± bias=force_bias± relative_error=force_relative_error± "
        "largest=force_error_max± lag=sensor_lag± coverage=sensor_coverage± range=force_range",
    )

    axis: str
    role: str
    tested: int
    force_error: float
    force_error_std: float
    force_bias: float
    force_bias_std: float
    force_error_max: float
    force_error_max_std: float
    force_range: float
    force_relative_error: float
    force_relative_error_std: float
    sensor_lag: float
    sensor_lag_std: float
    sensor_coverage: float
    sensor_coverage_std: float
    t: Column
    measured_force: Column
    estimated_force: Column
    estimated_force_std: Column
