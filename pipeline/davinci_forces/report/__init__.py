"""How results are shown: sections of content, and the two writers that turn them into HTML and PDF."""

REPORT = "report"  # the step of a run that follows all stages

# Every file that a report has or had, in any version.
FILES = (
    "report.html", "report.pdf", "robot.html", "robot.pdf", "results.json", "summary.txt", "summary.json",
    "manifest.txt", "references.bib",
)  # fmt: skip
