"""The reader's log: what trimesh logs and warns of while this thread reads with it, and nobody else's is touched."""

from __future__ import annotations

import logging
import threading
import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

_lock = threading.Lock()
_here = threading.local()
_readers = 0  # threads between enter and leave of `collected`


class _OwnThread(logging.Filter):
    """Keeps a record that this thread asked for; lets others' pass as if their logger's level had not been lowered."""

    def __init__(self, level: int) -> None:
        super().__init__()
        self.level = level

    def filter(self, record: logging.LogRecord) -> bool:
        """Whether the record goes on to the handlers."""
        kept: list[logging.LogRecord] | None = getattr(_here, "records", None)
        if kept is None:
            return record.levelno >= self.level
        kept.append(record)
        return False


class _Silence:
    """Stands where a filter of warnings has its pattern, and matches any message while this thread reads.

    warnings.catch_warnings would exchange the filters of all threads, and put back those of a moment before.
    """

    def match(self, _: str) -> bool:
        """Whether the warning is this thread's, while it reads."""
        return getattr(_here, "records", None) is not None


_SILENCE: Any = ("ignore", _Silence(), Warning, None, 0)
_lowered: dict[logging.Logger, tuple[int, _OwnThread]] = {}
"""trimesh's loggers while someone reads, with the level each had and the filter it got."""


@contextmanager
def collected() -> Iterator[list[logging.LogRecord]]:
    """The records that trimesh logs in this thread meanwhile, of every level; they, and warnings, go nowhere else.

    trimesh must be imported before it: loggers that are made meanwhile are not heard.
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
    """Lower the levels of trimesh's loggers, filter what comes of it, and silence this thread's warnings."""
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
    """The level that a logger went by before any was lowered."""
    while logger:
        level = _lowered[logger][0] if logger in _lowered else logger.level
        if level:
            return level
        logger = logger.parent
    return logging.NOTSET


def _leave() -> None:
    """For the last reader: put everything back; a level that was set meanwhile stays."""
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
