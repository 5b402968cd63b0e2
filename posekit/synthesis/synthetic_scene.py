"""A synthetic view: a figure, a camera, where every point is and where it is seen."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from posekit.body import Figure
from posekit.cameras import PinholeCamera
from posekit.errors import InputError
from posekit.geometry import Array
from posekit.skeleton import HEAD_POINTS, JOINTS, POINTS


def _absent() -> Array:
    return np.empty((0,))


@dataclass(frozen=True, kw_only=True, eq=False)
class SyntheticScene:
    """What a virtual camera sees of a figure in F frames, with the truth. NaN marks what is not known.

    Frames may be a sequence of one camera, or independent views of one person: everything is in the camera's
    frame, and only the intrinsics are shared.

    Parameters
    ----------
    figure : Figure
        The person: lengths, head, limits, capsules.
    camera : PinholeCamera
        Metres on the image plane where `lee_chen_f` is given, else pixels.
    joints_cam : array (F, 14, 3)
        The true joints, OpenCV camera frame, metres.
    head_cam : array (F, 5, 3), optional
        The true head points, likewise.
    time : array (F,), optional
        Seconds; without it, frames are counted.
    q : array (F, nq), optional
        The figure's configurations in the camera frame: forward kinematics at q gives the points.
    image, head_image : array (F, 14, 2) and (F, 5, 2), optional
        Where they are seen, y down; without them, the exact projections.
    R_cam_world, t_cam_world : array (F, 3, 3) and (F, 3), optional
        Extrinsics, where the scene has a world.
    lee_chen_f : float, optional
        The camera is the 1985 paper's, f metres from its image plane.
    size : (int, int), optional
        Width and height of the picture, pixels.
    labels : tuple of str, optional
        A word on each frame: the action of a clip.

    Raises
    ------
    InputError
        Where a shape is wrong, or a known point is not in front of the camera.
    """

    figure: Figure
    camera: PinholeCamera
    joints_cam: Array
    head_cam: Array = field(default_factory=_absent)
    time: Array = field(default_factory=_absent)
    q: Array = field(default_factory=_absent)
    image: Array = field(default_factory=_absent)
    head_image: Array = field(default_factory=_absent)
    R_cam_world: Array = field(default_factory=_absent)
    t_cam_world: Array = field(default_factory=_absent)
    lee_chen_f: float | None = None
    size: tuple[int, int] | None = None
    labels: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        n = len(self.joints_cam)
        shapes = {
            "joints_cam": (n, len(JOINTS), 3),
            "head_cam": (n, len(HEAD_POINTS), 3),
            "time": (n,),
            "q": (n, self.figure.model.nq),
            "image": (n, len(JOINTS), 2),
            "head_image": (n, len(HEAD_POINTS), 2),
            "R_cam_world": (n, 3, 3),
            "t_cam_world": (n, 3),
        }
        if n == 0:
            raise InputError("a scene without frames; ask for one or more")
        if self.labels and len(self.labels) != n:
            raise InputError(f"a scene of {n} frames has {len(self.labels)} labels; give one a frame or none")
        given = {name: np.array(getattr(self, name), dtype=np.float64) for name in shapes}
        left_out = {name for name, values in given.items() if values.shape == (0,)}
        arrays = {
            name: np.full(shapes[name], np.nan) if name in left_out else values
            for name, values in given.items()
        }
        for name, values in arrays.items():
            if values.shape != shapes[name]:
                raise InputError(f"a scene's {name} has shape {values.shape}; expected {shapes[name]}")
        if "time" in left_out:
            arrays["time"] = np.arange(n, dtype=np.float64)
        for points, image in (("joints_cam", "image"), ("head_cam", "head_image")):
            _check_in_front(arrays[points])
            if image in left_out:
                arrays[image] = self.camera.project(arrays[points])
        for name, values in arrays.items():
            values.flags.writeable = False
            object.__setattr__(self, name, values)

    def __len__(self) -> int:
        """Return the number of frames."""
        return len(self.time)

    @property
    def root(self) -> Array:
        """The neck (F, 3), camera frame, metres, where the head is not seen whole; NaN where it is.

        A head that is seen gives the neck; one that is not leaves it to be told.
        """
        headless = np.asarray(np.isnan(self.head_image).any(axis=(1, 2)))
        return np.where(headless[:, None], self.joints_cam[:, 0], np.nan)

    def select(self, frames: ArrayLike) -> SyntheticScene:
        """Return some of the frames, by index or mask, as a scene of the same camera."""
        rows: NDArray[np.intp] = np.arange(len(self))[np.asarray(frames)].reshape(-1)
        K = self.camera.K
        camera = self.camera if K.ndim == 2 else PinholeCamera(K=K[rows], distortion=self.camera.distortion)
        arrays = {name: getattr(self, name)[rows] for name in _PER_FRAME}
        labels = tuple(self.labels[k] for k in rows) if self.labels else ()
        return replace(self, camera=camera, labels=labels, **arrays)

    def with_noise(self, sigma: float, rng: np.random.Generator) -> SyntheticScene:
        """Add Gaussian noise to every image point; the truth stays.

        Parameters
        ----------
        sigma : float
            Standard deviation of each coordinate in the image's unit: pixels, or metres on the image plane.
        rng : Generator
            Seeded by the caller.

        Raises
        ------
        InputError
            Where sigma is negative or not finite.
        """
        if not 0 <= sigma < np.inf:
            raise InputError(f"noise is {sigma:g}; expected a standard deviation >= 0 in image units")
        noise = sigma * rng.standard_normal((len(self), len(POINTS), 2))
        split = len(JOINTS)
        return replace(
            self, image=self.image + noise[:, :split], head_image=self.head_image + noise[:, split:]
        )


_PER_FRAME = ("joints_cam", "head_cam", "time", "q", "image", "head_image", "R_cam_world", "t_cam_world")


def _check_in_front(points: Array) -> None:
    behind = np.asarray(points[..., 2] <= 0)
    if behind.any():
        frame, k = (int(index[0]) for index in np.nonzero(behind))
        names = JOINTS if points.shape[1] == len(JOINTS) else HEAD_POINTS
        raise InputError(
            f"{names[k]} of frame {frame} is at depth {points[frame, k, 2]:.3g} m; expected in front of the "
            "camera; move the camera away"
        )
