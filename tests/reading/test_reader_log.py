"""The reader's log is heard in the thread that reads, and everybody else's logging and warnings stay as they were."""

from __future__ import annotations

import logging
import threading
import warnings
from typing import Any

import pytest

from clpeel.reading.reader_log import collected

pytest.importorskip("trimesh")
LOG = logging.getLogger("trimesh")


class Kept(logging.Handler):
    """Keeps the texts of its records."""

    def __init__(self) -> None:
        super().__init__()
        self.texts: list[str] = []

    def emit(self, record: logging.LogRecord) -> None:
        """Keep the record's text."""
        self.texts.append(record.getMessage())


def test_records_of_every_level_are_collected_and_go_nowhere_else(caplog: Any, recwarn: Any, capfd: Any) -> None:
    with collected() as records:
        LOG.debug("quiet")
        logging.getLogger("trimesh.util").warning("loud")
        warnings.warn("hidden", stacklevel=1)
    assert [record.getMessage() for record in records] == ["quiet", "loud"]
    assert not caplog.records and not recwarn.list and capfd.readouterr() == ("", "")


def test_everything_is_as_before_after_an_error() -> None:
    before = (
        [(log.level, list(log.filters)) for log in (LOG, logging.getLogger("trimesh.util"))],
        list(warnings.filters),
    )
    with pytest.raises(ZeroDivisionError), collected():
        _ = 1 / 0
    after = [(log.level, list(log.filters)) for log in (LOG, logging.getLogger("trimesh.util"))], list(warnings.filters)
    assert after == before


def test_a_level_that_is_set_meanwhile_stays() -> None:
    try:
        with collected():
            LOG.setLevel(logging.ERROR)
        assert LOG.level == logging.ERROR
    finally:
        LOG.setLevel(logging.NOTSET)


def test_other_threads_are_heard_as_they_were_and_readers_may_leave_in_any_order() -> None:
    kept, seen = Kept(), dict[str, list[str]]()
    first_in, second_in, first_out = threading.Event(), threading.Event(), threading.Event()

    def first() -> None:
        with collected() as records:
            first_in.set()
            second_in.wait(5)
            LOG.info("one")
        seen["first"] = [record.getMessage() for record in records]
        first_out.set()

    def second() -> None:
        first_in.wait(5)
        with collected() as records:
            second_in.set()
            first_out.wait(5)
            LOG.info("two")
            bystander = threading.Thread(target=lambda: (LOG.warning("heard"), LOG.debug("not asked for")))
            bystander.start()
            bystander.join()
        seen["second"] = [record.getMessage() for record in records]

    LOG.addHandler(kept)
    level = LOG.level
    try:
        threads = [threading.Thread(target=first), threading.Thread(target=second)]
        for thread in threads:
            thread.start()
        for thread in threads:
            thread.join()
    finally:
        LOG.removeHandler(kept)
    assert seen == {"first": ["one"], "second": ["two"]} and kept.texts == ["heard"]
    assert LOG.level == level and not LOG.filters


def test_warnings_of_other_threads_are_heard() -> None:
    with warnings.catch_warnings(record=True) as heard:
        warnings.simplefilter("always")
        with collected():
            thread = threading.Thread(target=lambda: warnings.warn("from beside", stacklevel=1))
            thread.start()
            thread.join()
            warnings.warn("from here", stacklevel=1)
    assert [str(warning.message) for warning in heard] == ["from beside"]
