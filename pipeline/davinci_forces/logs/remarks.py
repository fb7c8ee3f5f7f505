"""What a reader remarks on while it goes through a log, without drowning the few in the many."""

import re
from collections import Counter

MOST = 5  # of a kind that are told one by one
NUMBERS = re.compile(r"\d+")


class Remarks:
    """Adds to a list of warnings; those that differ in their numbers only are counted after the first few."""

    def __init__(self, warnings: list[str]) -> None:
        self.warnings = warnings
        self.kinds: Counter[str] = Counter()

    def __call__(self, remark: str) -> None:
        """Remark on something."""
        kind = NUMBERS.sub("#", remark)
        self.kinds[kind] += 1
        if self.kinds[kind] <= MOST:
            self.warnings.append(remark)

    def close(self) -> None:
        """Say how many were not told."""
        for kind, count in self.kinds.items():
            if count > MOST:
                self.warnings.append(f"{count - MOST} more times: {kind}")
