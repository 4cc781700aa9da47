"""Memory: what a render may take of the device's, and how what it may is said."""

from __future__ import annotations

import re

from clpeel.errors import InputError

MIN_MEMORY = 1 << 20
"""Bytes that fragments are given at least, however little is left of the budget."""

MOST_LISTED = 2**31
"""Bytes of a batch's lists: places in them are below 2**29, and so signed numbers of 32 bits (peeling.h)."""


def parse_memory(memory: int | str) -> int:
    """Bytes from a number or from text such as "512M" or "2G" (powers of 1024), or InputError."""
    match = re.fullmatch(r"\s*(\d+(?:\.\d+)?)\s*([KMGT]?)(?:i?B)?\s*", str(memory), re.IGNORECASE)
    if not match:
        raise InputError(f"memory: expected bytes or a size such as 512M, got {memory!r}")
    nbytes = int(float(match[1]) * 1024 ** " KMGT".index(match[2].upper() or " "))
    if nbytes < MIN_MEMORY:
        raise InputError(f"memory: expected at least 1M, got {memory!r}")
    return nbytes
