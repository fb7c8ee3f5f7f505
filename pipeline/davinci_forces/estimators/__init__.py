"""Estimators of model parameters: one module each, exporting `estimate` and its title `NAME`, listed below."""

from importlib import import_module

from davinci_forces.estimators.problem import Estimator

ESTIMATORS = ("lse", "wlse", "pso", "bounded", "prior", "huber", "iv", "tls", "consistent")


def estimator(name: str) -> Estimator:
    """Return the estimator of that name."""
    estimate: Estimator = import_module(f"davinci_forces.estimators.{name}").estimate
    return estimate


def title_of(name: str) -> str:
    """Return the title of an estimator, as `least squares`, or the name if it is no estimator's."""
    return str(import_module(f"davinci_forces.estimators.{name}").NAME) if name in ESTIMATORS else name
