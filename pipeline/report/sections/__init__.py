"""What a report says, in order: one module per section, exporting `section`, and its name in the list below.

section(context: Context) -> Section | None        None where a study has nothing to say on it
"""

SECTIONS = (
    "summary", "recorded", "noise", "identification", "prediction", "filter", "truth", "robot", "control", "excitation",
    "methods", "provenance",
)  # fmt: skip
