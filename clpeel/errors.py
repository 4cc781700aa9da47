"""The errors that a user may meet. Each is one line that says what was expected, what was given and what to do."""


class ClpeelError(Exception):
    """Base of every error that clpeel raises on purpose. `exit_code` is the exit code of the command."""

    exit_code = 2


class InputError(ClpeelError, ValueError):
    """The input cannot be rendered as it is."""


class NoDeviceError(ClpeelError, RuntimeError):
    """No OpenCL device fits the request."""

    exit_code = 3


class DeviceError(ClpeelError, RuntimeError):
    """There is a device, but this process cannot compute on it, or this machine cannot in its present state."""

    exit_code = 1
