"""Commands besides the stages: each module exports `run`, and its docstring is the help; `COMMANDS` lists them."""

COMMANDS = (
    "new", "inspect", "verify", "simulate", "robot", "excite", "stability", "haptics", "compare", "campaign", "export",
    "guide",
)  # fmt: skip
