"""What a format of key points declares."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING

from posekit.formats.format import Content, Format
from posekit.formats.given_file import GivenFile

if TYPE_CHECKING:
    from posekit.formats.keypoints.keypoints import KeyPoints
    from posekit.formats.skeleton_maps import SkeletonMap


@dataclass(frozen=True, kw_only=True)
class KeyPointFormat(Format):
    """A format of key points: what a detector writes.

    Parameters
    ----------
    read : callable
        ``read(given, layout)`` reads a file or folder, with the user's skeleton map, or None for the format's own.
    skeletons : tuple of str
        The built-in skeleton maps that its files come with.
    """

    holds: Content = Content.KEY_POINTS
    read: Callable[[GivenFile, SkeletonMap | None], KeyPoints]
    skeletons: tuple[str, ...] = ()
