"""Out-of-sample predictions of identification logs by candidates.

One scheme leaves blocks of path out; a candidate is chosen by this scheme.  The other scheme is that of the joints' own
fits, for comparison.  It leaves out the log or, with a single log, a period or a segment.
"""

from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np

from davinci_forces.identification.candidates import Candidate, CandidatePart
from davinci_forces.identification.observations import Observed, is_evaluated
from davinci_forces.identification.scores import Scorer, folds, select_samples
from davinci_forces.maths.arrays import Array, Booleans, Integers
from davinci_forces.maths.models.memory import efforts
from davinci_forces.maths.selection import MAX_GROUPS, PATH_BLOCKS, Equations, excited_parameters, solve, sum_all
from davinci_forces.records import Diagnostic, Prediction, diagnostic
from davinci_forces.records.prediction import ANOTHER_PATH, CHOSEN, CHOSEN_BY_LOG, SAME_PATH


class Scheme(NamedTuple):
    """The cells of the equations that refits leave out, and the refit that predicts each sample of a log."""

    name: str
    path: str  # whether the path left out is repeated in the fitted data
    cells: Equations
    out: Booleans  # (G, C) the cells that each refit leaves out
    refit: Integers  # (N,) number of the refit that predicts each sample, from 0; -1 for none


class RefitModel:
    """One part of a candidate, refitted without some of its cells; each refit is computed once."""

    def __init__(self, part: CandidatePart, total: int) -> None:
        self.model, self.logs, self.total = part.model, {log.number: log for log in part.library.logs}, total
        self.by_block, self.by_period = part.by_block, part.by_period
        self._ridge, self._thetas = part.ridge, dict[bytes, Array]()

    def excites_all(self, cells: Equations, out: Booleans) -> bool:
        """Whether the cells of a refit excite every base parameter that all cells excite."""
        return excited_parameters(cells.sum_cells(~out), self._ridge) == excited_parameters(sum_all(cells), self._ridge)

    def theta(self, cells: Equations, out: Booleans) -> Array:
        """Fit the parameters (p,) without some cells (C,); raises LinAlgError if the others do not separate them."""
        key = out.tobytes()
        if key not in self._thetas:
            self._thetas[key] = solve(cells.sum_cells(~out), self._ridge)
        return self._thetas[key]


def predictions(candidate: Candidate, is_chosen: bool, logs: Sequence[Observed]) -> Iterator[Prediction | Diagnostic]:
    """Predict the effort of each joint of all logs by refits of a candidate, by the scheme of the joints' own fits.

    The chosen candidate is refitted without blocks of path, as `chosen`, and without whole logs if it has several, as
    `chosen_by_log`.  Without a refit there is no prediction.
    """
    name = f"{candidate.variant}.{candidate.estimator}"
    models = [RefitModel(part, len(logs)) for part in candidate.parts]
    for number in (log.number for log in logs):
        for model in (model for model in models if number in model.logs):
            log = model.logs[number]
            if is_chosen:
                scheme = leave_blocks_out(model, log, "leave a block of path out")
                yield from predict_scheme(scheme, model, log, CHOSEN, name)
                if len(model.logs) > 1:
                    yield from predict_scheme(scheme_of_own_fits(model, log), model, log, CHOSEN_BY_LOG, name)
            elif name != "independent.lse":  # this candidate is the joint's own fit
                scheme = scheme_of_own_fits(model, log)
                yield from predict_scheme(scheme, model, log, candidate.variant, candidate.estimator)


def predict_scheme(
    scheme: Scheme, refits: RefitModel, log: Observed, name: str, estimator: str
) -> Iterator[Prediction | Diagnostic]:
    """Predict the efforts of a model in a log, each sample out of sample, and score the moving samples."""
    if not all(refits.excites_all(scheme.cells, out) for out in scheme.out):
        text = f"{log.records[0].log}: {name}, {estimator} has no leave-out score of {', '.join(refits.model.efforts)}"
        why = "the data that are not left out excite fewer of its parameters"
        yield diagnostic("choose", "arm", "note", f"{text}, because {why}")
        return
    try:
        thetas = np.array([refits.theta(scheme.cells, out) for out in scheme.out])
    except np.linalg.LinAlgError:
        return
    is_predicted = scheme.refit >= 0
    predicted = {
        p: efforts(refits.model, thetas, log.motion(i), scheme.refit)[is_predicted]
        for p, i in {p: i for i, p in enumerate(log.processing) if log.joints[i] in refits.model.efforts}.items()
    }
    for m, effort in enumerate(refits.model.efforts):
        i = log.joints.index(effort)
        record = select_samples(log.records[i], is_predicted)
        moves = is_evaluated(record)
        if not record.at_rest and moves.any():
            tau_hat = predicted[log.processing[i]][:, m]
            scorer = Scorer(record, moves, log.lowpass, log.white.get(effort))
            yield scorer.score(name, estimator, "identification", scheme.name, scheme.path, tau_hat)


def leave_blocks_out(refits: RefitModel, log: Observed, name: str) -> Scheme:
    """Leave each sixth of the path out, of all logs together."""
    out = np.tile(np.arange(PATH_BLOCKS), refits.total) == np.arange(PATH_BLOCKS)[:, None]
    return Scheme(name, ANOTHER_PATH, refits.by_block, out, log.block)


def scheme_of_own_fits(refits: RefitModel, log: Observed) -> Scheme:
    """Leave out what the joints' own fits leave out: the fold of the log or, of a single log, a period or a segment."""
    if len(refits.logs) > 1:
        fold = dict(zip(refits.logs, folds(len(refits.logs)), strict=True))
        omitted = [number for number in fold if fold[number] == fold[log.number]]
        out = np.isin(np.repeat(np.arange(refits.total), PATH_BLOCKS), omitted)[None]
        refit = np.where(log.period < 0, -1, 0) if log.period.max() >= 0 else np.zeros_like(log.period)
        name = "leave one log out" if len(omitted) == 1 else f"leave {len(omitted)} logs out"
        return Scheme(name, ANOTHER_PATH, refits.by_block, out, refit)
    if log.period.max() >= 1:
        periods = np.arange(log.period.max() + 1)
        out = MAX_GROUPS * log.number + periods[:, None] == np.arange(MAX_GROUPS * refits.total)
        return Scheme("leave one period out", SAME_PATH, refits.by_period, out, log.period)
    return leave_blocks_out(refits, log, "leave a segment out")
