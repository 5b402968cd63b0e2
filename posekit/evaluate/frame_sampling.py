"""Which frames of a motion are evaluated."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from posekit.errors import InputError
from posekit.safe_io import nearest, shown
from posekit.synthesis import Capture


@dataclass(frozen=True, kw_only=True)
class FrameSampling:
    """Clips, and frames of each.

    Parameters
    ----------
    frames_per_clip : int
        Of the frames with all joints, evenly over the clip; all where a clip has fewer.
    clips, actions : tuple of str
        Which; all where empty.
    consecutive : bool
        Frames in a row instead, from the middle of each clip, seen by cameras that stand still: a sequence.

    Raises
    ------
    InputError
        Where no frame is asked for.
    """

    frames_per_clip: int = 10
    clips: tuple[str, ...] = ()
    actions: tuple[str, ...] = ()
    consecutive: bool = False

    def __post_init__(self) -> None:
        if self.frames_per_clip < 1:
            raise InputError(f"--frames-per-clip: {self.frames_per_clip}; expected one or more")

    def chosen(self, capture: Capture) -> list[int]:
        """Return the numbers of the clips.

        Raises
        ------
        InputError
            Where a clip or action is not in the file, or none is both.
        """
        actions = action_names(capture)
        for option, wanted, known in (
            ("--clips", self.clips, capture.names),
            ("--actions", self.actions, actions),
        ):
            for name in wanted:
                if name not in known:
                    raise InputError(
                        f"{option}: {shown(name)} is not in {capture.source}; expected one of its "
                        f"{len(set(known))}; {nearest(name, tuple(dict.fromkeys(known)))}"
                    )
        found = [
            k
            for k, (name, action) in enumerate(zip(capture.names, actions, strict=True))
            if (not self.clips or name in self.clips) and (not self.actions or action in self.actions)
        ]
        if not found:
            raise InputError("--clips, --actions: no clip is of both; leave one of the two out")
        return found

    def rows(self, capture: Capture, clip: int) -> NDArray[np.intp]:
        """Return the frames of one clip; none where no frame has all joints."""
        known = capture.frames_of(clip, complete=True)
        count = min(self.frames_per_clip, len(known))
        if self.consecutive:
            first = (len(known) - count) // 2
            return known[first : first + count]
        if count <= 1:
            return known[len(known) // 2 :][:count]
        places: NDArray[np.intp] = np.round(np.linspace(0, len(known) - 1, count)).astype(np.intp)
        return known[places]


def action_names(capture: Capture) -> tuple[str, ...]:
    """Return each clip's action, or its own name where the file has none."""
    return tuple(action or name for name, action in zip(capture.names, capture.actions, strict=True))
