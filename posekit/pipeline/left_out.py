"""View files of which some frames do not show the neck: the others are recovered, and those say why they are not."""

from __future__ import annotations

import json
import re
import tempfile
import warnings
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Final, TypeVar

import numpy as np
from numpy.typing import NDArray

from posekit.cameras import Array
from posekit.errors import InputError, PosekitError
from posekit.files import read_json
from posekit.files.validation import validated
from posekit.files.view_schema import SCHEMA, ScaledOrthographicCamera, ViewFile
from posekit.pipeline.recovery import FrameRecovery, Recovery

REASON: Final = "the neck, from which the tree grows, is not seen"
LOST_TO: Final = "neck/not_seen"

Opened = TypeVar("Opened")


@dataclass(frozen=True, kw_only=True, eq=False)
class LeftOut:
    """The frames of a file, and which of them are recovered.

    Parameters
    ----------
    time : array (F,)
        Seconds, of all frames.
    kept : int array (K,)
        Those that show the neck: the frames of the view that is recovered.
    """

    time: Array
    kept: NDArray[np.intp]

    def of_kept(self, rows: Sequence[Mapping[str, str]]) -> Sequence[Mapping[str, str]]:
        """Choose what is said of the frames that are kept, where something is said of each one."""
        return [rows[k] for k in self.kept.tolist()] if len(rows) == len(self.time) else rows

    def among_all(self, values: Array) -> Array:
        """Lay values (K, …) of the frames that are kept among those of all (F, …), the others NaN."""
        laid = np.full((len(self.time), *values.shape[1:]), np.nan)
        laid[self.kept] = values
        return laid

    def put_back(self, recovery: Recovery) -> Recovery:
        """Put the frames that were left out back into a recovery of the others, each with its reason."""
        of_kept = dict(zip(self.kept.tolist(), recovery.frames, strict=True))
        within = recovery.frames[0].group_within
        frames = [
            replace(of_kept[k], reason=self.renumbered(of_kept[k].reason))
            if k in of_kept
            else FrameRecovery(
                time=time,
                batch=None,
                index=0,
                reason=f"frames[{k}]: {REASON}",
                lost_to=LOST_TO,
                group_within=within,
            )
            for k, time in enumerate(self.time.tolist())
        ]
        settings = {**recovery.settings, "judged": [frame.judged for frame in frames]}
        return replace(recovery, frames=frames, settings=settings)

    def renumbered(self, text: str) -> str:
        """Give the frames that a text names the numbers that they have in the file."""
        return re.sub(r"\bframes\[(\d+)\]", lambda found: f"frames[{self.kept[int(found[1])]}]", text)

    @contextmanager
    def naming(self) -> Iterator[None]:
        """Renumber the frames that errors and warnings name."""
        try:
            with warnings.catch_warnings(record=True) as caught:
                warnings.simplefilter("always")
                yield
        except PosekitError as error:
            raise type(error)(self.renumbered(str(error))) from error
        finally:
            for one in caught:
                warnings.warn_explicit(
                    self.renumbered(str(one.message)), one.category, one.filename, one.lineno
                )


def open_seen(path: Path, opened: Callable[[Path], Opened]) -> tuple[Opened, LeftOut | None]:
    """Open a view file by its frames that show the neck; whatever else it is, as it is.

    Parameters
    ----------
    path : Path
    opened : callable
        Opens a file. It is given another one, of the frames that show the neck, where some do not.

    Returns
    -------
    tuple
        What was opened, and what was left out; None where nothing was.

    Raises
    ------
    InputError
        Where the file is refused for another reason, or no frame shows the neck.
    """
    try:
        return opened(path), None
    except InputError as error:
        document = _of_calibrated_view(path)
        if document is None:
            raise
        frames = document["frames"]
        kept = [k for k, frame in enumerate(frames) if "neck" in frame["image"]]
        if not 0 < len(kept) < len(frames):
            raise
        # All that is wrong with a file is said before any frame of it is left out.
        whole = [{**frame, "image": {"neck": [0.0, 0.0], **frame["image"]}} for frame in frames]
        if isinstance(
            validated(ViewFile, {**document, "frames": whole}, path).camera, ScaledOrthographicCamera
        ):
            raise
        found = LeftOut(
            time=np.array([frame["time"] for frame in frames], dtype=np.float64), kept=np.array(kept)
        )
        with tempfile.TemporaryDirectory() as folder:
            seen = Path(folder) / path.name
            seen.write_text(json.dumps({**document, "frames": [frames[k] for k in kept]}), encoding="utf-8")
            try:
                return opened(seen), found
            except PosekitError as other:
                text = found.renumbered(str(other).replace(str(seen), str(path)))
                raise type(other)(text) from error


def _of_calibrated_view(path: Path) -> dict[str, Any] | None:
    """Return a document that is made like a view's; None where the file is something else."""
    if path.suffix.lower() != ".json" or not path.is_file():
        return None
    try:
        document = read_json(path)
    except PosekitError:
        return None
    if not isinstance(document, dict) or document.get("schema") != SCHEMA:
        return None
    frames = document.get("frames")
    made = isinstance(frames, list) and all(
        isinstance(frame, dict) and isinstance(frame.get("image"), dict) for frame in frames
    )
    return document if made else None
