"""Steps of a clock that did not pass, taken out of it."""

from collections.abc import Iterator

import numpy as np

from davinci_forces.logs.log import Block
from davinci_forces.maths.periods.steps import REACH, steps
from davinci_forces.study.intake.clocks import ALIGNED
from davinci_forces.study.intake.reading import Intake


def mended(intake: Intake, blocks: Iterator[Block]) -> Iterator[Block]:
    """The blocks with steps of the clock taken out of its channel, where the motion tells that no time passed.

    Of identification logs only: others lose nothing by a gap, and their contact windows count on their clock.
    The end of a block waits for the next, which says how the motion goes on.
    """
    several = intake.clocks.are_several
    name = ALIGNED if several else intake.clocks.time
    whole = (intake.without_cut_end(block) for block in blocks)
    if not (name or several) or intake.entry.role != "identification":
        yield from whole
        return
    stated = intake.clocks.groups[0].is_stated and not several
    scale = intake.sources["time"].sign * intake.scales["time"] if stated else 1.0
    passed = 0.0  # by the channel, in its unit, while nothing moved on
    waiting: Block = {}
    for block in whole:
        late = block | {name: block[name] - passed} if passed else block
        joined = {key: np.concatenate([waiting[key], late[key]]) for key in late} if waiting else late
        for i, jump in steps(intake.times(joined), intake.positions(joined)):
            joined = joined | {name: joined[name] - np.where(np.arange(len(joined[name])) < i, 0.0, jump / scale)}
            passed += jump / scale
            intake.jumps.append((float(intake.times(joined)[i - 1]), jump))
        ready = max(len(joined[name]) - 2 * REACH, 0)
        waiting = {key: values[ready:] for key, values in joined.items()}
        yield {key: values[:ready] for key, values in joined.items()}
    if waiting:
        yield waiting
