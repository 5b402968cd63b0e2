"""Names of the files that OpenPose writes, one a picture: ``clip_000000000012_keypoints.json``.

OpenPose writes a file for every picture that it looked at, whether there is a person in it or not (its maintainers,
issue 1854), so a number that is not there is a picture nobody looked at, and no picture here.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from pathlib import Path
from typing import Final

from posekit.safe_io import cut, refusal

KEYPOINTS_ENDING: Final = "_keypoints"
_NUMBER = re.compile(r"[0-9]+")


def picture_name(path: Path) -> str:
    """Return what a file's picture is called: ``clip_000000000012``."""
    return path.stem.removesuffix(KEYPOINTS_ENDING)


def check_one_camera(folder: Path, files: Sequence[Path]) -> None:
    """Refuse a folder whose names count the same pictures twice, as two cameras' do.

    ``cam1.0001`` and ``cam2.0001`` among others, or ``left_7`` beside ``right_7``: no number in the names tells all
    files apart. Names without numbers, and dated names, are pictures of their own.

    Raises
    ------
    InputError
        With two files that have the same number.
    """
    twice = _counted_twice([picture_name(path) for path in files])
    if twice:
        got = f"{cut(twice[0])} and {cut(twice[1])}: more than one series of pictures"
        remedy = "put each camera's files into a folder of its own"
        raise refusal(folder, "", got, "the pictures of one camera", remedy)


def _counted_twice(names: Sequence[str]) -> tuple[str, str] | None:
    """Return two names of different series that have the same number; None where all is one series."""
    numbers = [tuple(int(number) for number in _NUMBER.findall(name)) for name in names]
    widths = {len(found) for found in numbers}
    if len(widths) == 1:
        for column in range(widths.pop()):
            if len({found[column] for found in numbers}) == len(names):
                return None
    first: dict[int, str] = {}
    twice = []
    for name, found in zip(names, numbers, strict=True):
        if found and first.setdefault(found[-1], name) is not name:
            twice.append((first[found[-1]], name))
    enough = 1 if len({len(found) for found in numbers}) == 1 else 2  # odd names may share a number by chance
    return twice[0] if len(twice) >= enough else None
