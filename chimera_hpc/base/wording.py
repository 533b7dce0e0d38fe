"""Values and names as text in one-line messages."""

from __future__ import annotations

from difflib import get_close_matches


def short(value: object) -> str:
    """Return the value as text for a one-line message."""
    if isinstance(value, int) and abs(value) >= 10**30:
        return "a huge integer"  # Python refuses to print integers with too many digits
    try:
        text = repr(value)
    except RecursionError:
        return "a deeply nested value"
    return text if len(text) <= 60 else text[:57] + "..."


def number_of(n: int, what: str) -> str:
    """Return a count with its noun: ``1 node``, ``3 nodes``."""
    return f"{n} {what}" if n == 1 else f"{n} {what}s"


def nearest(name: str, known: list[str]) -> str:
    """Return '; did you mean X?' or, without a similar name, '; known: X, Y, Z'."""
    near = get_close_matches(name[:60], known, n=1)
    return f"; did you mean {near[0]}?" if near else f"; known: {', '.join(known)}"


def in_bytes(size: float) -> str:
    """Write a number of bytes for people."""
    for unit in ("B", "kB", "MB", "GB"):
        if size < 1000:
            return f"{size:.0f} {unit}" if unit == "B" else f"{size:.3g} {unit}"
        size /= 1000
    return f"{size:.3g} TB"


def in_time(seconds: float) -> str:
    """Write a duration for people."""
    if seconds < 120:
        return f"{seconds:.0f} s"
    if seconds < 7200:
        return f"{seconds / 60:.0f} min"
    return f"{seconds / 3600:.3g} h"
