"""The records that flow between stages, one module for each stage that makes them; see `record`."""

from pipeline.records.assess import FreeSpace
from pipeline.records.average import Average, PeriodResidual
from pipeline.records.benchmark import Comparison
from pipeline.records.bound import ErrorBand
from pipeline.records.calibrate import FreeMotion
from pipeline.records.chart import FrictionMap
from pipeline.records.choose import Choice
from pipeline.records.combine import ArmCorrelation
from pipeline.records.correlate import JointCorrelation
from pipeline.records.design import Control, Excitation, Links, Lyapunov, Pose, Workspace
from pipeline.records.diagnostic import Diagnostic, diagnostic
from pipeline.records.differentiate import Spectrum, Trajectory
from pipeline.records.ekf import Track
from pipeline.records.explain import Explanation, Innovation
from pipeline.records.feel import HapticResponse, HapticRun
from pipeline.records.fit import (
    CrossFit,
    Fit,
    FittedPaths,
    Guess,
    Identifiability,
    MeasurementNoise,
    Residual,
    SwarmSearch,
)
from pipeline.records.hang import Load
from pipeline.records.ingest import LogSummary, Recording, Touch
from pipeline.records.limit import DelayLimit, HapticMotion, StabilityLimit, StabilityMap, TissueLimit
from pipeline.records.measure import Contact
from pipeline.records.palpate import Push, Stiffness, TissueModel
from pipeline.records.predict import Prediction
from pipeline.records.record import COLUMN_DTYPES, AnyRecord, Column, Counts, Labels, Names, Origin, Record
from pipeline.records.resample import Signal
from pipeline.records.resolve import TipBudget, TipContact, TipForce
from pipeline.records.sense import SensorForce
from pipeline.records.settle import FilterNoise
from pipeline.records.smooth import Smoothed
from pipeline.records.threshold import Threshold
from pipeline.records.tune import Tuning
from pipeline.records.weigh import FreeWeight, Weight
from pipeline.records.whiteness import Whiteness

__all__ = [
    "COLUMN_DTYPES", "KINDS", "AnyRecord", "ArmCorrelation", "Average", "Choice", "Column", "Comparison", "Contact",
    "Control", "Counts", "CrossFit", "DelayLimit", "Diagnostic", "ErrorBand", "Excitation", "Explanation",
    "FilterNoise", "Fit", "FittedPaths", "FreeMotion", "FreeSpace", "FreeWeight", "FrictionMap", "Guess",
    "HapticMotion", "HapticResponse", "HapticRun", "Identifiability", "Innovation", "JointCorrelation", "Labels",
    "Links", "Load", "LogSummary", "Lyapunov", "MeasurementNoise", "Names", "Origin", "PeriodResidual", "Pose",
    "Prediction", "Push", "Record", "Recording", "Residual", "SensorForce", "Signal", "Smoothed", "Spectrum",
    "StabilityLimit", "StabilityMap", "Stiffness", "SwarmSearch", "Threshold", "TipBudget", "TipContact", "TipForce",
    "TissueLimit", "TissueModel", "Touch", "Track", "Trajectory", "Tuning", "Weight", "Whiteness", "Workspace",
    "diagnostic",
]  # fmt: skip

KINDS: dict[str, type[Record]] = {
    kind.__name__: kind
    for kind in (
        Links, Pose, Workspace, Control, Lyapunov, Excitation, LogSummary, Recording, Touch, Signal, Average,
        PeriodResidual, Trajectory, Spectrum, Smoothed, Fit, CrossFit, Identifiability, FittedPaths, MeasurementNoise,
        Residual, SwarmSearch, Guess, Choice, FrictionMap, Prediction, Tuning, FilterNoise, FreeMotion, ErrorBand,
        Track, FreeSpace, Threshold, Contact, Push, Stiffness, TissueModel, Load, Weight, FreeWeight, Comparison,
        StabilityMap, StabilityLimit, DelayLimit, TissueLimit, HapticMotion, HapticResponse, HapticRun,
        JointCorrelation, ArmCorrelation, TipForce, TipContact, TipBudget, SensorForce, Whiteness, Innovation,
        Explanation, Diagnostic,
    )
}  # fmt: skip
