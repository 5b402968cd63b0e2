"""What a file says it is: a result, postures or a view."""

from __future__ import annotations

from pathlib import Path


def schema_of(path: Path) -> str:
    """Return the name of a file's schema, or an empty text: what is none is left to the readers' own errors."""
    from posekit import files
    from posekit.files.npz import open_npz
    from posekit.files.result_npz import MAX_PADDED

    if path.suffix.lower() == ".npz":
        with open_npz(path, limit=MAX_PADDED) as archive:
            return str(archive.array("schema", "U", ())) if "schema" in archive.names else ""
    document = files.read_json(path)
    return str(document.get("schema", "")) if isinstance(document, dict) else ""
