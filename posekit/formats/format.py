"""What a file format is: its name, what its files hold, and how they are recognised."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from enum import StrEnum

from posekit.formats.given_file import GivenFile


class Content(StrEnum):
    """What a file holds, in words that complete the sentence "the file holds ..."."""

    VIEW = "a view"
    RESULT = "a result"
    POSTURES = "postures"
    CONFIGURATIONS = "configurations"
    SURVIVORS = "a table of survivors"
    KEY_POINTS = "key points"
    MOTION = "motion"
    CAMERAS = "cameras"
    ROBOT = "a robot"
    OBJECTS = "objects"
    REPORT = "a report of validation"
    EVALUATION = "an evaluation"
    BATCH = "results of a batch"
    OTHER = "another file of posekit"

    @property
    def word(self) -> str:
        """The content as an argument of `posekit.open`: ``key-points``."""
        return self.name.lower().replace("_", "-")


@dataclass(frozen=True, kw_only=True)
class Format:
    """What every format declares; the kinds of formats add how their files are read and written.

    Parameters
    ----------
    name : str
        The format's name, as ``--format`` takes it; no other format of the same content has it.
    title : str
        What the format is, in one line.
    holds : Content
        What its files hold.
    suffixes : tuple of str
        The ends of its files' names, in lower case with the dot; empty for a format whose files are named at will.
    folder : bool
        Whether a folder can be of this format.
    looks_like : callable
        Tells whether a file or folder can be of this format, by its structure: ``looks_like(given)``. It is asked of
        files whose suffix is one of `suffixes`, of folders where `folder` is set, and of files whose name tells
        nothing; it reads as little as it can, imports no heavy library, and returns False for files of other formats
        instead of raising.
    """

    name: str
    title: str
    holds: Content
    suffixes: tuple[str, ...] = ()
    folder: bool = False
    looks_like: Callable[[GivenFile], bool]

    @property
    def reads(self) -> bool:
        """Whether files of this format can be read."""
        return True
