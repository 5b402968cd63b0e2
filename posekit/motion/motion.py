"""Motion in memory: named points in space over time, as motion capture and triangulation give them."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from posekit.cameras import Array
from posekit.errors import InputError
from posekit.intake import refusal, shown


@dataclass(frozen=True, kw_only=True, eq=False)
class Motion:
    """T frames of P named points in space.

    Parameters
    ----------
    names : tuple of str (P,)
        As the file has them.
    points : array (T, P, 3)
        Metres; NaN where a point is missing.
    time : array (T,)
        Seconds, ascending within a clip.
    rate : float
        Frames a second.
    up : str
        The axis that points up: ``+x`` … ``-z``; empty where the file does not say.
    source : str
        What to call it in errors.
    clip : int array (T,), optional
        The clip of each frame; all 0 where not given.
    clips : tuple of str, optional
        The names of the clips.

    Raises
    ------
    InputError
        Where shapes do not fit, a coordinate is infinite, a point is known in part, or a name comes twice.
    """

    names: tuple[str, ...]
    points: Array
    time: Array
    rate: float
    up: str = ""
    source: str = "motion"
    clip: NDArray[np.intp] = field(default_factory=lambda: np.empty(0, dtype=np.intp))
    clips: tuple[str, ...] = ("",)

    def __post_init__(self) -> None:
        points = np.array(self.points, dtype=np.float64)
        time = np.array(self.time, dtype=np.float64)
        clip = np.array(self.clip, dtype=np.intp)
        if clip.shape == (0,):
            clip = np.zeros(len(time), dtype=np.intp)
        if points.shape != (len(time), len(self.names), 3) or time.ndim != 1 or clip.shape != time.shape:
            raise InputError(
                f"{self.source}: points have shape {points.shape}; expected ({len(time)}, {len(self.names)}, 3): "
                "frames, names, three coordinates"
            )
        if not np.isfinite(time).all() or not (np.isfinite(self.rate) and self.rate > 0):
            raise refusal(
                self.source, "rate", shown(float(self.rate)), "a positive rate, finite times", "correct it"
            )
        if len(set(self.names)) != len(self.names):
            twice = next(name for name in self.names if self.names.count(name) > 1)
            raise refusal(self.source, "names", f"{shown(twice)} twice", "each once", "rename one of the two")
        unknown = np.isnan(points)
        bad = np.isinf(points) | (unknown ^ unknown.all(axis=-1, keepdims=True))
        if bad.any():
            frame, point, _ = (int(k) for k in np.argwhere(bad)[0])
            raise refusal(
                self.source,
                f"frame {frame}: {self.names[point]}",
                str(points[frame, point].tolist()),
                "three finite numbers, or a missing point",
                "correct it",
            )
        for name, values in (("points", points), ("time", time), ("clip", clip)):
            values.flags.writeable = False
            object.__setattr__(self, name, values)

    def __len__(self) -> int:
        """Return the number of frames."""
        return len(self.time)
