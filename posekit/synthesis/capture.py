"""Motion capture in memory: postures in clips."""

from __future__ import annotations

from dataclasses import dataclass
from difflib import get_close_matches
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from posekit.errors import InputError
from posekit.geometry import Array
from posekit.skeleton import JOINTS


@dataclass(frozen=True, kw_only=True, eq=False)
class Capture:
    """Frames of motion capture, in clips.

    Parameters
    ----------
    points : array (T, 19, 3)
        The 14 joints and 5 head points, metres; NaN is absent.
    clip : int array (T,)
        The clip of each frame.
    names, actions : tuple of str
        One a clip.
    fps : array (C,)
        Frames a second of each clip.
    up : array (3,)
        The world's up, a unit vector.
    source : str
        What to call it in errors.
    derived : tuple of str
        The joints that no point of the file is, placed from shoulders and hips.
    up_from : str
        Who says which way is up: ``file``, ``stated`` or ``guessed``.

    See Also
    --------
    posekit.synthesis.read_capture : reads one from a file and checks it.
    """

    points: Array
    clip: NDArray[np.intp]
    names: tuple[str, ...]
    actions: tuple[str, ...]
    fps: Array
    up: Array
    source: str
    derived: tuple[str, ...] = ()
    up_from: str = "file"

    def __post_init__(self) -> None:
        for array in (self.points, self.clip, self.fps, self.up):
            array.flags.writeable = False

    @cached_property
    def order(self) -> NDArray[np.intp]:
        """The place of each frame in its clip (T,), from 0."""
        order = np.empty(len(self.clip), dtype=np.intp)
        for index in range(len(self.names)):
            rows = np.flatnonzero(self.clip == index)
            order[rows] = np.arange(len(rows))
        return order

    def clip_index(self, name: str) -> int:
        """Return the number of a clip by its name.

        Raises
        ------
        InputError
            Where there is no such clip.
        """
        if name not in self.names:
            near = get_close_matches(name, self.names, n=1) or self.names[:5]
            raise InputError(
                f"{self.source}: clip {name!r} is not among its {len(self.names)}; such as {', '.join(near)}"
            )
        return self.names.index(name)

    def frames_of(self, clip: int, *, complete: bool = False) -> NDArray[np.intp]:
        """Return the frames of a clip in which the neck, or every joint if `complete`, is known."""
        needed = slice(len(JOINTS)) if complete else slice(1)
        known = np.isfinite(self.points[:, needed]).all(axis=(1, 2))
        return np.flatnonzero(known & (self.clip == clip))
