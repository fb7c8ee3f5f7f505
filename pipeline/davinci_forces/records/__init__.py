"""The records that stages exchange, in modules by subject; see `record`."""

from davinci_forces.records.forces import (
    Comparison,
    Contact,
    ErrorBand,
    FilterNoise,
    FreeMotion,
    FreeSpace,
    Streamed,
    StreamLevel,
    Threshold,
    Track,
    Tuning,
)
from davinci_forces.records.model import (
    Choice,
    CrossFit,
    Fit,
    FittedPaths,
    FrictionMap,
    Guess,
    Identifiability,
    MeasurementNoise,
    ModelSearch,
    Residual,
    SwarmSearch,
)
from davinci_forces.records.plan import Control, Excitation, Links, Lyapunov, Pose, Workspace
from davinci_forces.records.prediction import JointModel, PathShare, Prediction
from davinci_forces.records.record import AnyRecord, Column, Counts, Diagnostic, Origin, Record, by_name, diagnostic
from davinci_forces.records.recordings import (
    Average,
    LogSummary,
    Motion,
    PeriodResidual,
    Recording,
    Signal,
    Spectrum,
    Touch,
    Trajectory,
)
from davinci_forces.records.tip import ArmCorrelation, JointCorrelation, SensorForce, TipBudget, TipContact, TipForce
from davinci_forces.records.tissue import (
    HandLimit,
    HapticMotion,
    HapticResponse,
    HapticRun,
    Push,
    StabilityLimit,
    Stiffness,
    TissueModel,
)
from davinci_forces.records.weight import FreeWeight, Load, TorqueConstant, Weight
from davinci_forces.records.whiteness import Explanation, Innovation, Whiteness

__all__ = [
    "KINDS", "AnyRecord", "ArmCorrelation", "Average", "Choice", "Column", "Comparison", "Contact",
    "Control", "Counts", "CrossFit", "Diagnostic", "ErrorBand", "Excitation", "Explanation", "FilterNoise", "Fit",
    "FittedPaths", "FreeMotion", "FreeSpace", "FreeWeight", "FrictionMap", "Guess", "HandLimit", "HapticMotion",
    "HapticResponse", "HapticRun", "Identifiability", "Innovation", "JointCorrelation", "JointModel", "Links",
    "Load", "LogSummary", "Lyapunov", "MeasurementNoise", "ModelSearch", "Motion", "Origin", "PathShare",
    "PeriodResidual", "Pose", "Prediction", "Push", "Record", "Recording", "Residual", "SensorForce", "Signal",
    "Spectrum", "StabilityLimit", "Stiffness", "StreamLevel", "Streamed", "SwarmSearch", "Threshold",
    "TipBudget", "TipContact", "TipForce", "TissueModel", "TorqueConstant", "Touch", "Track", "Trajectory",
    "Tuning", "Weight", "Whiteness", "Workspace", "by_name", "diagnostic",
]  # fmt: skip

KINDS: dict[str, type[Record]] = {
    kind.__name__: kind
    for kind in (
        Links, Pose, Workspace, Control, Lyapunov, Excitation, LogSummary, Recording, Touch, Signal, Motion, Average,
        PeriodResidual, Trajectory, Spectrum, Fit, CrossFit, Identifiability, FittedPaths, MeasurementNoise, Residual,
        SwarmSearch, Guess, Choice, ModelSearch, FrictionMap, Prediction, PathShare, JointModel, Tuning, FilterNoise,
        FreeMotion, ErrorBand, Track, FreeSpace, Threshold, Contact, Push, Stiffness, TissueModel, Load, Weight,
        FreeWeight, TorqueConstant, Comparison, Streamed, StreamLevel, StabilityLimit, HandLimit, HapticMotion,
        HapticResponse, HapticRun, JointCorrelation, ArmCorrelation, TipForce, TipContact, TipBudget, SensorForce,
        Whiteness, Innovation, Explanation, Diagnostic,
    )
}  # fmt: skip

# Folders of record kinds of earlier versions, whose files are removed.  Add the folder of each removed kind.
FORMER_FOLDERS = ("intake", "logsummary", "noise", "note", "periodresidual", "smoothed", "tissue")
