"""Rows of image points: frames of one camera and one person, as a table holds them; a frame may have no neck."""

from __future__ import annotations

import tempfile
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Final

import numpy as np
from numpy.typing import NDArray

from posekit.formats.own import ScaledOrthographicModel, View, read_view, write_view
from posekit.geometry import Array
from posekit.recovery.observed import ROOT_LOST, why_neckless
from posekit.skeleton import HEAD, JOINTS, POINTS

N_IMAGE_POINTS: Final = len(JOINTS)


@dataclass(frozen=True, kw_only=True, eq=False)
class ImageRows:
    """F frames in order.

    Parameters
    ----------
    frame : int array (F,)
        The number of each in its recording, from 0.
    time : array (F,)
        Seconds.
    points : array (F, 19 + K, 2)
        Joints, head points and those of the user's own as `View` has them; NaN where one is not seen.
    confidence : array (F, 19)
        How sure the detector is of each point; NaN where it does not say.
    root : array (F, 3)
        The neck in space where it is known, metres.
    """

    frame: NDArray[np.int64]
    time: Array
    points: Array
    confidence: Array
    root: Array

    def __len__(self) -> int:
        """Count the frames."""
        return len(self.frame)

    @classmethod
    def of_view(cls, view: View, frame: NDArray[np.int64] | None = None) -> ImageRows:
        """Take the rows of a view, its frames numbered from 0 if no numbers are given."""
        return cls(
            frame=np.arange(len(view)) if frame is None else frame,
            time=view.time,
            points=np.concatenate([view.image, view.head_image, view.own_head_image], axis=1),
            confidence=view.confidence,
            root=view.root,
        )

    def part(self, rows: slice | NDArray[np.intp]) -> ImageRows:
        """Take some of the rows."""
        return ImageRows(
            frame=self.frame[rows],
            time=self.time[rows],
            points=self.points[rows],
            confidence=self.confidence[rows],
            root=self.root[rows],
        )

    def laid_out(self, frame: NDArray[np.int64], time: Array) -> ImageRows:
        """Lay the rows into a longer recording, whose other frames see nothing."""
        place = np.searchsorted(frame, self.frame)
        laid = nothing_seen(frame, time, self.points.shape[1])
        laid.points[place] = self.points
        laid.confidence[place] = self.confidence
        laid.root[place] = self.root
        return laid

    def usable(self, head: View) -> NDArray[np.bool_]:
        """Tell which frames (F,) a tree can grow in: those that show the neck; uncalibrated ones any joint."""
        seen = np.isfinite(self.points[:, :N_IMAGE_POINTS, 0])
        uncalibrated = isinstance(head.camera, ScaledOrthographicModel)
        return np.asarray(seen.any(axis=1) if uncalibrated else seen[:, 0])

    def lacking(self, head: View) -> list[tuple[str, str]]:
        """Say of each frame why it is not usable, and what its leaves are lost to, as `posekit.recover` says it."""
        if isinstance(head.camera, ScaledOrthographicModel):
            return [("no joint is seen", ROOT_LOST)] * len(self)
        return [why_neckless(image, head.derived) for image in self.points[:, :N_IMAGE_POINTS]]

    def view(self, head: View) -> View:
        """Make the view of the rows, its camera and person those of `head`.

        Raises
        ------
        InputError
            Where the neck is seen in none of the frames of a calibrated camera, or a number is none.
        """
        return replace(
            head,
            time=self.time,
            image=self.points[:, :N_IMAGE_POINTS],
            head_image=self.points[:, HEAD],
            own_head_image=self.points[:, len(POINTS) :],
            confidence=self.confidence,
            root=self.root,
            truth=np.empty(0),
        )


def nothing_seen(frame: NDArray[np.int64], time: Array, points: int = len(POINTS)) -> ImageRows:
    """Make rows in which nothing is seen."""
    count = len(frame)
    return ImageRows(
        frame=frame,
        time=time,
        points=np.full((count, points, 2), np.nan),
        confidence=np.full((count, len(POINTS)), np.nan),
        root=np.full((count, 3), np.nan),
    )


def first_usable(view: View) -> View:
    """Return the first frame of a view that can be recovered; the first of all where none can."""
    rows = ImageRows.of_view(view)
    return rows.part(np.argmax(rows.usable(view), keepdims=True)).view(view)


def head_text(view: View) -> str:
    """Spell a view's camera and person: the ``posekit.view/1`` document of a frame (`first_usable`), in metres."""
    first = first_usable(view)
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "head.json"
        write_view(path, replace(first, unit="m"))
        return path.read_text(encoding="utf-8")


def read_head(text: str) -> View:
    """Read what `head_text` spelled: a view of one frame.

    Raises
    ------
    InputError
        Where it is no ``posekit.view/1`` document.
    """
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "head.json"
        path.write_text(text, encoding="utf-8")
        return read_view(path)
