"""Live key points line by line: every picture's answer as soon as its line is read."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import IO, Any

import numpy as np

from posekit.cameras.guesses import camera_from_focal35, camera_from_fov
from posekit.errors import InputError
from posekit.formats.own.live_schema import LiveFrame, LiveHeader
from posekit.live.lines import camera_of, document_of, parse_line, points_of, read_lines
from posekit.live.sight import LiveCamera, likely_camera, model_of
from posekit.live.tracker import Tracker
from posekit.settings import RecoverSettings
from posekit.views.camera import named_camera
from posekit.views.person import segment_lengths
from posekit.views.source import Source


@dataclass(frozen=True, kw_only=True)
class LiveRequest:
    """What is asked of a stream; a header may say what is left open.

    Parameters
    ----------
    settings : RecoverSettings
        What is asked of each picture.
    source : Source
        Camera, person and layout.
    lag : int
        How many pictures later the path tells where somebody was.
    """

    settings: RecoverSettings
    source: Source
    lag: int

    def tracker(self, header: LiveHeader | None) -> Tracker:
        """Make the tracker of a stream with this header.

        Raises
        ------
        PosekitError
            Where camera, person or layout are impossible, or neither a camera nor a size is known.
        """
        said, source = header or LiveHeader(), self.source
        camera = self._camera(said)
        found = segment_lengths(source, model_of(camera)) if source.lengths or source.calibrate else None
        given = said.lengths if source.stature is None else None
        return Tracker(
            self.settings,
            camera=camera,
            lengths=given if found is None else found.lengths,
            stature=None if found or given else source.stature or said.stature,
            deviation=source.deviation or said.deviation,
            layout=source.skeleton or said.layout,
            lag=self.lag,
        )

    def _camera(self, said: LiveHeader) -> LiveCamera:
        """Choose the camera: an option's, the header's, or a usual one for the size of its pictures."""
        source = self.source
        if source.camera:
            return named_camera(source.camera)
        size = source.size or (None if said.size is None else (said.size[0], said.size[1]))
        given = camera_of(said)
        guessed = source.fov is not None or source.focal35 is not None
        if given is not None and not guessed:
            return given
        if size is None:
            option = (
                "--fov and --focal35 need it" if guessed else "neither an option nor a header says the camera"
            )
            raise InputError(
                f"--size: the size of the pictures is not known, and {option}; expected WIDTHxHEIGHT; give --size, or "
                '{"size": [width, height]} in the first line'
            )
        if source.fov is not None:
            return camera_from_fov(size, source.fov, "horizontal")
        return likely_camera(size) if source.focal35 is None else camera_from_focal35(size, source.focal35)


def answers(
    stream: IO[bytes],
    make: Callable[[LiveHeader | None], Tracker],
    *,
    least: float = 0.0,
    keep_going: bool = False,
) -> Iterator[dict[str, Any]]:
    """Answer the pictures of a stream, each before the next is read.

    Parameters
    ----------
    stream : binary file
        JSON lines (`posekit.formats.own.live_schema`).
    make : callable
        Makes the tracker of a header, or of none, once the first line is there.
    least : float
        Points with a smaller confidence count as not seen.
    keep_going : bool
        Whether a line that cannot be read is answered with its ``error``, instead of ending all.

    Raises
    ------
    PosekitError
        Where a line cannot be read, or no tracker can be made.
    """
    tracker = None
    for first, (where, line) in _marked(read_lines(stream)):
        try:
            read = parse_line(where, line)
            if isinstance(read, LiveHeader) and not first:
                raise InputError(
                    f"{where}: got no points; expected a picture, as only the first line may be a header; add points"
                )
        except InputError as error:
            if not keep_going:
                raise
            yield {"error": str(error)}
            continue
        if tracker is None:
            tracker = make(read if isinstance(read, LiveHeader) else None)
        if isinstance(read, LiveFrame):
            try:
                yield _answer(read, tracker, where, least)
            except InputError as error:
                if not keep_going:
                    raise
                yield {"error": str(error)}


def _marked(lines: Iterator[tuple[str, bytes]]) -> Iterator[tuple[bool, tuple[str, bytes]]]:
    """Say of each line whether it is the first."""
    return ((number == 0, line) for number, line in enumerate(lines))


def _answer(frame: LiveFrame, tracker: Tracker, where: str, least: float) -> dict[str, Any]:
    """Hand a line's points to a tracker, and say as JSON has it what it returns."""
    points = points_of(frame, tracker.names, where)
    points[points[:, 2] < least] = np.nan
    try:
        return document_of(tracker.update(points, frame.time, root=frame.root))
    except InputError as error:
        raise InputError(f"{where}: {error}") from None
