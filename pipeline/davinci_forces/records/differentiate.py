"""Records of averaged periods without noise, with velocity and acceleration."""

from dataclasses import dataclass

from davinci_forces.records.record import Column, Counts, Record


@dataclass(frozen=True, eq=False)
class Trajectory(Record):
    """One averaged period with its velocity and acceleration, free of noise, and how large that was."""

    log: str
    joint: str
    rate: float
    period: float
    periods: int
    t_start: float
    harmonics: int
    sigma_q: float
    sigma_dq: float
    sigma_tau: float
    sigma_tau_white: float
    t: Column
    q: Column
    dq: Column
    ddq: Column
    tau: Column
    tau_var: Column
    count: Counts


@dataclass(frozen=True, eq=False)
class Spectrum(Record):
    """Amplitude of each harmonic of an averaged period: the harmonics kept, and the rest taken as noise."""

    log: str
    joint: str
    harmonics: int
    frequency: Column
    amplitude: Column
