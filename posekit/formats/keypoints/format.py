"""What a format of key points is: its name, how it is recognised, read and written."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from posekit.formats.keypoints.given import Given
from posekit.formats.keypoints.keypoints import KeyPoints
from posekit.formats.skeleton_maps import SkeletonMap


@dataclass(frozen=True, kw_only=True)
class Format:
    """One format.

    Parameters
    ----------
    name : str
        As ``--format`` takes it.
    says : str
        What it is, in a line.
    suits : callable
        Tells whether a file or folder looks like it, by its structure; never raises for what is another format.
    read : callable
        Reads it, with the user's skeleton map or None for the format's own.
    write : callable, optional
        Writes key points whole or not at all; what the format cannot carry is left out. Missing where it is read only.
    skeletons : tuple of str
        The built-in skeleton maps that its files come with.
    """

    name: str
    says: str
    suits: Callable[[Given], bool]
    read: Callable[[Given, SkeletonMap | None], KeyPoints]
    write: Callable[[Path, KeyPoints], None] | None = None
    skeletons: tuple[str, ...] = ()
