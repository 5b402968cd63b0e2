"""posekit: every physically possible posture behind one view, each certified.

The names below are loaded when they are first used: importing posekit reads no file and loads no library.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from posekit.body import Figure as Figure
    from posekit.body import load_figure as load_figure
    from posekit.conversion.from_python import convert as convert
    from posekit.conversion.from_python import render as render
    from posekit.errors import CameraError as CameraError
    from posekit.errors import FigureError as FigureError
    from posekit.errors import HeadError as HeadError
    from posekit.errors import InputError as InputError
    from posekit.errors import PosekitError as PosekitError
    from posekit.formats.cameras import read_cameras as read_cameras
    from posekit.formats.keypoints import read_keypoints as read_keypoints
    from posekit.formats.motion import read_motion as read_motion
    from posekit.formats.opening import open as open
    from posekit.formats.own import View as View
    from posekit.formats.own import read_postures as read_postures
    from posekit.formats.own import read_result as read_result
    from posekit.formats.own import read_view as read_view
    from posekit.formats.own import write_postures as write_postures
    from posekit.formats.own import write_view as write_view
    from posekit.live import TrackedPosture as TrackedPosture
    from posekit.live import Tracker as Tracker
    from posekit.recovery import recover as recover
    from posekit.recovery.answered import result_answers as result_answers
    from posekit.recovery.recovery import Recovery as Recovery
    from posekit.recovery.result import result_of as result_of
    from posekit.recovery.result_output import write_result as write_result
    from posekit.recovery.sequences import follow as follow
    from posekit.remedy import repair as repair
    from posekit.settings import RecoverSettings as RecoverSettings
    from posekit.settings import Tolerance as Tolerance
    from posekit.settings import ValidateSettings as ValidateSettings
    from posekit.validation import validate as validate
    from posekit.validators import Validator as Validator
    from posekit.views.builtin import builtin_view as builtin_view
    from posekit.views.opening import open_views as open_views
    from posekit.views.source import Source as Source

_HOMES = {
    "posekit.conversion.from_python": ("convert", "render"),
    "posekit.formats.cameras": ("read_cameras",),
    "posekit.errors": ("CameraError", "FigureError", "HeadError", "InputError", "PosekitError"),
    "posekit.body": ("Figure", "load_figure"),
    "posekit.formats.own": (
        "View",
        "read_postures",
        "read_result",
        "read_view",
        "write_postures",
        "write_view",
    ),
    "posekit.formats.keypoints": ("read_keypoints",),
    "posekit.formats.motion": ("read_motion",),
    "posekit.formats.opening": ("open",),
    "posekit.live": ("TrackedPosture", "Tracker"),
    "posekit.recovery": ("Recovery", "follow", "recover", "result_of"),
    "posekit.recovery.answered": ("result_answers",),
    "posekit.recovery.result_output": ("write_result",),
    "posekit.remedy": ("repair",),
    "posekit.settings": ("RecoverSettings", "Tolerance", "ValidateSettings"),
    "posekit.views": ("Source", "builtin_view", "open_views"),
    "posekit.validation": ("validate",),
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
