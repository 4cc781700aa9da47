"""The reader's log: collects what trimesh logs and warns of in this thread. Other threads are not affected."""

from __future__ import annotations

import logging
import threading
import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

_lock = threading.Lock()
_here = threading.local()
_readers = 0  # threads that are now between enter and leave of `collected`


class _OwnThread(logging.Filter):
    """Collects the records of a thread that reads, and passes on those of other threads.

    The logger's level has been lowered. For other threads, the filter behaves as if it had not.
    """

    def __init__(self, level: int) -> None:
        super().__init__()
        self.level = level

    def filter(self, record: logging.LogRecord) -> bool:
        """Return whether the record goes on to the handlers."""
        kept: list[logging.LogRecord] | None = getattr(_here, "records", None)
        if kept is None:
            return record.levelno >= self.level
        kept.append(record)
        return False


class _Silence:
    """Takes the place of the message pattern in a warnings filter. It matches any message while this thread reads.

    warnings.catch_warnings is no substitute: it replaces the filters of all threads, and later restores old ones.
    """

    def match(self, _: str) -> bool:
        """Return whether this thread is reading, and so the warning is its own."""
        return getattr(_here, "records", None) is not None


_SILENCE: Any = ("ignore", _Silence(), Warning, None, 0)
_lowered: dict[logging.Logger, tuple[int, _OwnThread]] = {}
"""trimesh's loggers while any thread reads, with the level that each had and the filter that each was given."""


@contextmanager
def collected() -> Iterator[list[logging.LogRecord]]:
    """Yield the list of the records that trimesh logs in this thread meanwhile, of every level.

    These records go nowhere else, nor do this thread's warnings. Import trimesh first: a logger that is created later
    is not collected.
    """
    outer = getattr(_here, "records", None)
    records = list[logging.LogRecord]()
    _enter()
    _here.records = records
    try:
        yield records
    finally:
        _here.records = outer
        _leave()


def _enter() -> None:
    """Lower the levels of trimesh's loggers, filter the extra records, and silence this thread's warnings."""
    global _readers
    with _lock:
        _readers += 1
        known = logging.root.manager.loggerDict.items()
        ours = [logger for name, logger in known if name.split(".")[0] == "trimesh"]
        for logger in ours:
            if isinstance(logger, logging.Logger) and logger not in _lowered:
                _lowered[logger] = logger.level, _OwnThread(_wanted(logger))
                logger.addFilter(_lowered[logger][1])
        for logger in _lowered:
            logger.setLevel(logging.DEBUG)
        if _SILENCE not in warnings.filters:
            warnings.filters.insert(0, _SILENCE)  # type: ignore[attr-defined]


def _wanted(logger: logging.Logger | None) -> int:
    """Return the level that applied to a logger before any level was lowered."""
    while logger:
        level = _lowered[logger][0] if logger in _lowered else logger.level
        if level:
            return level
        logger = logger.parent
    return logging.NOTSET


def _leave() -> None:
    """If this is the last reader, restore everything. A level that someone has set meanwhile stays."""
    global _readers
    with _lock:
        _readers -= 1
        if _readers:
            return
        for logger, (level, own) in _lowered.items():
            logger.removeFilter(own)
            if logger.level == logging.DEBUG:
                logger.setLevel(level)
        _lowered.clear()
        if _SILENCE in warnings.filters:
            warnings.filters.remove(_SILENCE)  # type: ignore[attr-defined]
