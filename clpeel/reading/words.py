"""Words: errors of readers in words, for a message."""

from __future__ import annotations


def one_line(error: BaseException) -> str:
    """Return an error's type and message on one short line, with control characters escaped."""
    text = "".join(c if c.isprintable() else repr(c)[1:-1] for c in " ".join(str(error).split()))
    shown = text if len(text) <= 120 else f"{text[:119]}…"
    return f"{type(error).__name__}: {shown}" if shown else type(error).__name__
