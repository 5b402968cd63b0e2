"""The likeliest paths through a sequence, and what they say of every joint."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from posekit.display.short_repr import ShortRepr
from posekit.errors import InputError
from posekit.following.best_paths import PATH_SEPARATION_METRES
from posekit.following.switches import Switch, switches_of
from posekit.geometry import Array


@dataclass(frozen=True, kw_only=True, eq=False)
class Following(ShortRepr):
    """K paths through the T frames of a recovery, the likeliest first.

    Parameters
    ----------
    time : array (T,)
        Seconds.
    survivor : int array (K, T)
        Of each frame the survivor that is nearest to the path, an index into `FrameRecovery.joints`; -1 where the path
        passes the frame over.
    joints : array (K, T, 14, 3)
        Camera frame, metres: under noise what is expected of all survivors, smoothed, with their lengths
        (`posekit.following.expected_path`), the survivors' where points are exact, and what bridges them where there is
        none (`posekit.following.bridge`); NaN where a joint is never known.
    interpolated : bool array (K, T, 14)
        Which joints are bridged, or completed without having been seen.
    deviation : array (K, T, 14)
        Of each joint, metres; infinite where it is interpolated.
    cost : array (K,)
        Minus the logarithm of each path's likelihood, but for a constant.
    confidence : array (K, T)
        The probability, given all frames, that all joints are within 5 cm of the survivor chosen; below a half the path
        is a guess there.
    lead : float
        Logarithm of the odds of the first path against the next that is different, by `apart`; infinite where there is
        none, NaN where one path alone was asked for.
    share : array (K,)
        Of the probability of these paths, each one's: 1 together.
    branches : tuple of tuple of str (K, T)
        The branch codes of the survivors; empty where a frame is passed over.
    scale : array (K, T), optional
        Pixels a metre, of the survivors of an uncalibrated view; NaN where a frame is passed over.
    exact : bool
        Whether no path was left out that could be likelier than the likeliest single one.
    apart : float
        Metres by which some joint is elsewhere in another path.
    unlisted : array (T,), optional
        What the survivors of each frame hold at most that are not listed, and through which no path goes; nothing if
        not given.
    """

    time: Array
    survivor: NDArray[np.intp]
    joints: Array
    interpolated: NDArray[np.bool_]
    deviation: Array
    cost: Array
    confidence: Array
    lead: float
    share: Array
    branches: tuple[tuple[str, ...], ...]
    scale: Array | None
    exact: bool
    apart: float = PATH_SEPARATION_METRES
    unlisted: Array | None = None

    def __post_init__(self) -> None:
        for value in vars(self).values():
            if isinstance(value, np.ndarray):
                value.flags.writeable = False

    def __len__(self) -> int:
        """Count the paths."""
        return len(self.cost)

    @property
    def bridged(self) -> NDArray[np.bool_]:
        """Frames (K, T) that a path passes over."""
        return np.asarray(self.survivor < 0)

    @property
    def guessed(self) -> NDArray[np.bool_]:
        """Frames (K, T) in which a path is likelier wrong by 5 cm somewhere than not."""
        return np.asarray(self.confidence < 0.5)

    def smoothed(self, path: int = 0) -> Array:
        """Return a path as it is: smoothed already (T, 14, 3), metres. Where the camera is not known, nothing is.

        Raises
        ------
        InputError
            Where the view is uncalibrated.
        """
        if self.scale is not None:
            raise InputError(
                "an uncalibrated view tells no distances to be smoothed; expected a calibrated camera; take the joints"
            )
        return np.asarray(self.joints[path])

    def switches(self, path: int = 0) -> tuple[Switch, ...]:
        """List where segments that are seen change between near and far, and how fast they had to turn for it."""
        return switches_of(
            self.time, self.joints[path], ~self.interpolated[path], perspective=self.scale is None
        )
