"""Records of masses on the arm."""

from davinci_forces.records.record import Column, Labels, LogJointRecord, LogRecord

SAME = 0.01  # share of a stated mass or torque constant, which are not known better


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
    periods: int  # that are almost whole
    period_spread: float  # 0 with one period or none
    t: Column
    q: Column
    load: Column
    load_mirrored: Column
    tau_ext: Column
    tau_ext_unseen: Column


class Weight(LogRecord):
    """The mass on the arm in one log, from the external effort of the joints that it loads."""

    ROWS = "loaded"
    UNKNOWN = ("joint_offset", "joint_offset_std")  # where a constant effort cannot be told from the mass
    PUBLISHED = (
        "weight.{log}: mass± mass_mirrored± scale=mass_scale± tare_mass± run_std fit_std widening agreement "
        "agreement_mirrored birge_ratio",
        "weight.{log}.{name}: mass=mass_alone± mass_mirrored=mirrored_alone± false_mass joint_offset± left_rms± "
        "free_error±",
    )

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


class TorqueConstant(LogJointRecord):
    """The torque constant of a joint's motor that a known mass gives; a proposal, which no stage applies."""

    PUBLISHED = ("weight.{log}.{joint}: torque_constant±",)

    stated_mass: float
    torque_constant_used: float  # NaN where the effort is in A
    torque_constant: float
    torque_constant_std: float


class FreeWeight(LogRecord):
    """The apparent mass on the arm in a log of free motion, where it should be 0."""

    KEY = ("log", "weight")
    PUBLISHED = ("weight.{weight}.free.{log}: =free_mass±",)

    weight: str
    role: str
    free_mass: float
    free_mass_std: float
