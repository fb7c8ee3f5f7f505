"""Positions over time, between given points."""

from dataclasses import dataclass

import numpy as np

from davinci_forces.maths.arrays import Array


@dataclass(frozen=True)
class Path:
    """Positions to be at at given times, at constant speed or easing in and out between them."""

    points: tuple[tuple[float, float], ...]  # time [s], position
    ease: bool

    def position(self, t: Array) -> Array:
        """The position at the times t (N,) [s]; the first and the last position hold before and after."""
        times, positions = np.array(self.points).T
        if not self.ease:
            return np.asarray(np.interp(t, times, positions))
        part = np.interp(t, times, np.arange(len(times), dtype=float))
        whole = np.floor(part)
        eased = whole + (1 - np.cos(np.pi * (part - whole))) / 2
        return np.asarray(np.interp(eased, np.arange(len(times)), positions))
