"""Every number of a report under a stable key, with where it comes from: the content of results.json."""

import json
import math
import re
from dataclasses import asdict, dataclass

from pipeline.records import (
    Average,
    Control,
    Excitation,
    Fit,
    Links,
    LogSummary,
    Lyapunov,
    Prediction,
    Record,
    Track,
    Whiteness,
)
from pipeline.records.catalogue import Catalogue
from pipeline.report.content.number import Number


@dataclass(frozen=True)
class Result:
    """One number: `source` is the record's file and the field, or the cell, that holds it."""

    key: str
    value: float
    std: float | None
    unit: str
    source: str
    sha256: str

    def number(self, digits: int = 4) -> Number:
        """The number as a report prints it."""
        return Number(self.value, format_unit(self.unit), self.std, self.key, digits)


class Results(dict[str, Result]):
    """Results by key, in the order in which they were collected."""

    def add(self, record: Record, key: str, name: str, std: str = "") -> None:
        """Put a scalar of a record under a key."""
        assert record.origin is not None
        standard_error = float(getattr(record, std)) if std else None
        unit = record.origin.units.get(name, "")
        self.put(key, float(getattr(record, name)), standard_error, unit, record, f"#{name}")

    def put(self, key: str, value: float, std: float | None, unit: str, record: Record, place: str) -> None:
        """Put a number under a key, with the place in the record's file where it is."""
        assert record.origin is not None
        if math.isfinite(value):
            source = f"processed/{record.origin.path}{place}"
            self[key] = Result(key, value, std, unit, source, record.origin.sha256)

    def truth(self, key: str, value: float, unit: str, path: tuple[str, ...], sha256: str) -> None:
        """Put a number of a simulated study's ground truth under a key; `path` leads to it in truth.toml."""
        self[key] = Result(key, value, None, unit, f"raw/truth.toml#{json.dumps(path, ensure_ascii=False)}", sha256)

    def json(self) -> bytes:
        """The content of results.json."""
        text = json.dumps([asdict(result) for result in self.values()], indent=1, ensure_ascii=False, allow_nan=False)
        return (text + "\n").encode()


def collect(catalogue: Catalogue) -> Results:
    """Every result of a study."""
    results = Results()
    _robot(results, catalogue)
    for summary in catalogue.all(LogSummary):
        for name in ("rows", "rate", "duration", "jitter", "longest_gap", "duplicates", "dropped"):
            results.add(summary, f"log.{summary.log}.{name}", name)
    for average in catalogue.all(Average):
        _average(results, average)
    for fit in catalogue.all(Fit):
        _fit(results, fit)
    for prediction in catalogue.all(Prediction):
        for name in ("rmse", "nrmse", "r2", "relative_error"):
            results.add(prediction, f"{prediction_key(prediction)}.{name}", name)
    for track in catalogue.all(Track):
        for name in ("tau_ext_rms", "nis_mean", "r_q", "r_dq", "q_q", "q_dq", "q_tau"):
            results.add(track, f"ekf.{track.log}.{track.joint}.{name}", name)
    for whiteness in catalogue.all(Whiteness):
        _whiteness(results, whiteness)
    return results


def prediction_key(prediction: Prediction) -> str:
    """`predict.<log>.<joint>.<model>.<estimator>`, or `cv.` where the log itself was fitted."""
    first = "cv" if prediction.role == "identification" else "predict"
    return ".".join((first, *prediction.key))


def slug(text: str) -> str:
    """A name as it stands in a key: 'gravity, sine' is gravity_sine."""
    return re.sub(r"[^a-z0-9]+", "_", text.lower()).strip("_")


def _robot(results: Results, catalogue: Catalogue) -> None:
    for links in catalogue.all(Links):
        results.add(links, "robot.worst_condition", "worst_condition")
        for i, link in enumerate(links.link):
            for name in ("alpha", "a", "d", "offset", "mass"):
                unit = links.origin.units[name] if links.origin else ""
                value = float(getattr(links, name)[i])
                results.put(f"robot.link.{link}.{name}", value, None, unit, links, f"#{name}[{link}]")
    for control in catalogue.all(Control):
        for name in ("start", "reference", "error_10", "error_20", "error_end"):
            results.add(control, f"control.{control.controller}.{control.joint}.{name}", name)
    for lyapunov in catalogue.all(Lyapunov):
        results.add(lyapunov, f"control.{lyapunov.controller}.V_rise", "V_rise")
    for excitation in catalogue.all(Excitation):
        key = f"excitation.{excitation.joint}.{excitation.source}"
        for name in ("period", "objective", "condition", "excess_q", "excess_dq", "excess_ddq"):
            results.add(excitation, f"{key}.{name}", name)
        for i, value in enumerate(excitation.coefficients):
            name = f"{'a' if i == 0 or i % 2 else 'b'}{(i + 1) // 2}"
            results.put(f"{key}.{name}", value, None, "", excitation, f"#coefficients[{i}]")


def _average(results: Results, average: Average) -> None:
    if f"period.{average.log}" not in results:
        results.add(average, f"period.{average.log}", "period", "period_std")
        results.add(average, f"period.{average.log}.periods", "periods")
    for name in ("sigma_q", "sigma_dq", "sigma_tau"):
        results.add(average, f"noise.{average.log}.{average.joint}.{name}", name)


def _fit(results: Results, fit: Fit) -> None:
    key = ".".join(("fit", *fit.key))
    for i, name in enumerate(fit.parameter):
        theta, std, hac, unit = (getattr(fit, c)[i] for c in ("theta", "theta_std", "theta_std_hac", "unit"))
        results.put(f"{key}.{slug(name)}", float(theta), float(hac), unit, fit, f"#theta[{name}]")
        results.put(f"{key}.{slug(name)}.std_classical", float(std), None, unit, fit, f"#theta_std[{name}]")
    for name in ("mse", "r2", "condition", "samples", "periods", "hac_lags"):
        results.add(fit, f"{key}.{name}", name)


def _whiteness(results: Results, w: Whiteness) -> None:
    if w.signal.startswith("innovation_"):
        key, short = f"ekf.{w.log}.{w.joint}", w.signal.removeprefix("innovation_")
        for name in ("acf1", "ljung_box_p", "jarque_bera_p"):
            results.add(w, f"{key}.{name}_{short}", name)
        results.add(w, f"{key}.white", "all_white")
    else:
        for name in ("acf1", "ljung_box_p", "jarque_bera_p", "skewness", "kurtosis", "white"):
            results.add(w, f"whiteness.{w.log}.{w.joint}.{w.signal}.{name}", name)


def format_unit(unit: str) -> str:
    """A unit as it is printed: powers as superscripts, a root as a root, and nothing for a pure number."""
    text = re.sub(r"(\w+)\^0\.5", r"√\1", "" if unit == "1" else unit)
    return re.sub(r"\^(\d)", lambda match: "⁰¹²³⁴⁵⁶⁷⁸⁹"[int(match[1])], text)


def parse_source(source: str) -> tuple[str, str, str]:
    """The file, the field, and the row of a source: 'processed/fit/x.parquet#theta[inertia]'."""
    file, _, place = source.partition("#")
    field, _, row = place.partition("[")
    return file, field, row.removesuffix("]")
