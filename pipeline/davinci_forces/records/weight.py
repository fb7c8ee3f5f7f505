"""Records of masses on the arm."""

from collections.abc import Iterator
from dataclasses import dataclass

from davinci_forces.records.record import Column, Labels, LogJointRecord, LogRecord, Published


@dataclass(frozen=True, eq=False)
class Load(LogJointRecord):
    """The effort of one joint per kilogram of a weight log's mass, along a log's path, and the external effort there.

    Where the log's motion repeats, rows are one averaged period.  Both efforts have the same low-pass, without delay.
    """

    KEY = ("log", "joint", "weight")
    UNKNOWN = ("tau_ext_unseen",)

    weight: str
    role: str
    rate: float
    period: float
    is_current: int
    t: Column
    q: Column
    load: Column
    load_mirrored: Column
    tau_ext: Column
    tau_ext_unseen: Column


@dataclass(frozen=True, eq=False)
class Weight(LogRecord):
    """The mass on the arm in one log, from the external effort of the joints that it loads."""

    ROWS = "loaded"

    moves_with: str
    tare: str  # the log that was subtracted
    stated_mass: float  # NaN if the study gives no mass
    mass: float
    mass_std: float
    run_std: float
    fit_std: float
    widening: float
    agreement: float
    agreement_mirrored: float
    birge_ratio: float
    differing: str  # the joint that differs most from the others; "" if they agree
    mass_mirrored: float
    mass_mirrored_std: float
    side: str
    mass_scale: float
    mass_scale_std: float
    tare_mass: float
    tare_mass_std: float
    loaded: Labels
    unit: Labels
    mass_alone: Column
    mass_alone_std: Column
    mirrored_alone: Column
    mirrored_alone_std: Column
    false_mass: Column
    joint_offset: Column
    joint_offset_std: Column
    left_rms: Column
    left_rms_std: Column
    free_error: Column
    free_error_std: Column

    def published(self) -> Iterator[Published]:
        """The mass on the stated side and on the opposite one, the scale, and the mass of the tare."""
        for key, field in (("mass", "mass"), ("mass_mirrored", "mass_mirrored"), ("scale", "mass_scale")):
            yield Published(f"weight.{self.log}.{key}", field, std=f"{field}_std")
        yield from self.publish(f"weight.{self.log}", "tare_mass", with_std=True)
        yield from self.publish(
            f"weight.{self.log}", "run_std", "fit_std", "widening", "agreement", "agreement_mirrored", "birge_ratio"
        )
        for i, joint in enumerate(self.loaded):
            prefix = f"weight.{self.log}.{joint}"
            yield Published(f"{prefix}.mass", "mass_alone", std="mass_alone_std", row=i)
            yield Published(f"{prefix}.mass_mirrored", "mirrored_alone", std="mirrored_alone_std", row=i)
            yield from self.publish(prefix, "false_mass", row=i)
            yield from self.publish(prefix, "joint_offset", "left_rms", "free_error", row=i, with_std=True)


@dataclass(frozen=True, eq=False)
class TorqueConstant(LogJointRecord):
    """The torque constant of a joint's motor that a known mass gives; a proposal, which no stage applies."""

    stated_mass: float
    torque_constant_used: float  # NaN where the effort is in A
    torque_constant: float
    torque_constant_std: float

    def published(self) -> Iterator[Published]:
        """The proposed constant."""
        yield from self.publish(f"weight.{self.log}.{self.joint}", "torque_constant", with_std=True)


@dataclass(frozen=True, eq=False)
class FreeWeight(LogRecord):
    """The apparent mass on the arm in a log of free motion, where it should be 0."""

    KEY = ("log", "weight")

    weight: str
    role: str
    free_mass: float
    free_mass_std: float

    def published(self) -> Iterator[Published]:
        """The mass that should be 0."""
        yield Published(f"weight.{self.weight}.free.{self.log}", "free_mass", std="free_mass_std")
