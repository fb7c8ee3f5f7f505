"""Every number of a report under a stable key, with its source (results.json), and the report ID (manifest.txt)."""

import hashlib
import json
import math
import re
from dataclasses import dataclass, field
from fnmatch import translate

from davinci_forces.records import KINDS, Record
from davinci_forces.records.catalogue import Catalogue, Provenance
from davinci_forces.records.quantities import PER_ROW
from davinci_forces.records.record import Published
from davinci_forces.report.content.number import Number
from davinci_forces.report.verdicts import is_hidden

REASONS = {  # why a number has no standard error -> patterns of its key; a study may have too few data for one
    "exact": (  # computed without noise from exact numbers
        "log.*.rate", "log.*.duration", "log.*.jitter", "log.*.longest_gap", "path.*", "fit.*.condition",
        "identifiability.*", "correlation.*", "search.*.excess", "excitation.*", "robot.worst_condition",
        "tip.*.condition", "tip.*.near_singular", "sensor.*.range", "*.push_share", "*.push_delay", "*.stream_delay",
        "stability.*.k_t_cqlf", "stability.*.k_t_switching",
    ),
    "stated": ("guess.*", "robot.link.*", "stability.*.hand_*", "stability.*.link_rate"),
    "count": (
        "log.*", "*.periods", "fit.*.samples", "fit.*.hac_lags", "choice.*.parameters", "search.*.searched",
        "search.*.swarms", "search.*.iterations", "contact.*.above", "contact.*.stated", "contact.*.found",
        "tissue.*.pushes", "stream.*.contacts", "stream.*.contacts_found",
    ),
    "simulated truth": ("truth.*", "control.*", "haptics.*", "stability.*"),
    "p-value": ("*_p", "*_p_q", "*_p_dq", "*.white", "weight.*.agreement", "weight.*.agreement_mirrored"),
    "setting": (  # chosen for all further computations
        "choice.*.cutoff", "choice.*.effort_lag", "choice.*.ridge", "choice.*.term.*", "tuning.*", "ekf.*.r_q",
        "ekf.*.r_dq", "ekf.*.q_dq", "ekf.*.q_tau", "haptics.tissue_stiffness", "haptics.at_frequency",
    ),
    "time": ("contact.*.t_peak", "tip.*.onset", "tip.*.release"),  # of a sample, or of a stated window
    "standard deviation": (  # itself one of another number, or a factor of one
        "fit.*.std_noise", "fit.*.std_model", "fit.*.std_classical", "*.filter_part", "*.lag_part", "*.smooth_part",
        "*.band_width", "ekf.*.clock_std", "weight.*.run_std", "weight.*.fit_std", "weight.*.false_mass",
        "weight.*.widening", "weight.*.birge_ratio",
    ),
}  # fmt: skip
TOO_FEW = "too few data"  # for a standard error
PATTERNS = {reason: re.compile("|".join(map(translate, patterns))) for reason, patterns in REASONS.items()}


def reason(key: str) -> str:
    """Why numbers with such a key have no standard error; "" where they should have one."""
    return next((reason for reason, pattern in PATTERNS.items() if pattern.match(key)), "")


@dataclass(frozen=True)
class Result:
    """One number: `source` is the record's file and the field, or the cell, that holds it."""

    key: str
    value: float
    std: float | None
    unit: str
    source: str
    sha256: str
    std_reason: str | None = field(init=False)  # why there is no `std`

    def __post_init__(self) -> None:
        object.__setattr__(self, "std_reason", None if self.std is not None else reason(self.key) or TOO_FEW)

    def number(self, digits: int = 4) -> Number:
        """The number as a report prints it."""
        hidden = self.key.endswith(".model_error") and is_hidden(self.value, self.std)
        least = float(f"{2.0 * (self.std or 0.0):.2g}") if hidden else None
        return Number(self.value, format_unit(self.unit), self.std, self.key, digits, least)


class Results(dict[str, Result]):
    """Results by key, in the order in which they were collected."""

    def add(self, record: Record, number: Published) -> None:
        """Put a number of a record under its key, unless there is one already: joints of a log share some."""
        value, unit = cell(record, number.field, number.row)
        if number.key in self or not math.isfinite(value):
            return
        assert record.origin is not None
        std = cell(record, number.std, number.row)[0] if number.std else math.nan
        known_std = std if math.isfinite(std) else None
        row = "" if number.row is None else f"[{record.row_name(number.row)}]"
        source = f"processed/{record.origin.path}#{number.field}{row}"
        self[number.key] = Result(number.key, value, known_std, unit, source, record.origin.sha256)

    def truth(self, key: str, value: float, unit: str, path: tuple[str, ...], sha256: str) -> None:
        """Put a number of a simulated study's ground truth under a key; `path` leads to it in truth.toml."""
        self[key] = Result(key, value, None, unit, f"raw/truth.toml#{json.dumps(path, ensure_ascii=False)}", sha256)

    def json(self) -> bytes:
        """The content of results.json, a line for each field."""
        # Each number by itself, as `indent` takes an encoder that is four times as slow.
        encoder = json.JSONEncoder(ensure_ascii=False, allow_nan=False, separators=(",\n  ", ": "))
        numbers = (f" {{\n  {encoder.encode(vars(result))[1:-1]}\n }}" for result in self.values())
        return ("[\n" + ",\n".join(numbers) + "\n]\n" if self else "[]\n").encode()


def collect(catalogue: Catalogue) -> Results:
    """Every number that a study's records publish."""
    results = Results()
    for kind in KINDS.values():
        if not kind.PUBLISHED and kind.published is Record.published:  # it has none, and may be large
            continue
        for record in catalogue.records(kind):
            for number in record.published():
                results.add(record, number)
    return results


def cell(record: Record, field: str, row: int | None) -> tuple[float, str]:
    """A scalar of a record, or one row of a column, with its unit; a row may have a unit of its own."""
    value, unit = getattr(record, field), unit_of(record, field)
    if row is None:
        return float(value), unit
    return float(value[row]), str(record.unit[row]) if unit == PER_ROW else unit  # type: ignore[attr-defined]


def unit_of(record: Record, field: str) -> str:
    """The unit of a record's field, "" if the record was not read from a file."""
    return record.origin.units.get(field, "") if record.origin else ""


def format_unit(unit: str) -> str:
    """A unit as it is printed: powers as superscripts, a root as a root, and nothing for a pure number."""
    text = re.sub(r"(\w+)\^0\.5", r"√\1", "" if unit == "1" else unit)
    return re.sub(r"\^(\d)", lambda match: "⁰¹²³⁴⁵⁶⁷⁸⁹"[int(match[1])], text)


MANIFEST = "manifest.txt"


def manifest(provenance: Provenance, made: dict[str, bytes]) -> bytes:
    """Every file that a run reads and makes, pages apart, as `sha256sum --check` takes it.

    Names are `raw/<study>/...`, `processed/<study>/...` and `reports/<study>/...`, wherever these folders are; `made`
    are the files of the report that hold its numbers.
    """
    study = provenance.name
    files = {
        **provenance.raw,
        **{f"processed/{study}/{place}": sha for place, sha in provenance.processed.items()},
        **{f"reports/{study}/{name}": hashlib.sha256(content).hexdigest() for name, content in made.items()},
    }
    return "".join(f"{sha}  {name}\n" for name, sha in sorted(files.items()) if sha).encode()


def identity(listed: bytes) -> str:
    """The report ID: 128 bits of the sha256 of its manifest."""
    return hashlib.sha256(listed).hexdigest()[:32]
