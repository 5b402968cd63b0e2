"""The errors posekit raises.

Every text names the object, the value, what was expected and what to do; the command line prints it as
one line and exits with 2.
"""


class PosekitError(Exception):
    """Base of every error that posekit raises on purpose."""


class InputError(PosekitError):
    """A file or an argument is not what its schema says."""


class TooLargeError(InputError):
    """What is to be written could not be read again."""


class FigureError(PosekitError):
    """The lengths or the URDF of a figure describe no body."""


class HeadError(PosekitError):
    """The head's points do not determine a camera."""


class CameraError(PosekitError):
    """A camera's parameters are impossible."""


class ViewerError(PosekitError):
    """A picture, a plot or a page cannot be made."""
