"""The errors a user can meet: each is one line that says what was expected, what came and what to do."""


class ClpeelError(Exception):
    """Base of every error that clpeel raises on purpose; `exit_code` is the command's."""

    exit_code = 2


class InputError(ClpeelError, ValueError):
    """The input cannot be rendered as it is."""


class NoDeviceError(ClpeelError, RuntimeError):
    """No OpenCL device fits the request."""

    exit_code = 3


class DeviceError(ClpeelError, RuntimeError):
    """There is a device, but this process, or this machine as it is now, cannot compute on it."""

    exit_code = 1
