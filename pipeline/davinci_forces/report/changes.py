"""Which numbers of two results.json differ by more than their standard errors allow."""

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

SUBJECTS = {  # what a key is about, by its first part; other keys are of the study, see `Change.subject`
    "model": ("fit", "choice", "cv", "predict", "path", "search", "guess", "identifiability", "correlation", "truth"),
    "contacts": ("contact", "tissue", "weight"),
    "forces": ("effort", "tip", "ekf", "threshold", "tuning", "direct", "momentum", "rate", "rts", "stream",
               "stability", "haptics"),
    "noise": ("noise", "whiteness", "band", "period", "log"),
}  # fmt: skip
OF_ACCURACY = ("model_error", "detection_level", "coverage")  # last parts of the keys that verdicts are made of
OF_CANDIDATES = ("fit", "choice", "cv", "predict", "search", "guess", "identifiability", "correlation")
RANKS = {  # to sort by
    "accuracy": 0, "model": 1, "contacts": 1, "forces": 2, "study": 2, "noise": 3,
    "standard errors": 4, "candidates": 5,
}  # fmt: skip
SIGMAS = 2.0  # standard errors of a difference, beyond which a number has changed
RELATIVE = 1e-9  # the same, relative to a number of which no standard error is stated

Value = float | int | str | bool | None
Window = tuple[float, float]


@dataclass(frozen=True)
class StatedValue:
    """A number as a results.json states it; `std` is None where it has no standard error."""

    value: Value
    std: float | None = None
    unit: str = ""

    @property
    def number(self) -> float | None:
        """The value as a number; truth and text are none."""
        value = self.value
        return float(value) if isinstance(value, int | float) and not isinstance(value, bool) else None


@dataclass(frozen=True)
class Change:
    """A key whose number changed, came or went: `before` is None where it came, `after` where it went."""

    key: str
    before: StatedValue | None
    after: StatedValue | None

    @property
    def std(self) -> float | None:
        """The standard error of b - a, sqrt(s_a^2 + s_b^2); None where neither number states one, or one is gone."""
        return difference_std(self.before, self.after) if self.before and self.after else None

    @property
    def z(self) -> float | None:
        """(b - a) / std; None where there is no such error, or no difference of numbers."""
        if not (self.before and self.after and self.std):
            return None
        a, b = self.before.number, self.after.number
        return (b - a) / self.std if a is not None and b is not None and math.isfinite(b - a) else None

    @property
    def subject(self) -> str:
        """What the number is about, of RANKS; "candidates" are models, estimators and filters that are not in use.

        "standard errors" are those under keys of their own, which follow the values.
        """
        start, *others = self.key.split(".")
        is_chosen = "chosen" in others
        if "-" in start or (start in OF_CANDIDATES and not is_chosen):  # ekf-euler is not the filter in use
            return "candidates"
        if others[-1:] and others[-1] in OF_ACCURACY and (is_chosen or start == "effort"):
            return "accuracy"
        if others and (others[-1].startswith("std_") or others[-1].endswith("_std")):
            return "standard errors"
        return next((subject for subject, starts in SUBJECTS.items() if start in starts), "study")

    @property
    def weight(self) -> tuple[bool, int, float]:
        """A weight to sort by: by rank those with standard errors, then by relative differences, then other changes."""
        rank, a, b = -RANKS[self.subject], *(x.number if x else None for x in (self.before, self.after))
        if self.z is not None:
            return True, rank, abs(self.z)
        if a is None or b is None or not math.isfinite(b - a):
            return False, rank, math.inf
        return False, rank, abs(b - a) / max(abs(a), abs(b), math.ulp(0.0))


def changes(before: Mapping[str, StatedValue], after: Mapping[str, StatedValue]) -> list[Change]:
    """Every key that changed, went or came, in the order of the files; contacts are paired by their times."""
    contacts = partners(windows_of(before), windows_of(after))
    starts = {key: key.rpartition(".")[0] for key in before}
    keys = {key: key.replace(start, contacts.get(start, start), 1) for key, start in starts.items()}
    both = [Change(key, a, after.get(keys[key])) for key, a in before.items()]
    new = after.keys() - keys.values()
    came = [Change(key, None, b) for key, b in after.items() if key in new]
    return [d for d in (*both, *came) if d.before is None or d.after is None or has_changed(d.before, d.after)]


def partners(before: Mapping[str, Window], after: Mapping[str, Window]) -> dict[str, str]:
    """The window of `after` that shares most time with each of `before`, of the same log and joint; "" for none."""
    pairs = {}
    for name, (onset, release) in before.items():
        others = {other: w for other, w in after.items() if other.rpartition(".")[0] == name.rpartition(".")[0]}
        shared = {other: min(release, end) - max(onset, start) for other, (start, end) in others.items()}
        pairs[name] = max((other for other in shared if shared[other] > 0.0), key=shared.__getitem__, default="")
    return pairs


def windows_of(numbers: Mapping[str, StatedValue]) -> dict[str, Window]:
    """Onset and release [s] of every contact, by the start of its keys."""
    names = [key.removesuffix(".release") for key in numbers if key.endswith(".release")]
    return {name: (numbers[f"{name}.onset"].number or 0.0, numbers[f"{name}.release"].number or 0.0) for name in names}


def by_joint(differing: Sequence[Change], keys: Iterable[str]) -> dict[str, list[Change]]:
    """Changes by the joint that their keys name, "" for none, the weightiest first; `keys` are all keys of a study.

    `..._of_<joint>` of the arm's model is that joint's.  Repetitions, as of two estimators with one result, come last.
    """
    joints = {key.split(".")[1]: None for key in keys if key.startswith(("fit.", "threshold."))}
    groups: dict[str, list[Change]] = {}
    for change in sorted(differing, key=lambda change: change.weight, reverse=True):
        name = change.key.partition(".std_")[0]
        of_arm = (joint for joint in joints if name.endswith(f"_of_{joint.replace('-', '_')}"))
        joint = next(of_arm, next((part for part in name.split(".")[1:] if part in joints), ""))
        groups.setdefault(joint, []).append(change)
    return {joint: _repetitions_last(groups[joint]) for joint in (*joints, "") if joint in groups}


def _repetitions_last(group: Sequence[Change]) -> list[Change]:
    first = {(c.key.rpartition(".")[2], c.before, c.after): c.key for c in reversed(group)}
    return sorted(group, key=lambda c: first[c.key.rpartition(".")[2], c.before, c.after] != c.key)


def has_changed(a: StatedValue, b: StatedValue) -> bool:
    """|b - a| > 2 sqrt(s_a^2 + s_b^2), or > 1e-9 of the larger where neither states an error; a unit is no other."""
    if a.unit != b.unit:
        return True
    p, q = a.number, b.number
    if p is None or q is None:
        return type(a.value) is not type(b.value) or a.value != b.value
    if p == q or max(abs(p), abs(q)) < 2.0**-1022 or (math.isnan(p) and math.isnan(q)):  # no normal number is smaller
        return False
    std = difference_std(a, b)
    allowed = RELATIVE * max(abs(p), abs(q)) if std is None else SIGMAS * std
    return not math.isfinite(q - p) or abs(q - p) > allowed


def difference_std(a: StatedValue, b: StatedValue) -> float | None:
    """sqrt(s_a^2 + s_b^2), with 0 for an error that only one of them states; None where there is no error at all."""
    return math.hypot(a.std or 0.0, b.std or 0.0) or None
