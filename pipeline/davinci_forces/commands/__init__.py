"""What else the command line does: one module per command, exporting `run`, and its name in the list below."""

COMMANDS = (
    "new", "inspect", "verify", "simulate", "robot", "excite", "stability", "haptics", "compare", "campaign",
)  # fmt: skip
