"""One person of whom something is drawn over pictures: the postures, the camera's size, the pictures' names."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from posekit.body import Figure
from posekit.errors import InputError
from posekit.formats.own import LeeChenModel, OpenCVModel, Result, View
from posekit.viewer.scene.drawn_subject import DrawnSubject, Shown, subject_of
from posekit.viewer.scene.likeliest import numbered, opening_frames


@dataclass(frozen=True, kw_only=True, eq=False)
class OverlaidPerson:
    """One person through the frames of a recording.

    Parameters
    ----------
    name : str
        What errors call it: the file.
    frames : sequence of Shown
        What is drawn of each frame, the posture that is a body first; none where a frame has no posture.
    figure : Figure
        Whose capsules.
    size : (int, int), optional
        Of the view's pictures, pixels; None where it is not known.
    files : sequence of str
        The pictures that the frames were detected in, by name; empty where nobody says.
    detected : bool
        Whether the sights have the image points that were detected: without the view they are where survivors project.
    """

    name: str
    frames: Sequence[Shown]
    figure: Figure
    size: tuple[int, int] | None = None
    files: Sequence[str] = ()
    detected: bool = True


def overlaid_person(
    given: Result | View,
    view: View | None = None,
    *,
    name: str = "the result",
    frames: Sequence[Shown] | None = None,
    subject: DrawnSubject | None = None,
) -> OverlaidPerson:
    """Gather what is drawn of a result over its pictures.

    Parameters
    ----------
    given : Result or View
        The survivors; of a view its truth.
    view : View, optional
        What the result was recovered from: its image points, and the camera where the result does not hold it.
    name : str
        What errors call it.
    frames : sequence of Shown, optional
        What is drawn of each frame; by default the likeliest posture and what else it can be, or the likeliest path.
    subject : DrawnSubject, optional
        What `subject_of` gathers of the two, where that is done.

    Raises
    ------
    InputError
        Where the camera is not known, or has no pixels.
    """
    known = [one.camera["f"] for one in given.frames] if isinstance(given, Result) else []
    seen = given if isinstance(given, View) else view
    if (seen is not None and isinstance(seen.camera, LeeChenModel)) or any(f is not None for f in known):
        raise InputError(
            f"{name}: its camera is Lee & Chen's, whose image is in metres; expected one in pixels; without --over the "
            "image is drawn beside the postures"
        )
    subject = subject or subject_of(given, view)
    if frames is None:
        every = range(len(subject.frames))
        frames = numbered(opening_frames(subject, given, every, moving=True, most=None), every)
    if seen is None and not any(one.sight is not None for one in frames):
        raise InputError(
            f"{name}: the result does not hold the camera that it was recovered with; give the view beside it: "
            "--view VIEW"
        )
    camera = seen.camera if seen is not None else given.camera
    size = camera.size if isinstance(camera, OpenCVModel) else None
    return OverlaidPerson(
        name=name,
        frames=frames,
        figure=subject.figure,
        size=size,
        files=given.pictures if isinstance(given, Result) else (),
        detected=seen is not None,
    )
