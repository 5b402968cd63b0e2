"""From one picture's points to a view of one frame: the camera, the person and the layout are known beforehand."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Final

import numpy as np
from numpy.typing import ArrayLike

from posekit.body import Figure
from posekit.body.anthropometry import SegmentLengths, lengths_from_proportions
from posekit.cameras import PinholeCamera
from posekit.cameras.calibrated import CalibratedCamera, needs_undistortion
from posekit.cameras.guesses import camera_from_fov
from posekit.cameras.undistortion import undistorted
from posekit.errors import InputError
from posekit.formats.keypoints import KeyPoints
from posekit.formats.own import CameraModel, OpenCVModel, View
from posekit.formats.skeleton_maps import LANDMARK_INDEX, SkeletonMap
from posekit.geometry import Array
from posekit.skeleton import HEAD, JOINT, JOINTS, POINTS
from posekit.views.camera import model_of as calibrated_model
from posekit.views.person import DEFAULT_PROPORTIONS, figure_of
from posekit.views.person_view import person_view

WEBCAM_DEGREES: Final = 78.0
"""Diagonal angle of view that is taken for a camera of which only the size of its pictures is known: that of a usual
webcam (Logitech C920, data sheet). Laptops' have some 70 to 80, phones' main cameras about the same."""

STANDING_METRES: Final = 4.0
"""How far away the figure stands that is recovered beforehand."""

LiveCamera = CalibratedCamera | CameraModel
"""What a user has of a camera."""


@dataclass(frozen=True, kw_only=True, eq=False)
class LiveSight:
    """How pictures of one person by one camera become views.

    Parameters
    ----------
    camera : OpenCVModel
        What saw the points once they are undistorted.
    lens : CalibratedCamera, optional
        What they are undistorted for, where `camera` has not that distortion.
    layout : SkeletonMap, optional
        What a detector's points are; joints in tree order, maybe followed by the head's points, if not given.
    person : Figure, optional
        Whose lengths a view of a detector's points has.
    known : mapping
        What every view says besides: lengths or a stature, and how far they and the points may be off.
    """

    camera: OpenCVModel
    lens: CalibratedCamera | None
    layout: SkeletonMap | None
    person: Figure | None
    known: Mapping[str, object]

    @staticmethod
    def of(
        camera: LiveCamera,
        layout: SkeletonMap | None,
        lengths: Mapping[str, float] | None,
        stature: float | None,
        deviation: float | None,
    ) -> LiveSight:
        """Make one of what a user knows.

        Raises
        ------
        InputError, FigureError
            Where lengths and a stature are both given, or make no body.
        """
        if lengths is not None and stature is not None:
            raise InputError(
                "Tracker: lengths and a stature are given; expected one of them; leave out the stature"
            )
        lens = camera if isinstance(camera, CalibratedCamera) and needs_undistortion(camera) else None
        known: dict[str, object] = {"deviation": deviation}
        person = None
        if layout is None:
            known |= {"lengths": dict(lengths or {}), "stature": stature}
        else:
            given = None
            if lengths is not None:
                given = SegmentLengths(lengths=lengths, deviation={}, source="given")
            elif stature is not None:
                given = lengths_from_proportions(DEFAULT_PROPORTIONS, stature)
            person, _, known["length_deviation"] = figure_of(given, layout)
        return LiveSight(camera=model_of(camera), lens=lens, layout=layout, person=person, known=known)

    @property
    def names(self) -> tuple[str, ...]:
        """The names of the points that a picture has, in their order."""
        return POINTS if self.layout is None else self.layout.points

    def view(self, points: ArrayLike, time: float, root: ArrayLike | None = None) -> View | None:
        """Make a view of one picture's points; None where it shows no neck, or not what a neck is put between.

        Raises
        ------
        InputError
            Where the points are of another number, or a coordinate is impossible.
        """
        image, confidence = self._read(points)
        if self.lens is not None:
            image = undistorted(image, self.lens)
        view = (
            self._of_joints(image, confidence, time)
            if self.layout is None
            else self._of_layout(image, confidence, time)
        )
        return (
            view
            if view is None or root is None
            else replace(view, root=np.asarray(root, dtype=np.float64)[None])
        )

    def standing(self, figure: Figure) -> View:
        """Make a view of a figure that stands before the camera, its points off by less than a pixel."""
        forward, left, up = figure.neutral_points.T
        place = np.stack([left, -up, STANDING_METRES - forward], axis=-1)
        image = PinholeCamera(K=self.camera.K, distortion=self.camera.distortion).project(place)
        image += np.cos(np.arange(image.size)).reshape(image.shape) / 2
        derived = () if self.layout is None else ("neck", "pelvis")
        known = {**self.known} if self.person is None else {**self.known, "lengths": self.person.lengths}
        return View(
            camera=self.camera,
            time=np.zeros(1),
            image=image[None, : len(JOINTS)],
            derived=derived,
            **known,  # type: ignore[arg-type]
        )

    def _read(self, points: ArrayLike) -> tuple[Array, Array]:
        """Return points (K, 2) and confidences (K,)."""
        given = np.array(points, dtype=np.float64)
        counts = (len(JOINTS), len(POINTS)) if self.layout is None else (len(self.names),)
        if given.ndim != 2 or len(given) not in counts or given.shape[1] not in (2, 3):
            of = "the joints in tree order" if self.layout is None else f"those of {self.layout.name}"
            raise InputError(
                f"points: got shape {given.shape}; expected ({' or '.join(map(str, counts))}, 2), {of}, or a third "
                "column of confidences; give NaN for what was not seen"
            )
        image = given[:, :2]
        image[np.isnan(image).any(axis=1)] = np.nan
        confidence = given[:, 2] if given.shape[1] == 3 else np.full(len(given), np.nan)
        return image, np.where(np.isnan(image[:, 0]), np.nan, confidence)

    def _of_joints(self, image: Array, confidence: Array, time: float) -> View | None:
        if np.isnan(image[JOINT["neck"], 0]):
            return None
        every, sure = np.full((len(POINTS), 2), np.nan), np.full(len(POINTS), np.nan)
        every[: len(image)], sure[: len(image)] = image, confidence
        return View(
            camera=self.camera,
            time=np.array([time]),
            image=every[None, : len(JOINTS)],
            head_image=every[None, list(HEAD)],
            confidence=sure[None],
            **self.known,  # type: ignore[arg-type]
        )

    def _of_layout(self, image: Array, confidence: Array, time: float) -> View | None:
        if self.layout is None or self.person is None:
            return None
        found = KeyPoints(
            format="live",
            source="points",
            layout=self.layout,
            pictures=("",),
            time=np.array([time]),
            frame=np.zeros(1, dtype=np.intp),
            points=image[None],
            confidence=confidence[None],
        )
        necks = found.landmarks[0, [LANDMARK_INDEX["neck"], LANDMARK_INDEX["mid_shoulders"]]]
        if np.isnan(necks).any(axis=1).all():
            return None
        return person_view(found, self.camera, self.person, **self.known)  # type: ignore[arg-type]


def likely_camera(size: tuple[int, int]) -> CalibratedCamera:
    """Guess the camera of pictures of which only the size is known: a webcam."""
    return camera_from_fov(size, WEBCAM_DEGREES, "diagonal")


def model_of(camera: LiveCamera) -> OpenCVModel:
    """Return the camera of points that are undistorted where its lens needs it.

    Raises
    ------
    InputError
        Where it is none of OpenCV's.
    """
    if isinstance(camera, CalibratedCamera):
        return calibrated_model(camera)
    if isinstance(camera, OpenCVModel):
        return camera
    raise InputError(
        f"Tracker: a camera of the model {type(camera).__name__}; expected an OpenCVModel or a calibrated camera; give "
        "one, or leave it out and give size"
    )
