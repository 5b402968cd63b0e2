"""`posekit render … --angles`: joint angles over time, with their limits."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import typer

from posekit.cli.chosen_postures import chosen_frames, frame_numbers
from posekit.cli.given import read_given
from posekit.cli.options import about, distinct
from posekit.cli.true_joints import true_joints
from posekit.errors import InputError, ViewerError

if TYPE_CHECKING:
    from posekit.formats.held_postures import HeldPostures
    from posekit.formats.own import Postures, Result


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

    from posekit.safe_io.writing import check_target
    from posekit.viewer.plots.angle_plot import plot_angles
    from posekit.viewer.plots.angle_tracks import angle_tracks, chosen_angles
    from posekit.viewer.plots.plot_file import PLOT_FORMATS, drawing, save
    from posekit.viewer.scene.drawn_subject import subject_of

    if output.suffix.lower() not in PLOT_FORMATS:
        raise ViewerError(
            f"{output}: the format is {output.suffix or 'none'}; --angles expected one of {', '.join(PLOT_FORMATS)}"
        )
    if len(given) > 1 or len(seen) > 1:
        raise InputError(f"--angles: got {len(given)} files; expected one a plot")
    distinct(output, *given, *seen, truth)
    check_target(output)
    names = chosen_angles(angles)
    with drawing():  # says what is missing before the work
        pass
    content, view = read_given(given[0], seen[0] if seen else None)
    with about(given[0]):
        subject = subject_of(content, view)
    frames = frame_numbers(frame, len(subject.frames))
    rows = list(range(len(subject.frames)) if frames is None else frames)
    every = [subject.frames[k] for k in rows]
    drawn = chosen_frames(subject, content, posture, rows, moving=True)
    true = None
    if truth is not None:
        times = np.array([one.time for one in subject.frames])
        true = true_joints(truth, view, seen[0] if seen else None, times)[0][rows]
    elif view is not None and np.isfinite(view.truth).any():
        true = view.truth[rows]
    limits, said = _limits(content)
    tracks = angle_tracks(every, drawn, subject.figure, names, limits=limits, truth=true)
    path = bool(drawn) and drawn[0].caption.startswith("likeliest path")
    line = "likeliest path" if path else "likeliest" if any(len(one) > 1 for one in every) else "angle"
    save(plot_angles(tracks, line=line), output)
    typer.echo(f"limits: {said}")
    typer.echo(f"written: {output} ({len(tracks)} angles, {len(rows)} frames)")


def _limits(content: Result | Postures | HeldPostures) -> tuple[Mapping[str, tuple[float, float]], str]:
    """Return the limits that a result was judged by, degrees, else those that are usual, and say which."""
    from posekit.formats.own import Result
    from posekit.validators.ranges import load_ranges

    settings: Mapping[str, Any] = content.settings if isinstance(content, Result) else {}
    given = settings.get("range_limits")
    if isinstance(given, Mapping):
        return (
            {str(name): (float(ends[0]), float(ends[1])) for name, ends in given.items()},
            f"{settings.get('ranges')}, as the result was judged",
        )
    return {
        name: (float(low), float(high)) for name, (low, high) in load_ranges("anatomical").limits.items()
    }, ("anatomical, the usual ones")
