"""Records of an estimated force beside that of a force sensor."""

from collections.abc import Iterator
from dataclasses import dataclass

from davinci_forces.records.record import Column, Published, Record


@dataclass(frozen=True, eq=False)
class SensorForce(Record):
    """The force that was estimated in one log beside what a force sensor showed, and how far apart they are.

    `axis` is x, y or z of the base, `vector` for all three together, `size` where the sensor shows only that, or the
    joint that slides along the sensor's axis.  Of a vector the columns are the sizes of both forces.
    """

    KEY = ("log", "axis")
    UNKNOWN = ("measured_force", "estimated_force", "estimated_force_std")

    log: str
    axis: str
    role: str
    tested: int
    force_error: float
    force_error_std: float
    force_bias: float
    force_bias_std: float
    force_error_max: float
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

    def published(self) -> Iterator[Published]:
        """Error, bias, range, lag and coverage."""
        prefix = f"sensor.{self.log}.{self.axis}"
        for key, name in (("rmse", "force_error"), ("bias", "force_bias"), ("relative_error", "force_relative_error"),
                          ("lag", "sensor_lag"), ("coverage", "sensor_coverage")):  # fmt: skip
            yield Published(f"{prefix}.{key}", name, std=f"{name}_std")
        yield Published(f"{prefix}.largest", "force_error_max")
        yield Published(f"{prefix}.range", "force_range")
