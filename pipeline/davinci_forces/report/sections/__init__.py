"""The sections of a report, in order: one module per section, exporting `section`, and its name in the list below.

section(context: Context) -> Section | None        None if a study has no such content

They share `parts`, where `section_of` makes this function of one that yields blocks.  What they explain before their
numbers and in captions stands in explanations.md, by the name of the section, table or figure.  The methods stand in
methods.md, by the kind of record that each one makes.
"""

# The file, the title and the sections of each document.
DOCUMENTS: dict[str, tuple[str, tuple[str, ...]]] = {
    "report": (
        "Contact forces without a force sensor",
        ("summary", "baseline", "contacts", "tip", "sensor", "tissue", "stability", "haptics", "weight", "joints",
         "choice", "prediction", "noise", "filters", "runs", "innovations", "ground_truth", "methods", "provenance",
         "review"),
    ),
    "robot": ("The robot", ("robot", "control", "excitation", "thesis")),
}  # fmt: skip
SECTIONS = tuple(name for _, names in DOCUMENTS.values() for name in names)
