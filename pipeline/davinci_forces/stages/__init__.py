"""The stages of the analysis, in order: one module per stage, in the folder of its group.

A stage is a module whose docstring says what it does.  It exports up to three pure functions from records to records.
Each function waits only for the records that it reads:

    run      is called first, as a rule for one log or record.
    gather   combines what `run` made of all logs.
    apply    is called for each log again, with what `gather` made.

The signature of each declares everything that it needs:

    signal: Signal              called once for each record of that kind; `Track | Residual` takes either kind
    signals: Sequence[Signal]   called once a log, with the records of all its joints
    signals: Collection[Signal] the same, but each is read at every iteration, not before
    log: Log                    called once for each log of the study, opened
    average: Average | None     the record of that kind about the same, if there is one
    fits: Iterable[Fit]         all records of that kind about the same; the stage waits for all
    motions: Annotated[Iterable[Motion], "identification"]   records of logs of one role, each read at its iteration
    entry: LogEntry             what the study says of the log
    joint: Joint, robot: Robot  what the robot is
    weighings: Weighings        the masses of all weight logs; without weight logs, the stage is not called
    haptics: HapticScenario     the simulated hand that palpates the tissue
    *, lowpass: float           a setting of the study, by name
    -> Iterator[Average | Diagnostic] the kinds of record it makes

"About the same" means the same log and joint, as far as the call and the record have one.  A call for a log and a joint
gets the fits of its joint; a call for neither gets all fits.  So what a call reads does not grow with the study, unless
it is the only call of its function.  The report is not a stage: it reads everything.
"""

# A stage comes after the stages whose records it reads.  A group of one stage has the stage's name, and no folder.
GROUPS = {
    "design": ("design",),
    "recordings": ("ingest", "resample", "average", "differentiate"),
    "model": ("fit", "choose", "predict"),
    "forces": ("tune", "calibrate", "ekf", "assess", "measure", "stream", "benchmark", "whiteness"),
    "tip": ("resolve", "sense"),
    "weigh": ("weigh",),
    "tissue": ("palpate", "haptic-limits"),
}
STAGES = tuple(stage for stages in GROUPS.values() for stage in stages)


def module(stage: str) -> str:
    """Import name of the module of a stage."""
    group = next(group for group, stages in GROUPS.items() if stage in stages)
    return ".".join(["davinci_forces.stages", *([] if group == stage else [group]), stage.replace("-", "_")])
