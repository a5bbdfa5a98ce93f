"""Times in a verb's text: in this machine's zone, with its name (JSON has UTC). Pure: the zone may be given.

Times are epoch milliseconds; `zone` None is that of this machine. A time outside the calendar is
shown as dashes.
"""

from __future__ import annotations

from datetime import UTC, datetime, tzinfo

NO_CLOCK = "--:--:--.---"


def moment(ts: float, zone: tzinfo | None = None) -> datetime | None:
    """Return it as a date; None where there is no such date."""
    try:
        return datetime.fromtimestamp(ts / 1000, UTC).astimezone(zone)
    except (OverflowError, ValueError, OSError):
        return None


def clock_text(ts: float, zone: tzinfo | None = None) -> str:
    """Return the time of day: `14:03:27.123 CET`."""
    when = moment(ts, zone)
    return NO_CLOCK if when is None else f"{_clock(when)} {when:%Z}"


def stamp(ts: float, zone: tzinfo | None = None) -> str:
    """Return date and time: `2026-11-21 14:03:27.123 CET`."""
    when = moment(ts, zone)
    return NO_CLOCK if when is None else f"{when:%Y-%m-%d} {_clock(when)} {when:%Z}"


def since_text(ts: float, now: float, zone: tzinfo | None = None) -> str:
    """Return the minute in which something began: `14:03`; `20 Nov 14:03` where that was another day than `now`."""
    began, today = moment(ts, zone), moment(now, zone)
    if began is None:
        return "?"
    same = today is not None and today.date() == began.date()
    return f"{began:%H:%M}" if same else f"{began.day} {_MONTHS[began.month - 1]} {began:%H:%M}"


def zone_name(now: float, zone: tzinfo | None = None) -> str:
    """Return the name of the zone: `CET`."""
    when = moment(now, zone)
    return "?" if when is None else f"{when:%Z}"


def _clock(when: datetime) -> str:
    return f"{when:%H:%M:%S}.{when.microsecond // 1000:03}"


_MONTHS = ("Jan", "Feb", "Mar", "Apr", "May", "Jun", "Jul", "Aug", "Sep", "Oct", "Nov", "Dec")
"""In English whatever the locale: so are the words around it."""
