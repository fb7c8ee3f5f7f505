"""What is done, in order: one module per stage, and its name in the list below.

A stage is a module whose docstring says what it does and whose `run` is a pure function from records to records.
The signature of `run` is the declaration of everything it needs:

    signal: Signal              called once for each record of that kind; `Track | Residual` takes either kind
    average: Average | None     the record of that kind about the same log and joint, where there is one
    signals: Sequence[Signal]   called once a log, with the records of all its joints
    fits: Iterable[Fit]         all records of that kind; the stage waits for them
    log: Log                    called once for each log of the study, opened
    entry: LogEntry             what the study says of the log
    joint: Joint, robot: Robot  what the robot is
    study: Study                the whole study
    *, lowpass: float           a setting of the study, by name
    -> Iterator[Average | Diagnostic] the kinds of record it makes
"""

STAGES = (
    "design", "ingest", "resample", "average", "differentiate", "fit", "predict", "ekf", "assess", "measure",
    "whiteness", "report",
)  # fmt: skip
