"""How the neck is to be found where a view does not give it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final, Literal, get_args

from posekit.errors import InputError

RootMethod = Literal["auto", "head", "torso", "search"]

MAX_DEVIATION_PIXELS: Final = 1000.0
"""The largest standard deviation of image points that is taken for one."""

DETECTED_DEVIATION: Final = 5.0
"""Pixels: a detector's points, of a person some 700 pixels tall (docs, "Where the body is": 4 keep all, 3 do not)."""

DETECTED_OFFSET: Final = 0.01
"""Metres by which the trunk of a person differs from a rigid one, and a detector's joints from the figure's."""


@dataclass(frozen=True, kw_only=True)
class Rooting:
    """How the neck is to be found in a calibrated view.

    Parameters
    ----------
    method : {"auto", "head", "torso", "search"}
        From six points of the head, from torso and hips, or by searching the depths that all segments allow; ``auto``
        takes the best of these that the picture allows.
    deviation : float, optional
        Standard deviation of image points, pixels; the view's own if not given.
    trust_head : bool
        Whether six head points tell the neck, without asking how well: right where they are exact.

    Raises
    ------
    InputError
        Where the method is unknown, or the deviation is no positive number of pixels.
    """

    method: RootMethod = "auto"
    deviation: float | None = None
    trust_head: bool = True

    def __post_init__(self) -> None:
        if self.method not in get_args(RootMethod):
            raise InputError(f"--root: {self.method!r}; expected {', '.join(get_args(RootMethod))}")
        if self.deviation is not None and not 0 < self.deviation <= MAX_DEVIATION_PIXELS:
            raise InputError(
                f"--deviation: {self.deviation!r}; expected a positive number of pixels, at most "
                f"{MAX_DEVIATION_PIXELS:g}"
            )
