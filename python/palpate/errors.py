"""Exceptions and warnings of palpate; messages state the problem, its place and the remedy."""


class PalpateError(ValueError):
    """Base of every error that palpate raises on purpose."""


class ScenarioError(PalpateError):
    """A scenario file has an unknown key, a wrong dimension, a missing or an impossible value."""


class DeviceError(PalpateError):
    """A device file or a device parameter is wrong (unknown name, negative mass, missing unit)."""


class PoseError(PalpateError):
    """A pose or a tip position is out of reach, singular, not finite, or has the wrong shape."""


class RecordingError(PalpateError):
    """A recording has gaps, repeated time stamps, non-finite samples or too little excitation."""


class DesignError(PalpateError):
    """A controller with the stated specification does not exist for this plant."""


class StabilityError(PalpateError):
    """A loop cannot be tested as described: a negative delay, a rate of zero, a controller that is not causal."""


class OutputError(PalpateError):
    """A file or folder cannot be written: no permission, a full disk, a folder where a file should be."""


class PalpateWarning(UserWarning):
    """Base of every warning of palpate: execution continues, but the input is probably not as intended."""
