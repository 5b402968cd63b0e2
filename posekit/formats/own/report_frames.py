"""Which frame of which clip of which file each judged posture is."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from posekit.geometry import Array


class ClipName(NamedTuple):
    """A clip: its file, and its name in it, empty where it has none."""

    file: str
    clip: str

    @property
    def name(self) -> str:
        """The clip as it is printed: ``walk.npz: 07_01``."""
        return f"{self.file}: {self.clip}" if self.clip and self.file else self.file or self.clip


@dataclass(frozen=True, kw_only=True, eq=False)
class ReportFrames:
    """Where each of N postures comes from.

    Parameters
    ----------
    clips : sequence of ClipName
        The clips.
    clip : int array (N,)
        Which of them each posture is of.
    frame : int array (N,)
        Its frame, counted from 0 in each clip.
    time : array (N,)
        Seconds; NaN where they are not known.
    in_time : bool
        Whether each frame of a clip has one posture: clips then have verdicts.
    """

    clips: Sequence[ClipName]
    clip: NDArray[np.intp]
    frame: NDArray[np.intp]
    time: Array
    in_time: bool = True

    def __len__(self) -> int:
        """Count the postures."""
        return len(self.clip)

    @cached_property
    def order(self) -> NDArray[np.intp]:
        """The postures (N,) clip by clip, in each as they are in the file."""
        return np.argsort(self.clip, kind="stable")

    @cached_property
    def starts(self) -> NDArray[np.intp]:
        """Where each clip begins in `order`, and where the last one ends (C + 1,)."""
        return np.searchsorted(self.clip[self.order], np.arange(len(self.clips) + 1))

    def rows(self, clip: int) -> NDArray[np.intp]:
        """Return which postures are of a clip."""
        return self.order[self.starts[clip] : self.starts[clip + 1]]


def joined_frames(parts: Sequence[ReportFrames]) -> ReportFrames:
    """Put those of several files one after the other."""
    firsts = np.cumsum([0, *(len(part.clips) for part in parts)])[:-1]
    none = np.zeros(0, dtype=np.intp)
    return ReportFrames(
        clips=[name for part in parts for name in part.clips],
        clip=np.concatenate([none, *(part.clip + first for part, first in zip(parts, firsts, strict=True))]),
        frame=np.concatenate([none, *(part.frame for part in parts)]),
        time=np.concatenate([np.zeros(0), *(part.time for part in parts)]),
        in_time=all(part.in_time for part in parts),
    )
