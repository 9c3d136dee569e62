"""Points in time, as people write them in YAML and in rosters, and as reports show them."""

from __future__ import annotations

import re
from datetime import datetime, timedelta, timezone
from zoneinfo import ZoneInfo, available_timezones

from grader.spec.nearest_name import did_you_mean

_WRITTEN = re.compile(
    r"(\d{4}-\d\d-\d\d)[T ](\d\d:\d\d)(:\d\d)?(?:\.\d+)? ?(?:(Z|UTC)|([+-]\d\d):?(\d\d))?"
)
_SHOWN = "%Y-%m-%d %H:%M"


def time_zone(name: str) -> str:
    """The name of a time zone that exists; a ValueError names the nearest."""
    try:
        ZoneInfo(name)
    except (KeyError, ValueError, OSError):
        # A KeyError is ZoneInfoNotFoundError; a folder of zones, such as Europe, is an OSError.
        nearest = did_you_mean(name, available_timezones())
        raise ValueError(
            f"{name!r} is not a time zone of the IANA list, such as 'Europe/Berlin'.{nearest}"
        ) from None
    return name


def read_time(text: str) -> datetime:
    """Read a date and a time of day, perhaps with an offset; a ValueError says what is wrong."""
    match = _WRITTEN.fullmatch(text.strip())
    if match is None:
        raise ValueError(
            f"{text!r} is not a date with a time of day: write it as '2026-10-12 23:59', or with "
            "its offset as '2026-10-12 23:59+02:00'"
        )
    day, minutes, seconds, utc, hours, rest = match.groups()
    offset = "+00:00" if utc else f"{hours}:{rest}" if hours else ""
    try:
        return datetime.fromisoformat(f"{day}T{minutes}{seconds or ':00'}{offset}")
    except ValueError as error:
        raise ValueError(f"{text!r} does not exist: {error}") from None


def instant(text: str, zone: str | None) -> datetime:
    """The point in time that a text means in a time zone; a ValueError where it means none."""
    moment = read_time(text)
    if zone is None:
        if moment.tzinfo is None:
            raise ValueError(
                f"{text!r} has no time zone: write `time_zone: Europe/Berlin` at the top, or an "
                f"offset: '{text}+02:00'"
            )
        return moment
    place = ZoneInfo(zone)
    if moment.tzinfo is not None:
        return moment.astimezone(place)
    local = moment.replace(tzinfo=place)
    if local.utcoffset() != local.replace(fold=1).utcoffset():
        back = local.astimezone(timezone.utc).astimezone(place)
        what = "is there twice" if back.replace(tzinfo=None) == moment else "does not exist"
        raise ValueError(
            f"{text!r} {what} in {zone}, because the clocks are changed then: write another time, "
            "or its offset behind it"
        )
    return local


def later(due: datetime, count: int, per: str) -> datetime:
    """A due time moved by hours, or by days: noon and a day is noon, also in March."""
    if per == "day":
        return due + timedelta(days=count)
    return (due.astimezone(timezone.utc) + timedelta(hours=count)).astimezone(due.tzinfo)


def shown_time(moment: datetime) -> str:
    """A time with its zone or offset: ``2026-10-12 23:59 Europe/Berlin``."""
    zone = moment.tzinfo
    name = zone.key if isinstance(zone, ZoneInfo) else moment.strftime("%z") or "without a zone"
    return f"{moment.strftime(_SHOWN)} {name}"


def shown_length(length: timedelta) -> str:
    """How long, for people: ``20 min``, ``3 h 5 min``, ``2 days 1 h``."""
    minutes = int(length.total_seconds() // 60)
    days, hours = minutes // 1440, minutes // 60 % 24
    parts = [
        (days, "day" if days == 1 else "days"),
        (hours, "h"),
        (0 if days else minutes % 60, "min"),
    ]
    return " ".join(f"{count} {unit}" for count, unit in parts if count) or "0 min"
