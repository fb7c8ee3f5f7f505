"""A joint's page shows the model that the filter used: its parameters, its residual, and what it changes."""

import json
from pathlib import Path

import numpy as np
import pytest

import davinci_forces
from davinci_forces.records.record import slug

JOINT = "hand_roll"
LOG = "roll"


@pytest.fixture(scope="module")
def page(analysed) -> str:
    """The section of the joint in the report, as HTML."""
    text = (analysed.parent.parent / "reports/arm/report.html").read_text()
    start = text.index(f'id="fit-{JOINT}"')
    return text[start : text.index('id="choice"', start)]


def used_fit(analysed: Path):
    """The rows of the fit that the joint's model names, which is the chosen one."""
    model = davinci_forces.read(analysed, "JointModel", joint=JOINT)
    names = {(m, e) for m, e in zip(model["model"], model["estimator"], strict=True)}
    assert len(names) == 1
    [(name, estimator)] = names
    fits = davinci_forces.read(analysed, "Fit", model=name, estimator=estimator)
    return name, estimator, fits[fits["group"] == JOINT]


def test_the_table_lists_the_parameters_of_the_model_that_was_used(analysed, page):
    name, estimator, fit = used_fit(analysed)
    table = page[page.index(f'id="theta-{JOINT}"') :].split("</table>")[0]
    keys = [f"fit.{JOINT}.{name}.{estimator}.{slug(parameter)}" for parameter in fit["parameter"]]
    assert [key for key in keys if key not in table] == []
    assert f"fit.{JOINT}.independent.lse.inertia" not in table


def test_the_residual_is_that_of_the_model_averaged_over_the_periods(analysed):
    """By hand: samples of the whole periods, sorted into phases, of measured minus modelled effort."""
    name, estimator, _ = used_fit(analysed)
    logs = set(davinci_forces.read(analysed, "Average", joint=JOINT)["log"])
    for log in logs:
        average = davinci_forces.read(analysed, "Average", log=log, joint=JOINT)
        model = davinci_forces.read(analysed, "JointModel", log=log, joint=JOINT)
        found = davinci_forces.read(analysed, "Residual", log=log, joint=JOINT, model="chosen")
        assert set(found["estimator"]) == {f"{name}.{estimator}"}
        period, K = average["period"].iloc[0], len(average)
        since = model["t"].to_numpy() - average["t_start"].iloc[0]
        inside = (since > -1e-9) & (since < average["periods"].iloc[0] * period - 1e-9)
        inside &= (model["unscored"] == 0).to_numpy()
        phase = np.round(since[inside] / period * K).astype(int) % K
        left = (model["tau"] - model["tau_hat"]).to_numpy()[inside]
        expected = np.bincount(phase, left, K) / np.bincount(phase, minlength=K)
        ours = (found["tau"] - found["tau_hat"]).to_numpy()
        assert np.abs(ours - expected).max() < 0.05 * expected.std()


def test_the_plain_fit_stands_beside_and_advice_does_not_propose_what_was_tried(page):
    main, _, beside = page.partition(f'id="all-fits-{JOINT}"')
    assert "Compared with the plain model (this joint alone, by least squares (LSE))" in main
    assert "Worth trying" not in main
    assert f"fit.{JOINT}.independent.lse.inertia" in beside


def test_what_the_model_gains_is_the_error_of_its_worst_log_that_was_not_fitted(analysed, page):
    results = {
        row["key"]: row["value"]
        for row in json.loads((analysed.parent.parent / "reports/arm/results.json").read_text())
    }
    predicted = davinci_forces.read(analysed, "Prediction", joint=JOINT, model="chosen")
    logs = set(predicted[predicted["role"] != "identification"]["log"])
    errors = {log: results[f"predict.{log}.{JOINT}.chosen.relative_error"] for log in logs}
    worst = max(errors, key=lambda log: errors[log])
    assert f"its relative residual (noise included) is largest in {worst}" in page
    assert f"{errors[worst]:.3g}" in page
