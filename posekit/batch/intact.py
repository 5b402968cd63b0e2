"""Whether a shard is what was written: by its digest in the manifest, or else by the checksums of its pages."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Final

from posekit.batch import digests
from posekit.errors import InputError
from posekit.formats.motion.parquet import opened
from posekit.safe_io import read_json, refusal

MANIFEST_FILE: Final = "manifest.json"
"""The file of a run's folder that says how far the run is, and the SHA-256 of each shard."""


def known_digests(folder: Path) -> Mapping[str, str]:
    """Return the SHA-256 of a run's shards by name, as its manifest has them; empty where it has none.

    Raises
    ------
    InputError
        Where the manifest is damaged.
    """
    path = folder / MANIFEST_FILE
    if not path.is_file():
        return {}
    document = read_json(path)
    known = document.get("digests", {}) if isinstance(document, dict) else None
    if not isinstance(known, dict) or not all(isinstance(one, str) for one in known.values()):
        raise refusal(
            path, "digests", "a damaged note", "a SHA-256 for each shard", "run posekit batch again"
        )
    return known


def check_shard(path: Path, known: Mapping[str, str]) -> None:
    """Refuse a shard that is not as it was written.

    Where no digest is known, since the run ended before it was noted, every page is read and compared with its own
    checksum (Apache Parquet format, "Checksumming").

    Raises
    ------
    InputError
        Where it is damaged.
    """
    if path.name in known:
        if digests.of_file(path) != known[path.name]:
            raise refusal(
                path,
                "",
                "a damaged shard: not what was written",
                "what posekit batch wrote",
                "run posekit batch again",
            )
        return
    with opened(path) as file:
        for group in range(file.metadata.num_row_groups):
            file.read_row_group(group, use_threads=False)


def is_intact(path: Path, known: Mapping[str, str]) -> bool:
    """Tell whether a shard is as it was written."""
    try:
        check_shard(path, known)
    except InputError:
        return False
    return True
