"""`posekit render … --angles`: joint angles over time, with their limits."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from posekit.cli.options import about
from posekit.cli.terminal import say
from posekit.cli.true_joints import true_joints
from posekit.conversion.chosen_postures import chosen_frames, frame_numbers
from posekit.conversion.given import read_given
from posekit.display.plural import plural
from posekit.errors import InputError, ViewerError


def render_angles(
    given: Sequence[Path],
    seen: Sequence[Path],
    output: Path,
    *,
    angles: str,
    frame: str,
    posture: str,
    truth: Path | None,
) -> None:
    """Draw angles over time.

    Parameters
    ----------
    given, seen : sequence of Path
        The file, and the view that it was recovered from, if any.
    output : Path
        The plot.
    angles, frame, posture : str
        Which, as the options have it.
    truth : Path, optional
        The truth to be drawn beside them; else the view's own, if it has one.
    """
    import numpy as np

    from posekit.formats.own import ObjectResult
    from posekit.safe_io.writing import check_target
    from posekit.validators.ranges import load_ranges
    from posekit.viewer.plots.angle_plot import judged_limits, plot_angles
    from posekit.viewer.plots.angle_tracks import chosen_angles
    from posekit.viewer.plots.plot_file import PLOT_FORMATS, drawing, save
    from posekit.viewer.scene.drawn_subject import subject_of

    if output.suffix.lower() not in PLOT_FORMATS:
        raise ViewerError(
            f"{output}: the format is {output.suffix or 'none'}; --angles expected one of {', '.join(PLOT_FORMATS)}"
        )
    if len(given) > 1 or len(seen) > 1:
        raise InputError(f"--angles: got {len(given)} files; expected one a plot")
    check_target(output)
    count = len(chosen_angles(angles))
    with drawing():  # says what is missing before the work
        pass
    content, view = read_given(given[0], seen[0] if seen else None)
    if isinstance(content, ObjectResult):
        raise InputError(
            f"{given[0]}: --angles: are a person's; got an object; expected its pictures: leave --angles out"
        )
    with about(given[0]):
        subject = subject_of(content, view)
    frames = frame_numbers(frame, len(subject.frames))
    rows = list(range(len(subject.frames)) if frames is None else frames)
    true = None
    if truth is not None:
        times = np.array([one.time for one in subject.frames])
        true = true_joints(truth, view, seen[0] if seen else None, times)
    limits = judged_limits(content)
    say(f"limits: {'as the result was judged' if limits else 'anatomical, the usual ones'}")
    plot = plot_angles(
        content,
        view,
        angles=angles,
        drawn=chosen_frames(subject, content, posture, rows, moving=True),
        frames=rows,
        limits=limits or load_ranges("anatomical").limits,
        truth=true,
        subject=subject,
    )
    save(plot, output)
    say(f"written: {output} ({plural(count, 'angle')}, {plural(len(rows), 'frame')})")
