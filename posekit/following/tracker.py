"""`Tracker`: recovers the posture in each picture as its key points arrive, and the path of the person with a delay."""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Mapping
from dataclasses import dataclass, replace
from importlib import import_module
from typing import Any, Final, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from posekit.cameras import Camera, PinholeCamera, View
from posekit.cameras.pinhole import camera_from_fov
from posekit.errors import PosekitError, names_checked, refusal, shown
from posekit.following.detections import Detections
from posekit.following.paths import Candidates, Trellis, candidates, expected_posture
from posekit.geometry import Array, Record, numbers
from posekit.recovery.conductor import recover
from posekit.recovery.recovery import Recovery
from posekit.settings import RecoverSettings, number, picture_size
from posekit.skeleton import JOINTS, POINTS

#: Diagonal angle of view of a usual webcam (Logitech C920, data sheet).
WEBCAM_DEGREES: Final = 78.0

#: Default standard deviation of a live detector's points, pixels.
DETECTED_DEVIATION: Final = 5.0

#: Number of pictures that a path looks ahead: a sixth of a second at 30 pictures per second.
DEFAULT_LAG: Final = 5


class PathPosture(NamedTuple):
    """The posture of one picture on the likeliest path, computed when `lag` further pictures are known.

    Attributes
    ----------
    frame : int
        Picture, from 0.
    time : float
        Seconds.
    joints : array (14, 3)
        Camera frame, metres; NaN if the path skips the picture.
    """

    frame: int
    time: float
    joints: Array


@dataclass(frozen=True, kw_only=True, eq=False, repr=False)
class TrackedPosture(Record):
    """The answer about one picture, computed from the pictures so far.

    Parameters
    ----------
    frame : int
        Picture, from 0.
    time : float
        Seconds.
    joints : array (14, 3)
        Answer of this picture alone, camera frame, metres; NaN if there is no answer.
    sure : float
        Probability that every joint of the answer is within 5 cm; 0 if there is no answer.
    reason : str
        Reason why the picture has no posture; empty if it has one.
    path : PathPosture, optional
        Posture on the path, `lag` pictures before this picture; None for the first `lag` pictures.
    recovery : Recovery, optional
        Every survivor of the picture.
    """

    frame: int
    time: float
    joints: Array
    sure: float = 0.0
    reason: str = ""
    path: PathPosture | None = None
    recovery: Recovery | None = None

    @property
    def survivors(self) -> int:
        """Number of survivors."""
        return 0 if self.recovery is None else len(self.recovery.survivors)


class Tracker:
    """Recovers the posture in one picture per call, and follows the person from picture to picture.

    The survivors of a picture depend on this picture alone; the path also depends on the pictures before and after it.

    Parameters
    ----------
    settings : RecoverSettings, optional
        Settings for each picture.
    camera : PinholeCamera, optional
        By default a webcam with a diagonal angle of view of 78 degrees and pictures of `size`.
    size : (int, int) or str, optional
        Width and height of the pictures, pixels; also as ``"1280x720"``.
    lengths : mapping of str to float, optional
        Segment lengths of the person, metres.
    stature : float or str, optional
        Height of the person, metres or with its unit, if no lengths are given.
    deviation : float or str, optional
        Standard deviation of each coordinate of the points, pixels; 5 by default.
    layout : str or Layout, optional
        Meaning of the points: name or file of a layout, as ``coco_17``. By default the 14 joints in tree order, alone
        or followed by nose, eyes and ears.
    lag : int
        Number of pictures that the path looks ahead.

    Raises
    ------
    InputError
        If neither a camera nor a size is given, or the layout has no order of points.

    Examples
    --------
    >>> tracker = Tracker(size=(1280, 720), stature=1.75, deviation=2.0)
    >>> tracker.update(np.full((14, 2), np.nan), time=0.0).survivors
    0
    """

    @names_checked
    def __init__(
        self,
        settings: RecoverSettings | None = None,
        *,
        camera: PinholeCamera | None = None,
        size: str | tuple[int, int] | None = None,
        lengths: Mapping[str, float] | None = None,
        stature: str | float | None = None,
        deviation: str | float | None = None,
        layout: Any = "",
        lag: int = DEFAULT_LAG,
    ) -> None:
        if isinstance(layout, str) and layout:
            # Layouts are in a layer above this one; they are loaded only if a layout is given by name.
            layout = import_module("posekit.formats.layout").load_layout(layout)
        if layout and not layout.points:
            raise refusal("Tracker", "layout", layout.name, "points in an order, as in coco_17")
        if not isinstance(camera, Camera) and (camera is not None or size is None):
            remedy = "give size=(1280, 720), or open a calibration with posekit.open(FILE)[NAME]"
            raise refusal("Tracker", "camera", shown(camera), "a PinholeCamera or a size", remedy)
        self.settings = RecoverSettings.of(settings)
        self.camera = camera or camera_from_fov(picture_size(size) or (0, 0), WEBCAM_DEGREES, "diagonal")
        self.layout, self.lag = layout or None, lag
        self.names: tuple[str, ...] = tuple(layout.points) if layout else POINTS
        self._known: dict[str, Any] = {
            "lengths": dict(lengths or {}),
            "stature": self.settings.stature if stature is None else number(stature, "stature"),
            "deviation": number(deviation or self.settings.deviation or DETECTED_DEVIATION, "deviation"),
        }
        self._trellis = Trellis()
        self._waiting: deque[tuple[int, Candidates]] = deque()
        self._frame, self._last = 0, -math.inf

    def update(self, points: ArrayLike, time: float, *, root: ArrayLike | None = None) -> TrackedPosture:
        """Take the points of the next picture.

        Parameters
        ----------
        points : array (K, 2) or (K, 3)
            Pixels, with a confidence in the third column if there is one; NaN for points that were not seen.
        time : float
            Seconds, more than at the last call.
        root : array (3,), optional
            Position of the neck, camera frame, metres, if it is known from another source.

        Raises
        ------
        InputError
            If the number of points is wrong or the time does not ascend; the picture is then ignored.
        """
        time = number(time, "time", "seconds")
        if time <= self._last + 1e-6:
            raise refusal("Tracker", "time", f"{time:g}", f"seconds after {self._last:g}")
        table = numbers(points, "Tracker", "points")
        counts = (len(self.names),) if self.layout else (len(JOINTS), len(POINTS))
        if table.ndim != 2 or len(table) not in counts or table.shape[1] not in (2, 3):
            expected = f"({' or '.join(map(str, counts))}, 2) or 3 columns"
            raise refusal("Tracker", "points", f"shape {table.shape}", expected, "give NaN for unseen points")
        recovery = None
        try:
            recovery = recover(self._view(table, time, root), self.settings)
            reason = recovery.frames.reason[0]
        except PosekitError as error:
            reason = str(error)
        frame = Candidates(time, np.empty((0, len(JOINTS), 3)), np.empty((0, len(JOINTS), 3, 3)), np.empty(0))
        joints, sure = np.full((len(JOINTS), 3), np.nan), 0.0
        if recovery is not None:
            frame = candidates(recovery, 0)._replace(time=time)
            joints, sure = recovery.answer.joints[0], float(np.nan_to_num(recovery.answer.sure[0]))
        self._trellis.push(frame)
        self._waiting.append((self._frame, frame))
        posture = TrackedPosture(
            frame=self._frame,
            time=time,
            joints=joints,
            sure=sure,
            reason=reason,
            path=self._oldest() if len(self._waiting) > self.lag else None,
            recovery=recovery,
        )
        self._frame, self._last = self._frame + 1, time
        return posture

    def finish(self) -> list[PathPosture]:
        """Return the path of the last `lag` pictures; `update` may be called again."""
        return [self._oldest() for _ in range(len(self._waiting))]

    def _oldest(self) -> PathPosture:
        """Remove the oldest stored picture, and return it with its posture on the path."""
        number, frame = self._waiting.popleft()
        share = self._trellis.marginals()[0]
        _, joints, _ = expected_posture(frame, self._trellis.stages[0].survivor, share)
        self._trellis.stages.pop(0)
        return PathPosture(number, frame.time, joints)

    def _view(self, points: Array, time: float, root: ArrayLike | None) -> View:
        """Make the view of one picture."""
        missing = np.isnan(points[:, :2]).any(axis=1, keepdims=True)
        image = np.where(missing, np.nan, points[:, :2])[None]
        confidence = np.where(missing, np.nan, points[:, 2:] if points.shape[1] == 3 else np.nan)[None]
        names = POINTS[: len(points)]
        if self.layout:
            names, image, _ = self.layout.seen((), image)
            confidence = self.layout.seen((), confidence)[1]
        detections = Detections(
            points=image,
            confidence=confidence[..., 0],
            names=names,
            frame=np.zeros(1, dtype=np.intp),
            time=np.array([time]),
        )
        view = replace(detections.view(self.camera), **self._known)
        return view if root is None else replace(view, root=np.asarray(root, dtype=np.float64)[None])
