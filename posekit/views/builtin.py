"""From synthetic scenes to views, and the built-in ones."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Literal

import numpy as np

from posekit.body import Figure, load_figure
from posekit.cameras.head import TABLE_A2
from posekit.errors import InputError
from posekit.formats.motion import UP_DIRECTIONS
from posekit.formats.own import CameraModel, LeeChenModel, OpenCVModel, ScaledOrthographicModel, View
from posekit.geometry import Array
from posekit.skeleton import HEAD_POINTS
from posekit.synthesis import SyntheticScene, seq1, seq2

BUILT_IN: dict[str, Callable[[], SyntheticScene]] = {"seq1": seq1, "seq2": seq2}
"""The two sequences of Lee & Chen 1985, §4, walked by posekit's own walker."""


def view_of(scene: SyntheticScene) -> View:
    """Make the view of a scene, with the truth.

    The 1985 camera's f is left open and the head's points are in Table A.2's frame, in which the paper gives
    the camera's position; another camera's intrinsics are known. Of the figure, the view says what is not the
    built-in one's.
    """
    model: CameraModel
    head = _head(scene)
    if scene.lee_chen_f is not None:
        model = LeeChenModel(f=None)
    else:
        model = OpenCVModel(K=scene.camera.K, distortion=scene.camera.distortion, size=scene.size)
    return View(
        camera=model,
        time=scene.time,
        image=scene.image,
        head_image=scene.head_image,
        root=scene.root,
        truth=scene.joints_cam,
        lengths=_differences(scene.figure),
        shoulders=_side(scene.figure),
        head_points=None if head is None else dict(zip(("neck", *HEAD_POINTS), head, strict=True)),
        unit="m" if scene.lee_chen_f is None else "cm",
    )


def in_world(view: View, scene: SyntheticScene, up: Array) -> View:
    """Return the view with its camera's place in the scene's world, where it stands still.

    Parameters
    ----------
    view : View
        Of `view_of`.
    scene : SyntheticScene
        What it shows.
    up : array (3,)
        The world's up; said where it is an axis.
    """
    R, t = scene.R_cam_world, scene.t_cam_world
    still = np.isfinite(R).all() and np.ptp(R, axis=0).max() == 0 and np.ptp(t, axis=0).max() == 0
    if not still or not isinstance(view.camera, OpenCVModel):
        return view
    axis = next((name for name, way in UP_DIRECTIONS.items() if np.allclose(way, up)), "")
    return replace(view, camera=replace(view.camera, R=R[0], t=t[0], up=axis))


def forget_camera(view: View) -> View:
    """Return the same pictures as photographs of which no camera is known: scaled orthographic, without a scale."""
    return View(
        camera=ScaledOrthographicModel(scale=None),
        time=view.time,
        image=view.image,
        truth=view.truth,
        lengths=view.lengths,
        shoulders=view.shoulders,
        stature=view.stature,
        unit=view.unit,
    )


def builtin_view(name: str) -> View:
    """Return a built-in view: ``seq1`` (camera ahead of the walker) or ``seq2`` (ahead and to the right).

    Raises
    ------
    InputError
        Where there is no view of that name.
    """
    if name not in BUILT_IN:
        raise InputError(f"{name!r} is not a built-in view; expected one of {', '.join(BUILT_IN)}")
    return view_of(BUILT_IN[name]())


def _head(scene: SyntheticScene) -> Array | None:
    """Return neck and head points (6, 3), metres, where the view has to tell them."""
    own, standard = scene.figure.head_points, load_figure().head_points
    built_in = np.allclose(own, standard, rtol=0, atol=1e-12)
    if scene.lee_chen_f is not None:
        return TABLE_A2.points if built_in else own + TABLE_A2.points[0]
    return None if built_in else own


def _side(figure: Figure) -> Literal["front", "behind"] | None:
    """Return on which side the shoulders lie, where it is known and the view has to tell it."""
    side = figure.shoulder_side
    return None if side == "undecided" or not _differences(figure) else side


def _differences(figure: Figure) -> dict[str, float]:
    """Return the lengths that are not the built-in figure's."""
    standard = load_figure().lengths
    return {
        name: length
        for name, length in figure.lengths.items()
        if not np.isclose(length, standard[name], rtol=0, atol=1e-12)
    }
