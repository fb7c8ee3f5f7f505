"""How results are shown: sections of content, and the two writers that turn them into HTML and PDF."""

REPORT = "report"  # the step of a run that follows all stages
