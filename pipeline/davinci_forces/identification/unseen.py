"""What candidates predict of identification logs, by refits that had not seen what they predict.

One scheme leaves blocks of path out, which is what a candidate is chosen by.  The other is that by which the joints'
own fits are judged, so that all can be compared: without the log, or of one log without a period, else a segment.
"""

from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np

from davinci_forces.identification.candidates import Candidate, Library
from davinci_forces.identification.observations import Observed
from davinci_forces.identification.scores import Judge, folds, some
from davinci_forces.maths.arrays import Array, Booleans, Integers
from davinci_forces.maths.models.memory import efforts
from davinci_forces.maths.models.model import Model
from davinci_forces.maths.selection import BLOCKS, MOST, Equations, Ridge, solve
from davinci_forces.records import Prediction
from davinci_forces.records.prediction import ANOTHER_PATH, CHOSEN, SAME_PATH
from davinci_forces.robots.models import Reach
from davinci_forces.robots.robot import Robot


class Scheme(NamedTuple):
    """What refits leave out: cells of the equations, and which of them had not seen each sample of a log."""

    name: str
    path: str  # whether what is left out is repeated in what is kept
    cells: Equations
    out: Booleans  # (G, C) of each refit
    refit: Integers  # (N,) of each sample, from 0; -1 of those that are not predicted


class Refitted:
    """One model of a candidate, to be refitted without some of its cells; what several logs ask for is made once."""

    def __init__(self, model: Model, library: Library, ridge: Ridge, columns: list[int], total: int) -> None:
        self.model, self.logs, self.total = model, {log.number: log for log in library.logs}, total
        self.by_block, self.by_period = library.by_block.columns(columns), library.by_period.columns(columns)
        self._ridge, self._made = ridge, dict[bytes, Array]()

    def theta(self, cells: Equations, out: Booleans) -> Array:
        """The parameters (p,) without some cells (C,); raises LinAlgError where the rest does not tell them apart."""
        key = out.tobytes()
        if key not in self._made:
            self._made[key] = solve(cells.without(out), self._ridge)
        return self._made[key]


def predictions(
    candidate: Candidate, is_chosen: bool, logs: Sequence[Observed], robot: Robot, reaches: dict[str, Reach]
) -> Iterator[Prediction]:
    """The effort of each joint of all logs, by refits of a candidate: as the joints' own fits are judged.

    Of the chosen one also without blocks of path, as `chosen`.  Where a refit cannot be made there is none.
    """
    name = f"{candidate.variant}.{candidate.estimator}"
    each = zip(candidate.models(robot, reaches), candidate.libraries, candidate.ridges(), strict=True)
    every = [
        Refitted(model, library, ridge, library.columns(candidate.friction, reaches), len(logs))
        for model, library, ridge in each
    ]
    for number in (log.number for log in logs):
        for made in (made for made in every if number in made.logs):
            log = made.logs[number]
            if is_chosen:
                yield from by(blocks(made, log, "leave a block of path out"), made, log, CHOSEN, name)
            if name != "independent.lse":  # which is a joint's own fit
                yield from by(as_the_others(made, log), made, log, candidate.variant, candidate.estimator)


def by(scheme: Scheme, made: Refitted, log: Observed, name: str, estimator: str) -> Iterator[Prediction]:
    """The efforts of a model in a log, each sample by the refit that had not seen it, scored where the joint moves."""
    try:
        thetas = np.array([made.theta(scheme.cells, out) for out in scheme.out])
    except np.linalg.LinAlgError:
        return
    kept = scheme.refit >= 0
    tau_hat = efforts(made.model, thetas, log.motion, scheme.refit)[kept]
    names = [record.joint for record in log.records]
    for m, effort in enumerate(made.model.efforts):
        record = some(log.records[names.index(effort)], kept)
        moves = record.standing == 0
        if not record.at_rest and moves.any():
            judge = Judge(record, moves, log.lowpass, log.white.get(effort))
            yield judge.scored(name, estimator, "identification", scheme.name, scheme.path, tau_hat[:, m])


def blocks(made: Refitted, log: Observed, name: str) -> Scheme:
    """Leave each sixth of the path out, that of all logs together."""
    out = np.tile(np.arange(BLOCKS), made.total) == np.arange(BLOCKS)[:, None]
    return Scheme(name, ANOTHER_PATH, made.by_block, out, log.block)


def as_the_others(made: Refitted, log: Observed) -> Scheme:
    """Leave out what the joints' own fits are judged by: the log, with its neighbours of many, or a period of it."""
    if len(made.logs) > 1:
        fold = dict(zip(made.logs, folds(len(made.logs)), strict=True))
        left = [number for number, own in fold.items() if own == fold[log.number]]
        out = np.isin(np.repeat(np.arange(made.total), BLOCKS), left)[None]
        refit = np.where(log.period < 0, -1, 0) if log.period.max() >= 0 else np.zeros_like(log.period)
        name = "leave one log out" if len(left) == 1 else f"leave {len(left)} logs out"
        return Scheme(name, ANOTHER_PATH, made.by_block, out, refit)
    if log.period.max() >= 1:
        periods = np.arange(log.period.max() + 1)
        out = MOST * log.number + periods[:, None] == np.arange(MOST * made.total)
        return Scheme("leave one period out", SAME_PATH, made.by_period, out, log.period)
    return blocks(made, log, "leave a segment out")
