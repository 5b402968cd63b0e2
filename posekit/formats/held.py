"""Postures of a file: what every reader of postures gives."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from posekit.display.short_repr import ShortRepr
from posekit.formats.own import Postures
from posekit.geometry import Array


@dataclass(frozen=True, kw_only=True, eq=False)
class HeldPostures(ShortRepr):
    """Postures of a file, N of them.

    Parameters
    ----------
    postures : Postures
        Metres, in the file's own world or its camera's frame.
    frame : int array (N,)
        The frame that each posture is of; all 0 where the file knows no frames.
    clip : int array (N,)
        The recording that each posture is of, from 0.
    time : array (N,)
        Seconds, as they were recorded; NaN where the file does not say them.
    up : str
        The axis that points up, as ``+y``; empty where it is not known.
    clips : tuple of str
        The names of the recordings; empty where they have none.
    unit : str
        What lengths in the file are in: ``m``, ``cm``, ``mm``, ``in``.
    in_world : bool
        Whether all frames of a recording have one origin; False where each has its own, as the middle of the hips: then
        nothing is known of the ground, or of where the body goes.
    said : tuple of str
        What was recognised, and from what, a sentence each: for people.
    feet : array (N, 4, 3)
        Toes and heels in the order of `posekit.skeleton.FEET_POINTS`, metres; empty where there are none.
    q : array (N, nq)
        Configurations of the robot whose postures they are; empty where there is none.
    """

    postures: Postures
    frame: NDArray[np.intp]
    clip: NDArray[np.intp]
    time: Array
    up: str = ""
    clips: tuple[str, ...] = ()
    unit: str = "m"
    in_world: bool = True
    said: tuple[str, ...] = ()
    feet: Array = field(default_factory=lambda: np.empty(0))
    q: Array = field(default_factory=lambda: np.empty((0, 0)))

    def __len__(self) -> int:
        """Return the number of postures."""
        return len(self.postures.joints)

    @cached_property
    def in_time(self) -> bool:
        """Whether they are frames of motion: of each frame of a clip one posture."""
        order = np.lexsort((self.frame, self.clip))
        same = (np.diff(self.clip[order]) == 0) & (np.diff(self.frame[order]) == 0)
        return len(self) > 0 and not same.any()
