"""Read what a batch left: its shards in order, its frames, its survivors."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any, Final

import numpy as np

from posekit.batch.intact import check_shard, known_digests
from posekit.batch.shard import SHARDS_FOLDER
from posekit.formats.motion.parquet import opened
from posekit.safe_io import extra, refusal

FRAME_COLUMNS: Final = (
    "input",
    "person",
    "frame",
    "time",
    "survivors",
    "judged",
    "reason",
    "inferred",
    "rejected",
)
"""What is said of a frame, in each row of its survivors."""


def shard_paths(folder: str | Path) -> list[Path]:
    """List a run's files in order: by input, person and frame.

    Raises
    ------
    InputError
        Where the folder is none of a run.
    """
    shards = Path(folder) / SHARDS_FOLDER
    if not shards.is_dir():
        raise refusal(
            folder, "", f"no folder {SHARDS_FOLDER} in it", "the output of posekit batch", "check the name"
        )
    return sorted(shards.glob("*.parquet"))


def read_shards(folder: str | Path, columns: Sequence[str] | None = None) -> Iterator[Any]:
    """Yield the rows of a run, a piece of a shard at a time, as pyarrow tables.

    Raises
    ------
    InputError
        Where the folder is none of a run, or a file is damaged.
    """
    known = known_digests(Path(folder))
    for path in shard_paths(folder):
        check_shard(path, known)
        with opened(path) as file:
            for group in range(file.metadata.num_row_groups):
                wanted = None if columns is None else list(columns)
                yield file.read_row_group(group, columns=wanted, use_threads=False)


def read_frames(folder: str | Path) -> Iterator[Any]:
    """Yield the frames of a run, each once, as pyarrow tables of `FRAME_COLUMNS`.

    Raises
    ------
    InputError
        Where the folder is none of a run, or a file is damaged.
    """
    pa = extra("pyarrow", "parquet", "reading Parquet")
    for table in read_shards(folder, [*FRAME_COLUMNS, "survivor"]):
        first = np.asarray(table.column("survivor").to_numpy()) <= 0
        yield table.filter(pa.array(first)).select(list(FRAME_COLUMNS))
