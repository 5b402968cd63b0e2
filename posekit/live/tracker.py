"""`posekit.Tracker`: one picture's points in, the likeliest posture and the path out."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any, Final

import numpy as np
from numpy.typing import ArrayLike

from posekit.body import load_figure
from posekit.compiled.compiling import PAYS_FROM, expect
from posekit.display.check_words import check_words
from posekit.display.plural import plural
from posekit.display.short_repr import ShortRepr
from posekit.errors import InputError, PosekitError
from posekit.following import Follower
from posekit.following.follower import LiveEstimate
from posekit.following.survivor_frame import MAX_SECONDS, SurvivorFrame, check_order
from posekit.formats.skeleton_maps import SkeletonMap, load_skeleton_map
from posekit.live.sight import LiveCamera, LiveSight, likely_camera
from posekit.live.tracked_posture import TrackedPosture, deviation_from
from posekit.recovery.body import loaded
from posekit.recovery.conductor import recover
from posekit.recovery.observed import NO_NECK
from posekit.recovery.recovery import FrameRecovery, Recovery
from posekit.recovery.sequences import ranked_frames
from posekit.settings import RecoverSettings
from posekit.skeleton import JOINTS

DEFAULT_LAG: Final = 5
"""Pictures that the path looks ahead: a sixth of a second at 30 a second."""


class Tracker(ShortRepr):
    """Recovers one picture a call, and follows the person.

    All that does not depend on the picture is made and loaded once, here. A picture's postures are those that
    `posekit.recover` finds of it alone, whatever came before; the path is what remembers.

    Parameters
    ----------
    settings : RecoverSettings, optional
        What is asked of each picture; the usual if not given.
    camera : OpenCVModel or CalibratedCamera, optional
        What takes the pictures (`posekit.read_cameras`). A usual webcam's is guessed from `size` if not given.
    size : (int, int), optional
        Width and height of the pictures, pixels: where no camera is given.
    lengths : mapping, optional
        The person's segment lengths, metres, by segment name.
    stature : float, optional
        The person's height, metres, where no lengths are given. Without either an adult of unknown size is taken.
    deviation : float, optional
        Standard deviation of each coordinate of the points, pixels; a detector's 5 if not given.
    layout : str or SkeletonMap, optional
        What the points are: a skeleton map by name or file, as ``coco_17`` or ``mediapipe_33``. If not given they are
        the 14 joints in tree order, maybe followed by the head's five points.
    lag : int
        How many pictures later the path tells where somebody was: the more, the surer.

    Raises
    ------
    PosekitError
        Where settings, camera, person or layout are impossible.

    Examples
    --------
    >>> tracker = Tracker(size=(1280, 720), stature=1.75, deviation=2.0)
    >>> tracker.update(np.full((14, 2), np.nan), time=0.0).reason
    'the neck, from which the tree grows, is not seen'
    """

    def __init__(
        self,
        settings: RecoverSettings | None = None,
        *,
        camera: LiveCamera | None = None,
        size: tuple[int, int] | None = None,
        lengths: Mapping[str, float] | None = None,
        stature: float | None = None,
        deviation: float | None = None,
        layout: str | SkeletonMap | None = None,
        lag: int = DEFAULT_LAG,
    ) -> None:
        if camera is None and size is None:
            raise InputError(
                "Tracker: neither a camera nor the size of its pictures; expected one of them; give camera, or "
                "size=(width, height)"
            )
        if isinstance(layout, str):
            layout = load_skeleton_map(layout)
        if layout is not None and not layout.points:
            raise InputError(
                f"Tracker: layout {layout.name} has no order of points; expected a detector's, as coco_17; choose "
                "another"
            )
        self.settings = loaded(settings or RecoverSettings())
        self.sight = LiveSight.of(
            camera or likely_camera(size or (0, 0)), layout, lengths, stature, deviation
        )
        self._follower = Follower(lag=lag)
        self._frame, self._last = 0, -math.inf
        expect(PAYS_FROM + 1)
        # What the first picture would have to load and make is loaded and made by one that nobody sees.
        standing = recover(self.sight.standing(load_figure()), self.settings)
        Follower(lag=0).push(ranked_frames(standing)[0])

    def _facts(self) -> list[str]:
        return [plural(len(self.names), "point"), f"{plural(self._frame, 'picture')} so far"]

    @property
    def names(self) -> tuple[str, ...]:
        """The names of the points that `update` takes, in their order."""
        return self.sight.names

    def update(self, points: ArrayLike, time: float, *, root: ArrayLike | None = None) -> TrackedPosture:
        """Take the points of the next picture; say what is known of the person by now.

        Parameters
        ----------
        points : array (K, 2) or (K, 3)
            Pixels, and a confidence each where there are three columns; NaN for points that were not seen.
        time : float
            Seconds, more than at the last call.
        root : array (3,), optional
            The neck, camera frame, metres, where something else tells it.

        Returns
        -------
        TrackedPosture
            Of which nothing is known, with the reason, where the picture does not show enough.

        Raises
        ------
        InputError
            Where the points are of another number or shape, or the time does not ascend: the picture is then as if it
            had not been.
        """
        time = float(time)
        if not abs(time) <= MAX_SECONDS:
            raise InputError(f"time: got {time:g}; expected a number of seconds; give every picture its time")
        check_order(self._last, time, self._frame)
        view = self.sight.view(points, time, root)
        recovery, reason = None, NO_NECK
        if view is not None:
            try:
                recovery, reason = recover(view, self.settings), ""
            except PosekitError as error:  # of this picture: the standing figure's had none
                reason = str(error)
        known, found = _found(recovery, time)
        told = TrackedPosture(
            frame=self._frame,
            time=time,
            survivors=len(known),
            path=self._follower.push(known),
            **{"reason": reason.removeprefix("frames[0]: ")} | found,
        )
        self._frame, self._last = self._frame + 1, time
        return told

    def finish(self) -> list[LiveEstimate]:
        """Return the path of the pictures that it has not told yet. More may follow, after these."""
        return self._follower.finish()


def _found(recovery: Recovery | None, time: float) -> tuple[SurvivorFrame, dict[str, Any]]:
    """Return the survivors of a picture, and what a `TrackedPosture` says of them."""
    if recovery is None:
        return SurvivorFrame(time=time, joints=np.empty((0, len(JOINTS), 3))), {}
    frame, probability = recovery.frames[0], recovery.probability[0]
    known = ranked_frames(recovery)[0]
    if not len(frame):
        return known, {"reason": _lost(frame), "recovery": frame}
    answer = recovery.answers[0]
    return known, {
        "joints": answer.posture.copy(),
        "probability": answer.sure,
        "deviation": deviation_from(answer.posture, probability, known),
        "answer": answer,
        "recovery": frame,
    }


def _lost(frame: FrameRecovery) -> str:
    """Say why nothing is left of a picture."""
    if frame.reason:
        return frame.reason.removeprefix("frames[0]: ")
    most = max(frame.rejected, key=frame.rejected.__getitem__)
    return f"no posture passes: most were lost to {check_words(most)}"
