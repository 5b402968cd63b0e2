"""posekit: every physically possible posture behind one view, each certified.

The names below are loaded when they are first used: importing posekit reads no file and loads no library.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from posekit.calibration import read_cameras as read_cameras
    from posekit.errors import CameraError as CameraError
    from posekit.errors import FigureError as FigureError
    from posekit.errors import HeadError as HeadError
    from posekit.errors import InputError as InputError
    from posekit.errors import PosekitError as PosekitError
    from posekit.figure import Figure as Figure
    from posekit.figure import load_figure as load_figure
    from posekit.files import View as View
    from posekit.files import read_postures as read_postures
    from posekit.files import read_result as read_result
    from posekit.files import read_view as read_view
    from posekit.files import write_postures as write_postures
    from posekit.files import write_result as write_result
    from posekit.files import write_view as write_view
    from posekit.keypoints import read_keypoints as read_keypoints
    from posekit.motion import read_motion as read_motion
    from posekit.pipeline import Recovery as Recovery
    from posekit.pipeline import Tolerance as Tolerance
    from posekit.pipeline import builtin_view as builtin_view
    from posekit.pipeline import recover as recover
    from posekit.pipeline import result_of as result_of
    from posekit.pipeline.detected import Source as Source
    from posekit.pipeline.detected import open_views as open_views
    from posekit.validators import Validator as Validator

_HOMES = {
    "posekit.calibration": ("read_cameras",),
    "posekit.errors": ("CameraError", "FigureError", "HeadError", "InputError", "PosekitError"),
    "posekit.figure": ("Figure", "load_figure"),
    "posekit.files": (
        "View",
        "read_postures",
        "read_result",
        "read_view",
        "write_postures",
        "write_result",
        "write_view",
    ),
    "posekit.keypoints": ("read_keypoints",),
    "posekit.motion": ("read_motion",),
    "posekit.pipeline": ("Recovery", "Tolerance", "builtin_view", "recover", "result_of"),
    "posekit.pipeline.detected": ("Source", "open_views"),
    "posekit.validators": ("Validator",),
}
_HOME = {name: home for home, names in _HOMES.items() for name in names}

__all__ = list(_HOME)


def __getattr__(name: str) -> Any:
    if name == "__version__":
        from importlib.metadata import version

        return version("posekit")
    if name not in _HOME:
        raise AttributeError(f"module 'posekit' has no attribute {name!r}")
    return getattr(import_module(_HOME[name]), name)


def __dir__() -> list[str]:
    return sorted(__all__)
