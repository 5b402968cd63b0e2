"""The truth that `posekit render` draws beside what was recovered: of the view itself, or of another file."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING

from posekit.errors import InputError
from posekit.skeleton import JOINTS

if TYPE_CHECKING:
    from posekit.formats.held import HeldPostures
    from posekit.formats.own import Result, View
    from posekit.formats.recognising import Recognised
    from posekit.geometry import Array


def before_camera(result: Result, path: Path) -> tuple[Array, str]:
    """Read the truth of a result's frames in the frame of the camera that it holds; say how it was laid.

    Axes are reconciled by the image of the result's postures: those of the motion's world may be others than the
    calibration's. So are frames: seconds of pictures may be assumed ones, and picture k the motion's frame k.

    Raises
    ------
    InputError
        Where the file has no truth of these frames, the camera's place is not known, or the motion is not seen where
        the postures are.
    """
    import numpy as np

    from posekit.cameras import PinholeCamera
    from posekit.formats.format import Content
    from posekit.formats.held_postures import held_postures
    from posekit.formats.recognising import recognise
    from posekit.views.truth import turned_before

    camera, times = result.camera, np.array([one.time for one in result.frames])
    found = recognise(path)
    if found.holds is Content.VIEW:
        return _of_view(path, len(times)), "its frames are the result's"
    held = held_postures(path, found)
    image = np.full((len(times), len(JOINTS), 2), np.nan)
    if camera is not None:
        sees = PinholeCamera(K=camera.K, distortion=camera.distortion)
        for k, frame in enumerate(result.frames):
            if len(frame.joints):
                first = 0 if frame.answer is None else int(frame.answer.representatives[0])
                image[k] = sees.project(frame.joints[first])
    readers: list[tuple[Callable[[], Array], str]] = [
        (lambda: _by_second(held, path, times), ""),
        (
            lambda: _by_number(held, len(times)),
            "; picture k is its frame k: at their seconds it is farther off",
        ),
    ]
    laid, refused = [], []
    for read, how in readers:
        try:
            laid.append((*turned_before(camera, image, read()), how))
        except InputError as error:
            refused.append(error)
    if not laid:
        raise refused[0]
    turned, told, how = min(laid, key=lambda one: one[1].error)
    axes = f"its axes {told.turn} are the camera's world"
    return turned, f"{axes}; it is seen {told.error:.1f} px beside the postures (median){how}"


def true_joints(path: Path, view: View | None, view_path: Path | None, times: Array) -> Array:
    """Read the truth of some frames (F, 14, 3), metres; NaN where not known.

    Parameters
    ----------
    path : Path
        A view with truth, or motion of the same frames or seconds.
    view : View, optional
        What was recovered; where its camera's place in the world is known, motion is turned into its frame.
    view_path : Path, optional
        Its file.
    times : array (F,)
        Of the frames, seconds.

    Raises
    ------
    InputError
        Where the file has no truth of these frames.
    """
    from posekit.formats.held_postures import held_postures
    from posekit.formats.recognising import recognise

    found = recognise(path)
    seen = joints_in_view(path, found, view, view_path, len(times))
    return _by_second(held_postures(path, found), path, times) if seen is None else seen


def joints_in_view(
    path: Path, found: Recognised, view: View | None, view_path: Path | None, count: int
) -> Array | None:
    """Read the truth of so many frames in the frame of a view's camera; None where motion is not seen by it.

    The parameters are those of `true_joints`, and what the file was found to be.
    """
    from posekit.formats.format import Content
    from posekit.formats.own import OpenCVModel

    if found.holds is Content.VIEW:
        return _of_view(path, count)
    placed = view is not None and isinstance(view.camera, OpenCVModel) and view.camera.R is not None
    if placed and view_path is not None and found.holds is Content.MOTION:
        from posekit.views.given_views import given_views
        from posekit.views.source import Source

        return given_views(view_path, Source(), path)[0].view.truth
    return None


def _of_view(path: Path, count: int) -> Array:
    """Read the truth of a view of so many frames (count, 14, 3)."""
    import numpy as np

    from posekit.formats.own import read_view

    given = read_view(path)
    if len(given) != count or not np.isfinite(given.truth).any():
        raise InputError(
            f"--truth {path}: a view of {len(given)} frames"
            + ("" if np.isfinite(given.truth).any() else " without truth")
            + f"; expected the truth of {count} frames; give the view that was recovered"
        )
    return given.truth


def _by_number(held: HeldPostures, count: int) -> Array:
    """Return the first frames of motion (count, 14, 3), one a picture; NaN where it has none."""
    import numpy as np

    own = held.frame < count
    joints = np.full((count, len(JOINTS), 3), np.nan)
    joints[held.frame[own]] = held.postures.joints[own]
    return joints


def _by_second(held: HeldPostures, path: Path, times: Array) -> Array:
    """Return motion at the seconds of pictures (F, 14, 3); frame by frame where it has as many."""
    import numpy as np

    last = int(held.frame.max(initial=-1))
    if last + 1 == len(times):
        return _by_number(held, len(times))
    since = held.time - held.time[:1]
    if not len(since) or not (np.isfinite(since).all() and np.isfinite(times).all()):
        raise InputError(
            f"--truth {path}: {last + 1} frames; expected {len(times)}, or times of both that say which is which"
        )
    step = float(np.median(np.diff(since))) if len(since) > 1 else 0.0
    # Second 0 is the motion's first frame; else, where that has more pictures, the first picture's.
    tried = []
    for asked in (times, times - times[:1]):
        nearest = np.abs(since[None] - asked[:, None]).argmin(axis=1)
        tried.append((nearest, np.abs(since[nearest] - asked) <= max(0.51 * step, 1e-9)))
    nearest, near = max(tried, key=lambda one: int(one[1].sum()))
    if not near.any():
        raise InputError(
            f"--truth {path}: none of its frames is at the time of a picture; expected the same seconds"
        )
    joints = np.full((len(times), len(JOINTS), 3), np.nan)
    joints[near] = held.postures.joints[nearest[near]]
    return joints
