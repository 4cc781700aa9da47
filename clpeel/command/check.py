"""`clpeel devices --check`: makes the self-test of common kinds of pictures on each device."""

from __future__ import annotations

import argparse
from typing import TYPE_CHECKING

from clpeel.command.report import table
from clpeel.command.streams import print_text, quiet_libraries, say
from clpeel.command.terminal import EXIT_FAILURE, Progress

if TYPE_CHECKING:
    from clpeel.rendering.check_devices import Checked


def reason_of(each: Checked) -> str:
    """Return a line that says why a test was not right, or was not made."""
    what = "the others" if each.outcome == "not tried" else each.kind.name
    return f"{each.device.number}, {what}: {each.outcome}: {each.reason}"


def run_check(options: argparse.Namespace) -> int:
    """Print a line for each test, and the reasons of those that were not right.

    Returns EXIT_FAILURE if any on the default device was not right. Raises NoDeviceError if there are no devices.
    """
    if not options.verbose:
        quiet_libraries()

    from clpeel.checks import one_of
    from clpeel.device.devices import all_devices, find_device, why_default
    from clpeel.rendering.check_devices import Checked, check_devices, kinds_to_check
    from clpeel.techniques import TECHNIQUES

    for name in options.techniques or ():
        one_of("--techniques", name, TECHNIQUES)
    devices = all_devices()
    default, _ = why_default(devices)
    if options.device is not None:
        devices = [find_device(options.device)]
        default = devices[0]
    kinds = kinds_to_check(options.techniques or ())
    progress = Progress(enabled=not options.no_progress, delay=0.0)
    found: list[Checked] = []
    try:
        for each in check_devices(devices, kinds, options.timeout):
            if isinstance(each, Checked):
                found.append(each)
                if options.verbose:
                    say(f"{each.device.number} {each.device.name}: {each.kind.name}: {each.outcome}")
            else:
                device, kind = each
                progress(len(found) / (len(devices) * len(kinds)), f"{device.number}: {kind.name}")
    finally:
        progress.clear()
        rows = [("device", "name", "kernels", "self-test")]
        rows += [(str(each.device.number), each.device.name, each.kind.name, each.outcome) for each in found]
        lines = table(rows)
        print_text("\n".join([*lines, *dict.fromkeys(reason_of(each) for each in found if each.reason)]))
    wrong = [each for each in found if each.device == default and each.outcome != "right"]
    if wrong:
        say(f"{len(wrong)} of {len(kinds)} tests were not right on {wrong[0].device.name} ({wrong[0].device.platform})")
    return EXIT_FAILURE if wrong or default is None else 0
