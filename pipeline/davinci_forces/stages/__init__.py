"""What is done, in order: one module per stage, in the folder of its group, and its name in the groups below.

A stage is a module whose docstring says what it does.  It exports up to three pure functions from records to records,
of which none waits for more than it reads:

    run      what is done first, as a rule about one log or record
    gather   brings together what `run` made of every log
    apply    goes back to the logs with what `gather` made

The signature of each is the declaration of everything it needs:

    signal: Signal              called once for each record of that kind; `Track | Residual` takes either kind
    signals: Sequence[Signal]   called once a log, with the records of all its joints
    signals: Collection[Signal] the same, but each is read when the stage comes to it, and again when it comes again
    log: Log                    called once for each log of the study, opened
    average: Average | None     the record of that kind about the same, where there is one
    fits: Iterable[Fit]         all records of that kind about the same; the stage waits for them
    motions: Annotated[Iterable[Motion], "identification"]   those of logs of one role, each read when it is come to
    entry: LogEntry             what the study says of the log
    joint: Joint, robot: Robot  what the robot is
    weighings: Weighings        the masses of all weight logs; where the study has none, the stage is not called
    haptics: HapticScenario     the simulated hand that feels the tissue
    *, lowpass: float           a setting of the study, by name
    -> Iterator[Average | Diagnostic] the kinds of record it makes

"About the same" is about the log and the joint of the call, as far as the call and the record are about any: a call for
a log and a joint gets the fits of its joint, and one that is about neither gets all there are.  So what a call reads
does not grow with the study, unless it is the only one of its function.  The report is no stage: it reads everything.
"""

# What makes a record stands before what reads it.  A group of one stage has its name, and no folder.
GROUPS = {
    "design": ("design",),
    "recordings": ("ingest", "resample", "average", "differentiate"),
    "model": ("fit", "choose", "predict"),
    "forces": ("tune", "calibrate", "ekf", "assess", "measure", "benchmark", "whiteness"),
    "tip": ("resolve", "sense"),
    "weigh": ("weigh",),
    "tissue": ("palpate", "haptic-limits"),
}
STAGES = tuple(stage for stages in GROUPS.values() for stage in stages)


def module(stage: str) -> str:
    """The name by which the module of a stage is imported."""
    group = next(group for group, stages in GROUPS.items() if stage in stages)
    return ".".join(["davinci_forces.stages", *([] if group == stage else [group]), stage.replace("-", "_")])
