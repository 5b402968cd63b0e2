"""What a file says it is: a result, postures or a view."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from posekit.errors import InputError

if TYPE_CHECKING:
    from posekit.formats.own import Postures, Result, View


def schema_of(path: Path) -> str:
    """Return the name of a file's schema, or an empty text: what is none is left to the readers' own errors."""
    from posekit.formats import own as files
    from posekit.formats.own.npz import open_npz
    from posekit.formats.own.result_npz import MAX_PADDED

    if path.suffix.lower() == ".npz":
        with open_npz(path, limit=MAX_PADDED) as archive:
            return str(archive.array("schema", "U", ())) if "schema" in archive.names else ""
    document = files.read_json(path)
    return str(document.get("schema", "")) if isinstance(document, dict) else ""


def read_given(
    path: Path, seen: Path | None, *, explain: bool = False
) -> tuple[Result | Postures, View | None]:
    """Read a file of any of the three schemas, and the view behind a result; a view is recovered first."""
    from posekit.formats import own as files
    from posekit.recovery import recover, result_of

    name = schema_of(path)
    behind = files.read_view(seen) if seen is not None else None
    if name.startswith("posekit.view/"):
        if behind is not None:
            raise InputError(
                "--view: the file is a view itself; expected a result beside it; leave the option out"
            )
        behind = files.read_view(path)
        recovery = recover(behind, group=0.05)
        return result_of(recovery, unit=behind.unit, explain=explain), behind
    if name.startswith("posekit.result/"):
        return files.read_result(path), behind
    if behind is not None:
        raise InputError("--view: the file holds no result; expected one, recovered from that view")
    return files.read_postures(path), None
