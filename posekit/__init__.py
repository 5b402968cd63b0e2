"""posekit validates postures, finds defects in motion, and recovers every posture that fits one view.

The names below are loaded on first use, so that importing posekit reads no file and loads no library.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from posekit.body import load_figure as load_figure
    from posekit.cameras import View as View
    from posekit.doors import convert as convert
    from posekit.doors import recover as recover
    from posekit.doors import render as render
    from posekit.errors import InputError as InputError
    from posekit.errors import PosekitError as PosekitError
    from posekit.following.detections import Detections as Detections
    from posekit.following.tracker import Tracker as Tracker
    from posekit.formats import open as open
    from posekit.formats import save as save
    from posekit.motion import Motion as Motion
    from posekit.motion.repair.repair import repair as repair
    from posekit.motion.validation import validate as validate
    from posekit.recovery import Recovery as Recovery
    from posekit.robots import Robot as Robot
    from posekit.robots import load_robot as load_robot
    from posekit.settings import RecoverSettings as RecoverSettings
    from posekit.settings import ValidateSettings as ValidateSettings
    from posekit.synthesis import builtin_view as builtin_view
    from posekit.validators import Judgement as Judgement
    from posekit.validators import Report as Report
    from posekit.validators import Validator as Validator
    from posekit.validators import assert_valid as assert_valid
    from posekit.validators.check import check as check

__version__ = "1.0.0"

_HOMES = {
    "posekit.body": ("load_figure",),
    "posekit.cameras": ("View",),
    "posekit.doors": ("convert", "recover", "render"),
    "posekit.errors": ("InputError", "PosekitError"),
    "posekit.following.detections": ("Detections",),
    "posekit.following.tracker": ("Tracker",),
    "posekit.formats": ("open", "save"),
    "posekit.motion": ("Motion",),
    "posekit.motion.repair.repair": ("repair",),
    "posekit.motion.validation": ("validate",),
    "posekit.recovery": ("Recovery",),
    "posekit.robots": ("Robot", "load_robot"),
    "posekit.settings": ("RecoverSettings", "ValidateSettings"),
    "posekit.synthesis": ("builtin_view",),
    "posekit.validators": ("Judgement", "Report", "Validator", "assert_valid"),
    "posekit.validators.check": ("check",),
}
_HOME = {name: home for home, names in _HOMES.items() for name in names}

__all__ = list(_HOME)


def __getattr__(name: str) -> Any:
    if name not in _HOME:
        raise AttributeError(f"module 'posekit' has no attribute {name!r}")
    return getattr(import_module(_HOME[name]), name)


def __dir__() -> list[str]:
    return sorted(__all__)
