"""Starts in local time without a zone: where clocks may have been put forward or back between two of them."""

from datetime import datetime, timedelta

MONTHS = (3, 4, 9, 10, 11)  # in which some country's clocks change, on a Sunday night
HOURS = (1, 2, 3)  # at which they do, by local time
REMARK = (
    "times are local and on either side of a Sunday night in which clocks may have been put forward or back; if they "
    "were, the times after it are wrong by an hour: record in UTC, or give what comes after as a log of its own"
)


def clocks_may_change(before: str, after: str) -> bool:
    """Whether clocks may have changed between two moments, in ISO 8601 without a zone."""
    first, last = datetime.fromisoformat(before), datetime.fromisoformat(after)
    sunday = (first - timedelta(days=(first.weekday() + 1) % 7)).replace(hour=0, minute=0, second=0, microsecond=0)
    while sunday <= last:
        changes = (sunday + timedelta(hours=hour) for hour in HOURS if sunday.month in MONTHS)
        if any(first < change <= last for change in changes):
            return True
        sunday += timedelta(days=7)
    return False
