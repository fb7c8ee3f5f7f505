"""The external effort of a log of arrays: as data frames, plots, and text for a notebook."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from html import escape
from typing import Any

import numpy as np
import pandas as pd

from davinci_forces.arrays.given import Columns
from davinci_forces.maths.arrays import Array
from davinci_forces.records import Contact, Threshold, Track
from davinci_forces.report.verdicts import is_small
from davinci_forces.runner.results.dataframes import as_frame


@dataclass(frozen=True, eq=False, repr=False)
class ExternalEffort:
    """The external effort of the joints along a log: smoothed, with its standard deviation, and its contacts.

    `record` holds the Track of each joint, which also has the effort of the filter without look-ahead.
    """

    record: tuple[Track, ...]
    contact_record: tuple[Contact, ...]
    level_record: tuple[Threshold, ...]
    labels: tuple[str, ...]
    diagnostics: tuple[str, ...]
    _log: tuple[Columns, dict[str, Any]]  # for `IdentifiedArm.save`

    @property
    def t(self) -> Array:
        """Time (N,) [s] from the start of the log."""
        return np.asarray(self.tau_ext.index)

    @property
    def tau_ext(self) -> pd.DataFrame:
        """The external effort: a row a time, a column a joint."""
        return by_joint({track.joint: (track.t, track.tau_ext_smooth) for track in self.record})

    @property
    def std(self) -> pd.DataFrame:
        """The standard deviation of the external effort: a row a time, a column a joint."""
        return by_joint({track.joint: (track.t, track.tau_ext_smooth_std) for track in self.record})

    @property
    def levels(self) -> pd.DataFrame:
        """The alarm level and the detection level of each joint, with their standard errors: a row a joint."""
        names = ["joint", "alarm_level", "alarm_level_std", "detection_level", "detection_level_std"]
        return pd.DataFrame([[getattr(level, name) for name in names] for level in self.level_record], columns=names)

    @property
    def contacts(self) -> pd.DataFrame:
        """Contacts, stated or detected: onset, release [s], peak, `middle_mean` (the level if held), mean, impulse.

        In a stated window in which nothing was detected, `above` is 0.  One that is `small`, not stated and below twice
        the alarm level, may be an error of the model.
        """
        names = ["joint", "alarm_level", *(name for name in Contact.columns() if name not in ("stated", "found"))]
        frames = [as_frame(contact)[names].assign(small=is_small(contact)) for contact in self.contact_record]
        return pd.concat(frames, ignore_index=True) if frames else pd.DataFrame(columns=[*names, "small"])

    def plot(self) -> Any:
        """Plot the external effort with its 95 % band and the contacts; returns the axes, one a joint."""
        axes = axes_of({t.joint: f"external {label}" for t, label in zip(self.record, self.labels, strict=True)})
        for ax, track in zip(axes, self.record, strict=True):
            half = 1.96 * track.tau_ext_smooth_std
            ax.fill_between(track.t, track.tau_ext_smooth - half, track.tau_ext_smooth + half, color="C0", alpha=0.25)
            ax.plot(track.t, track.tau_ext_smooth, "C0", lw=1)
            for contact in self.contacts[self.contacts["joint"] == track.joint].itertuples():
                ax.axvspan(contact.onset, contact.release, color="C1", alpha=0.2)
        return axes

    def __repr__(self) -> str:
        """The contacts as a table."""
        above = self.contacts[self.contacts["above"] == 1]
        contacts = above[["joint", "onset", "release", "peak", "peak_std", "middle_mean", "small"]]
        joints = ", ".join(track.joint for track in self.record)
        return f"{joints}, {len(self.t)} samples, {len(contacts)} contacts of joints\n{contacts}"

    def _repr_html_(self) -> str:
        return as_html([self.tau_ext.describe().loc[["min", "mean", "max"]], self.contacts], self.diagnostics)


def by_joint(columns: Mapping[str, tuple[Array, Array]]) -> pd.DataFrame:
    """Time series (N,) as a DataFrame with a column a joint."""
    return pd.DataFrame({joint: pd.Series(x, pd.Index(t, name="t")) for joint, (t, x) in columns.items()})


def axes_of(labels: Mapping[str, str]) -> Any:
    """One axes a joint (joints,), below each other, with the label of its effort."""
    from matplotlib import pyplot

    size = (8, 0.8 + 2.0 * len(labels))
    _, axes = pyplot.subplots(len(labels), sharex=True, squeeze=False, figsize=size, layout="tight")
    for ax, (joint, label) in zip(axes[:, 0], labels.items(), strict=True):
        ax.set_ylabel(label)
        ax.set_title(joint, loc="left", fontsize="medium")
    axes[-1, 0].set_xlabel("time [s]")
    return axes[:, 0]


def as_html(tables: Sequence[pd.DataFrame], texts: Sequence[str]) -> str:
    """Tables, with numbers of four digits, and a list of texts as HTML."""
    parts = [table.to_html(float_format=lambda x: f"{x:.4g}") for table in tables]
    return "".join([*parts, *(f"<p>{escape(text)}</p>" for text in texts)])
