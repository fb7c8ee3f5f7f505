"""The records that flow between stages, one module for each stage that makes them; see `record`."""

from davinci_forces.records.assess import FreeSpace
from davinci_forces.records.average import Average, PeriodResidual
from davinci_forces.records.benchmark import Comparison
from davinci_forces.records.bound import ErrorBand
from davinci_forces.records.calibrate import FreeMotion
from davinci_forces.records.chart import FrictionMap
from davinci_forces.records.choose import Choice
from davinci_forces.records.combine import ArmCorrelation
from davinci_forces.records.correlate import JointCorrelation
from davinci_forces.records.design import Control, Excitation, Links, Lyapunov, Pose, Workspace
from davinci_forces.records.diagnostic import Diagnostic, diagnostic
from davinci_forces.records.differentiate import Spectrum, Trajectory
from davinci_forces.records.ekf import Track
from davinci_forces.records.explain import Explanation, Innovation
from davinci_forces.records.feel import HapticResponse, HapticRun
from davinci_forces.records.fit import (
    CrossFit,
    Fit,
    FittedPaths,
    Guess,
    Identifiability,
    MeasurementNoise,
    Residual,
    SwarmSearch,
)
from davinci_forces.records.hang import Load
from davinci_forces.records.ingest import LogSummary, Recording, Touch
from davinci_forces.records.limit import DelayLimit, HapticMotion, StabilityLimit, StabilityMap, TissueLimit
from davinci_forces.records.measure import Contact
from davinci_forces.records.palpate import Push, Stiffness, TissueModel
from davinci_forces.records.predict import JointModel, Prediction
from davinci_forces.records.record import COLUMN_DTYPES, AnyRecord, Column, Counts, Labels, Names, Origin, Record
from davinci_forces.records.resample import Motion, Signal
from davinci_forces.records.resolve import TipBudget, TipContact, TipForce
from davinci_forces.records.sense import SensorForce
from davinci_forces.records.settle import FilterNoise
from davinci_forces.records.threshold import Threshold
from davinci_forces.records.tune import Tuning
from davinci_forces.records.weigh import FreeWeight, Weight
from davinci_forces.records.whiteness import Whiteness

__all__ = [
    "COLUMN_DTYPES", "KINDS", "AnyRecord", "ArmCorrelation", "Average", "Choice", "Column", "Comparison", "Contact",
    "Control", "Counts", "CrossFit", "DelayLimit", "Diagnostic", "ErrorBand", "Excitation", "Explanation",
    "FilterNoise", "Fit", "FittedPaths", "FreeMotion", "FreeSpace", "FreeWeight", "FrictionMap", "Guess",
    "HapticMotion", "HapticResponse", "HapticRun", "Identifiability", "Innovation", "JointCorrelation", "JointModel",
    "Labels", "Links", "Load", "LogSummary", "Lyapunov", "MeasurementNoise", "Motion", "Names", "Origin",
    "PeriodResidual", "Pose", "Prediction", "Push", "Record", "Recording", "Residual", "SensorForce", "Signal",
    "Spectrum", "StabilityLimit", "StabilityMap", "Stiffness", "SwarmSearch", "Threshold", "TipBudget", "TipContact",
    "TipForce", "TissueLimit", "TissueModel", "Touch", "Track", "Trajectory", "Tuning", "Weight", "Whiteness",
    "Workspace", "diagnostic",
]  # fmt: skip

KINDS: dict[str, type[Record]] = {
    kind.__name__: kind
    for kind in (
        Links, Pose, Workspace, Control, Lyapunov, Excitation, LogSummary, Recording, Touch, Signal, Motion, Average,
        PeriodResidual, Trajectory, Spectrum, Fit, CrossFit, Identifiability, FittedPaths, MeasurementNoise, Residual,
        SwarmSearch, Guess, Choice, FrictionMap, Prediction, JointModel, Tuning, FilterNoise, FreeMotion, ErrorBand,
        Track, FreeSpace, Threshold, Contact, Push, Stiffness, TissueModel, Load, Weight, FreeWeight, Comparison,
        StabilityMap, StabilityLimit, DelayLimit, TissueLimit, HapticMotion, HapticResponse, HapticRun,
        JointCorrelation, ArmCorrelation, TipForce, TipContact, TipBudget, SensorForce, Whiteness, Innovation,
        Explanation, Diagnostic,
    )
}  # fmt: skip
