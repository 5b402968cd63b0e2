"""What the search returns: the cheapest paths, what they cost, and where they had to be bridged."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields

import numpy as np
from numpy.typing import NDArray

from posekit.following.bridging import bridge
from posekit.following.survivor_frame import SurvivorFrame
from posekit.following.switches import Switch, switches_of
from posekit.geometry import Array


@dataclass(frozen=True, kw_only=True, eq=False)
class Paths:
    """K paths through T frames, the likeliest first.

    Parameters
    ----------
    time : array (T,)
        Seconds.
    cost : array (K,)
        Minus the log-likelihood of each, but for a constant: of the first, that of the cheapest path; of another, as
        much more as the odds say.
    share : array (K,)
        Of the probability of these paths, each one's: 1 together. Odds of two are those of what is near to either in
        the frame in which they differ most.
    cheapest : int array (T,)
        The survivors of the cheapest path: of all paths the likeliest single one.
    survivor : int array (K, T)
        Of each frame the survivor that is nearest to what is expected; -1 where the frame is passed over.
    joints : array (K, T, 14, 3)
        What is expected, camera frame, metres: smoothed where there is noise, the survivors' where points are exact,
        and between them what bridges them; NaN where nothing is known.
    deviation : array (K, T, 14)
        How far off each joint is, metres; infinite where that is not known.
    confidence : array (K, T)
        The probability, given all frames, that all joints are within 5 cm of the survivor chosen; below a half the
        path is a guess there.
    interpolated : bool array (K, T, 14)
        Which joints are no survivor's.
    codes : tuple of tuple of str (K, T)
        The branch codes of the survivors; empty where there is none.
    exact : bool
        Whether it is certain that the cheapest path is the cheapest of all: no end of a path was dropped that could
        have become cheaper.
    """

    time: Array
    cost: Array
    share: Array
    cheapest: NDArray[np.intp]
    survivor: NDArray[np.intp]
    joints: Array
    deviation: Array
    confidence: Array
    interpolated: NDArray[np.bool_]
    codes: tuple[tuple[str, ...], ...]
    exact: bool

    def __post_init__(self) -> None:
        for item in fields(self):
            value = getattr(self, item.name)
            if isinstance(value, np.ndarray):
                value.flags.writeable = False

    def __len__(self) -> int:
        """Count the paths."""
        return len(self.cost)

    @property
    def bridged(self) -> NDArray[np.bool_]:
        """Frames (K, T) of which no survivor was taken: their joints are interpolated."""
        return np.asarray(self.survivor < 0)

    def switches(self, path: int = 0, *, perspective: bool = True) -> tuple[Switch, ...]:
        """List where segments that are seen change between near and far, and how fast they had to turn for it."""
        return switches_of(self.time, self.joints[path], ~self.interpolated[path], perspective=perspective)


def joints_of(frames: Sequence[SurvivorFrame], chosen: NDArray[np.intp]) -> tuple[Array, NDArray[np.bool_]]:
    """Return the joints (T, 14, 3) along a path, bridged, and which of them (T, 14) no survivor has."""
    seen = np.full((len(frames), 14, 3), np.nan)
    for k, (frame, one) in enumerate(zip(frames, chosen.tolist(), strict=True)):
        if one >= 0:
            seen[k] = frame.joints[one]
    return bridge(np.array([frame.time for frame in frames]), seen), np.isnan(seen[..., 0])
