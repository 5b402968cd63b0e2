"""What a picture, a film or a page shows of a file or an object: the command and `posekit.render` ask this."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from posekit.conversion.chosen_postures import chosen_frames, frame_numbers
from posekit.conversion.given import frame_count
from posekit.errors import InputError
from posekit.formats.own import ObjectResult, Postures, Result, View
from posekit.safe_io.writing import write_text

if TYPE_CHECKING:
    from posekit.formats.held_postures import HeldPostures
    from posekit.geometry import Array
    from posekit.viewer.scene.drawn_object import DrawnObject
    from posekit.viewer.scene.drawn_subject import DrawnSubject, Shown


@dataclass(frozen=True, kw_only=True, eq=False)
class DrawnChoice:
    """Which frames are drawn, and what of each.

    Parameters
    ----------
    frame : str
        ``K`` or ``A-B``, from 0. The first with a posture, or all where it moves, if empty.
    posture : str
        As `posekit.conversion.chosen_postures.chosen_frames` has it.
    rejected : bool
        Whether one pruned branch for each reason is drawn in place of survivors.
    truth : array (F, 14, 3), optional
        The true joints of all frames, drawn beside the others.
    """

    frame: str = ""
    posture: str = ""
    rejected: bool = False
    truth: Array | None = None

    def layout(self, *, moving: bool, through_view: bool = False) -> str:
        """Say how several postures are arranged where nothing is asked for."""
        return "superposed" if moving or through_view or self.truth is not None else "side-by-side"

    def of(
        self, content: Result | Postures | HeldPostures | ObjectResult, view: View | None, *, moving: bool
    ) -> tuple[DrawnSubject | DrawnObject, list[Shown]]:
        """Compose the frames that are drawn.

        Parameters
        ----------
        content : Result, Postures, HeldPostures or ObjectResult
            What is drawn.
        view : View, optional
            What a result was recovered from.
        moving : bool
            Whether frames are drawn one after another; else the first.

        Raises
        ------
        InputError
            Where a frame or a posture that is asked for is none, or postures have no pruned branches.
        """
        from posekit.viewer.scene.beside_truth import beside_truth
        from posekit.viewer.scene.branch import one_a_reason, rejected_of
        from posekit.viewer.scene.drawn_subject import subject_of
        from posekit.viewer.scene.likeliest import numbered

        if isinstance(content, ObjectResult):
            return self._of_object(content, moving=moving)
        subject = subject_of(content, view)
        frames = frame_numbers(self.frame, len(subject.frames))
        if frames is None:
            # A path bridges frames without a survivor.
            path = self.posture in ("", "path") and isinstance(content, Result) and content.paths is not None
            filled = [k for k, shown in enumerate(subject.frames) if len(shown) or (path and moving)]
            frames = filled if moving else filled[:1]
        if not moving:
            frames = frames[:1]
        if self.rejected:
            if not isinstance(content, Result):
                raise InputError("--rejected: postures have no pruned branches; expected a result or a view")
            return subject, [one_a_reason(rejected_of(content, subject, k)) for k in frames]
        one_each = moving or self.truth is not None
        chosen = chosen_frames(subject, content, self.posture, frames, moving=one_each)
        if self.truth is not None:
            chosen = [beside_truth(one, self.truth[k]) for one, k in zip(chosen, frames, strict=True)]
        if isinstance(content, Result):
            chosen = numbered(chosen, frames)
        return subject, chosen

    def _of_object(self, content: ObjectResult, *, moving: bool) -> tuple[DrawnObject, list[Shown]]:
        from posekit.viewer.scene.drawn_object import DrawnObject
        from posekit.viewer.scene.likeliest import MAX_BESIDE

        if self.rejected or self.truth is not None:
            raise InputError(
                "--rejected, --truth: are of persons; expected neither for an object; leave them out"
            )
        subject = DrawnObject.of(content)
        frames = frame_numbers(self.frame, len(subject.frames))
        if frames is None:
            frames = [k for k, shown in enumerate(subject.frames) if len(shown)]
        return subject, [
            subject.chosen(self.posture, k, 1 if moving else MAX_BESIDE)
            for k in (frames if moving else frames[:1])
        ]


def write_whole_page(
    output: Path,
    content: Result | Postures | HeldPostures | ObjectResult,
    view: View | None,
    *,
    frame: str,
    title: str,
) -> None:
    """Write the page of all survivors of some frames, with what checks find in them."""
    frames = frame_numbers(frame, frame_count(content))
    write_text(output, [page_of(content, view, frames=frames, title=title)])


def page_of(
    content: Result | Postures | HeldPostures | ObjectResult,
    view: View | None,
    *,
    frames: Sequence[int] | None,
    title: str,
    served: bool = False,
) -> str:
    """Make the page of all survivors of some frames, all of them where these are None."""
    if isinstance(content, ObjectResult):
        from posekit.viewer.object_page import object_page

        return object_page(content, frames=frames, title=title)
    from posekit.validation.page_findings import page_findings
    from posekit.viewer.page.page import page_html

    found = page_findings(content)
    return page_html(content, view, title=title, frames=frames, findings=found, served=served)
