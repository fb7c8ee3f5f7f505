"""The input of every section: records, results, and the names of fits, logs and axes."""

import re
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from typing import Any

from davinci_forces.records import Fit, FreeSpace, Prediction, Record
from davinci_forces.records.catalogue import Catalogue, Provenance
from davinci_forces.records.forces import SMOOTHER
from davinci_forces.records.prediction import CHOSEN, CHOSEN_BY_LOG
from davinci_forces.records.quantities import QUANTITIES
from davinci_forces.records.record import LogJointRecord
from davinci_forces.report.changes import StatedValue
from davinci_forces.report.content import Number, literal
from davinci_forces.report.results import Results, format_unit, unit_of
from davinci_forces.study import Study
from davinci_forces.study.review import Rating

BASELINE_FIT = "independent.lse"  # each joint by itself, least squares: other fits are compared with this fit
THESIS_SCENARIOS = ("davinci-demo", "davinci-thesis")  # simulations of the thesis's experiments
ESTIMATOR_NAMES = {name: name.upper() for name in ("lse", "wlse", "pso", "iv", "tls")} | {"huber": "Huber"}


@dataclass(frozen=True)
class Context:
    """One study, ready to be reported."""

    catalogue: Catalogue
    study: Study
    results: Results
    provenance: Provenance
    ratings: tuple[Rating, ...] = ()  # by reviewers, from review.toml
    labels: frozenset[str] = frozenset()  # of the blocks before a section in its document
    baseline: Mapping[str, StatedValue] | None = None  # the numbers of an earlier report, if the study names one

    @property
    def compares_with_thesis(self) -> bool:
        """Whether results are compared with the thesis: only in the simulations of its experiments."""
        return self.study.truth.get("scenario") in THESIS_SCENARIOS

    def number(self, key: str, digits: int = 4, **looks: Any) -> Number | str:
        """The result of that key as a cell, or a dash if there is none; `looks` are fields of a Number."""
        return replace(self.results[key].number(digits), **looks) if key in self.results else "–"

    def numbers(self, prefix: str, names: Iterable[str], digits: int = 3) -> tuple[Number | str, ...]:
        """The results `<prefix>.<name>` as cells."""
        return tuple(self.number(f"{prefix}.{name}", digits) for name in names)

    def probabilities(self, prefix: str, names: Iterable[str]) -> tuple[Number | str, ...]:
        """The probabilities `<prefix>.<name>` as cells; small ones are printed as < 0.001."""
        return tuple(self.number(f"{prefix}.{name}", 2, least=0.001) for name in names)

    def count(self, key: str) -> Number | str:
        """The result of that key, which is a whole number, as a cell."""
        return self.number(key, len(str(round(self.results[key].value))) if key in self.results else 1)

    def size(self, record: Record, field: str, value: float | None = None, digits: int = 2) -> str:
        """The value of a record's field, or another value, with the field's unit, as text for a sentence."""
        size = getattr(record, field) if value is None else value
        return str(Number(size, format_unit(unit_of(record, field)), digits=digits))

    def used_fit(self, joint: str) -> str:
        """`<model>.<estimator>` of the fit that the filter used; a chosen fit is named `chosen.<fit>`."""
        setting = self.study.settings.fit
        if setting == CHOSEN and (chosen := self.catalogue.select(Prediction, joint=joint, model=CHOSEN)):
            return f"{CHOSEN}.{chosen[0].estimator}"
        return setting if self.fit_named(setting, joint) else self.own_fit(joint)

    def shown_fit(self, joint: str) -> Fit | None:
        """The fit that the filter used, or that of the joint by itself; None if there is neither."""
        return self.used_record(joint) or self.fit_named(self.own_fit(joint), joint)

    def used_record(self, joint: str) -> Fit | None:
        """The fit that the filter used; None if it used the fit of a joint by itself and none was chosen."""
        fit = self.used_fit(joint)
        if fit == self.own_fit(joint):
            return None
        return self.fit_named(fit.removeprefix(f"{CHOSEN}.") if self.study.settings.fit == CHOSEN else fit, joint)

    def fit_named(self, name: str, joint: str) -> Fit | None:
        """The fit `<model>.<estimator>` that describes the effort of a joint."""
        fits = [f for f in self.catalogue.records(Fit) if f"{f.model}.{f.estimator}" == name]
        return next((f for f in fits if joint in self.efforts_of(f)), None)

    def efforts_of(self, fit: Fit) -> list[str]:
        """The joints whose efforts a fit describes, in their order."""
        names = [joint.name for joint in self.study.robot.joints]
        if fit.group in names:
            return [fit.group]
        return [name for name in names if any(str(p).endswith(f" of {name}") for p in fit.parameter)] or names

    def joints_of(self, records: Iterable[LogJointRecord]) -> list[str]:
        """The joints that records are of, in the robot's order, whatever logs come first."""
        names = {record.joint for record in records}
        return [joint.name for joint in self.study.robot.joints if joint.name in names]

    def true_stiffness(self, log: str) -> float | None:
        """The stiffness [N/m] of the tissue of a simulated log, None of a recorded one."""
        entries = [entry for entry in self.study.truth.get("log", []) if entry.get("name") == log]
        return float(entries[0]["stiffness"]) if entries and "stiffness" in entries[0] else None

    def predicting_fits(self, joint: str) -> tuple[str, str]:
        """The names, in predictions, of the fit that the filter used, and of its refits without whole logs."""
        fit = self.used_fit(joint)
        return fit, fit.replace(CHOSEN, CHOSEN_BY_LOG, 1)

    def own_fit(self, joint: str) -> str:
        """`<model>.<estimator>` of the fit of a joint by itself: the fit that the filter used, or least squares."""
        names = [f"{fit.model}.{fit.estimator}" for fit in self.own_fits() if fit.group == joint]
        chosen = [p.estimator for p in self.catalogue.select(Prediction, joint=joint, model=CHOSEN)]
        wanted = chosen[:1] if self.study.settings.fit == CHOSEN else [self.study.settings.fit]
        return next((name for name in (*wanted, BASELINE_FIT, *names) if name in names), self.study.settings.fit)

    def worst_space(self, joint: str) -> FreeSpace | None:
        """The smoother's free space of a joint with the highest detection level, if possible of a log not fitted."""
        return max(self.spaces(joint), key=lambda space: space.detection_level, default=None)

    def spaces(self, joint: str) -> list[FreeSpace]:
        """The smoother's free space of a joint in each log that was not fitted, else in each fitted one."""
        spaces = self.catalogue.select(FreeSpace, joint=joint, filter=SMOOTHER)
        return [space for space in spaces if space.role != "identification"] or spaces

    def own_fits(self) -> list[Fit]:
        """The fits of each joint by itself."""
        return self.catalogue.select(Fit, model="independent")


def fit_name(model: str, estimator: str) -> str:
    """The printed name of a fit, as 'independent, LSE', 'chosen, ridge', or 'chosen: independent, LSE' for another."""
    if model not in (CHOSEN, CHOSEN_BY_LOG):
        return f"{model}, {estimator_name(estimator)}"
    structure, _, by = estimator.rpartition(".")
    name = "chosen, by log" if model == CHOSEN_BY_LOG else "chosen"
    return f"{name}{f': {structure}' * (structure not in ('', CHOSEN))}, {estimator_name(by)}"


def estimator_name(estimator: str) -> str:
    """The printed name of an estimator: acronyms in capitals, and 'Huber'."""
    return ESTIMATOR_NAMES.get(estimator, estimator)


def count(number: int, noun: str) -> str:
    """A number with its noun: '1 run', '3 runs', '2 pushes'."""
    return f"{number} {noun}{'' if number == 1 else 'es' if noun.endswith('sh') else 's'}"


def title(name: str) -> str:
    """The name of a log or joint as a heading: 'hand_roll' is 'Hand roll'."""
    text = literal(name.replace("_", " "))
    return text[:1].upper() + text[1:]


def name_in_sentence(joint: str) -> str:
    """The name of a joint within a sentence: `the hand roll`, but `joint 1`."""
    article = "" if re.match(r"joint[_-]?\d", joint) else "the "
    return article + literal(joint.replace("_", " "))


def label(record: Record, field: str, meaning: str = "") -> str:
    """The label of an axis: what a field means and its unit."""
    text, unit = meaning or QUANTITIES[field].meaning, format_unit(unit_of(record, field))
    return f"{text} [{unit}]" if unit else text
