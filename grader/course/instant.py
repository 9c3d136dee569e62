"""Points in time, as people write them in YAML and rosters, and as reports show them."""

from __future__ import annotations

from datetime import datetime, timedelta, timezone
from zoneinfo import ZoneInfo, available_timezones

from grader.spec.nearest_name import did_you_mean

_SHORTEST = len("2026-10-12 23:59")
_YEARS = range(1970, 3000)
"""Others cannot be counted with in every zone, and are a slip of the pen, or of a clock."""


def time_zone(name: str) -> str:
    """The name of a time zone that exists; a ValueError names the nearest."""
    # A name of the list only: ZoneInfo opens what is no zone, such as a folder of them.
    if name not in available_timezones():
        nearest = did_you_mean(name, available_timezones())
        text = f"{name!r} is not a time zone of the IANA list, such as 'Europe/Berlin'.{nearest}"
        raise ValueError(text)
    return name


def read_time(text: str) -> datetime:
    """Read a date and a time of day, perhaps with an offset; a ValueError says what is wrong."""
    try:
        if len(text) < _SHORTEST:
            raise ValueError
        moment = datetime.fromisoformat(text.removesuffix("Z") + "+00:00" * text.endswith("Z"))
        if moment.year not in _YEARS:
            raise ValueError
        return moment
    except ValueError:
        raise ValueError(
            f"{text!r} is not a date with a time of day: write it as '2026-10-12 23:59', or with "
            "its offset as '2026-10-12 23:59+02:00'"
        ) from None


def instant(text: str, zone: str | None) -> datetime:
    """The point in time that a text means in a time zone; a ValueError where it means none."""
    moment = read_time(text)
    if moment.tzinfo is not None:
        return moment.astimezone(ZoneInfo(zone)) if zone else moment
    if zone is None:
        raise ValueError(
            f"{text!r} has no time zone: write `time_zone: Europe/Berlin` at the top, or an "
            f"offset: '{text}+02:00'"
        )
    local = moment.replace(tzinfo=ZoneInfo(zone))
    if local.utcoffset() != local.replace(fold=1).utcoffset():
        back = utc(local).astimezone(local.tzinfo).replace(tzinfo=None)
        what = "is there twice" if back == moment else "does not exist"
        raise ValueError(
            f"{text!r} {what} in {zone}, because the clocks are changed then: write another time, "
            "or its offset behind it"
        )
    return local


def utc(moment: datetime) -> datetime:
    """A time in UTC: two of one zone would be compared by what the clock shows."""
    return moment.astimezone(timezone.utc)


def later(due: datetime, count: int, per: str) -> datetime:
    """A due time moved by hours, or by days: noon and a day is noon, also in March."""
    if per == "day":
        return due + timedelta(days=count)
    return (utc(due) + timedelta(hours=count)).astimezone(due.tzinfo)


def shown_time(moment: datetime) -> str:
    """A time with its zone or offset: ``2026-10-12 23:59 Europe/Berlin``."""
    name = str(moment.tzinfo) if moment.tzinfo is not None else "without a zone"
    return f"{moment:%Y-%m-%d %H:%M} {name}"


def shown_length(length: timedelta) -> str:
    """How long, for people: ``20 min``, ``3 h 5 min``, ``2 days 1 h 5 min``."""
    minutes = int(length.total_seconds() // 60)
    days, hours, minutes = minutes // 1440, minutes // 60 % 24, minutes % 60
    parts = ((days, "day" if days == 1 else "days"), (hours, "h"), (minutes, "min"))
    return " ".join(f"{count} {unit}" for count, unit in parts if count)
