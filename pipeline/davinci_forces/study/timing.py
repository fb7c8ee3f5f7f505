"""When the samples of a log were taken, as far as the log itself tells: what `inspect` shows and `new` writes."""

import re

from davinci_forces.logs.log import Channel, Log

TIME = ("time", "t", "t_s", "elapsed", "x_value", "seconds")


def is_time(channel: Channel) -> bool:
    """Whether a channel is called a time, whatever group it stands in and whatever unit follows its name."""
    return re.split(r"[\s\[(]", channel.name.rpartition("/")[2].strip().lower())[0] in TIME


def has_clock(log: Log) -> bool:
    """Whether the format says when every number was taken, by a clock, by a channel of times, or by one for each."""
    return bool(log.clock or log.time or all(channel.time for channel in log.channels if channel.kind == "number"))


def named_time(log: Log) -> str:
    """The channel that holds the time: the format's own, else one that is called so, unless the format has a clock."""
    if log.time or has_clock(log):
        return log.time
    return next((channel.name for channel in log.channels if channel.kind == "number" and is_time(channel)), "")
