"""Image points as NumPy's arrays: ``image`` (F, 14, 2), and what else there is of `posekit.View`'s arrays.

``head_image`` (F, 5, 2), ``own_head_image`` (F, K, 2), ``confidence`` (F, 19), ``root`` (F, 3), ``time`` (F,),
``frame`` (F,); and ``view``, a text: camera and person, as in the metadata of `posekit.batch.view_table`.
"""

from __future__ import annotations

import zipfile
from pathlib import Path

import numpy as np

from posekit.batch.digests import MAX_INPUT_BYTES
from posekit.batch.image_rows import ImageRows
from posekit.safe_io import open_npz, refusal
from posekit.skeleton import HEAD_POINTS, JOINTS, POINTS
from posekit.views.person_view import ASSUMED_VIEW_RATE


def is_view_arrays(path: Path) -> bool:
    """Tell whether a file is an NPZ of image points."""
    if path.suffix.lower() != ".npz" or not zipfile.is_zipfile(path):
        return False
    with open_npz(path, limit=MAX_INPUT_BYTES) as archive:
        return "image" in archive.names


def read_view_arrays(path: Path, rate: float | None = None) -> tuple[ImageRows, str]:
    """Read the rows, and camera and person; those are empty where the file does not say them.

    Raises
    ------
    InputError
        Where an array has another shape or type than it should, or a number is infinite.
    """
    with open_npz(path, limit=MAX_INPUT_BYTES) as archive:
        image = archive.array("image", "f", (None, len(JOINTS), 2)).astype(np.float64)
        count = len(image)
        if not count:
            raise refusal(path, "image", "no frame", "at least one", "give another file")

        def optional(name: str, shape: tuple[int, ...]) -> np.ndarray:
            if name not in archive.names:
                return np.full((count, *shape), np.nan)
            return archive.array(name, "f", (count, *shape)).astype(np.float64)

        frame = archive.array("frame", "iu", (count,)) if "frame" in archive.names else np.arange(count)
        timed = rate is None and "time" in archive.names
        own = (
            archive.array("own_head_image", "f", (count, None, 2)).astype(np.float64)
            if "own_head_image" in archive.names
            else np.empty((count, 0, 2))
        )
        points = np.concatenate([image, optional("head_image", (len(HEAD_POINTS), 2)), own], axis=1)
        rows = ImageRows(
            frame=frame.astype(np.int64),
            time=optional("time", ()) if timed else frame / (rate or ASSUMED_VIEW_RATE),
            points=points,
            confidence=optional("confidence", (len(POINTS),)),
            root=optional("root", (3,)),
        )
        head = str(archive.array("view", "U", ())) if "view" in archive.names else ""
    for name in ("time", "points", "confidence", "root"):
        if np.isinf(getattr(rows, name)).any():
            raise refusal(path, name, "an infinite number", "a number, or NaN", "correct it")
    return rows, head
