"""One shard: some frames of one person in one input, recovered into one Parquet file."""

from __future__ import annotations

import json
import re
import warnings
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Final

import numpy as np

from posekit.batch import digests
from posekit.batch.columns import (
    N_LEAVES,
    TEXT_COLUMNS,
    ShardFrames,
    frames_of,
    schema_of,
    table_of,
    unrecovered,
)
from posekit.batch.durable import PARTS_FOLDER, whole, writing
from posekit.batch.image_rows import ImageRows, read_head
from posekit.batch.intact import is_intact
from posekit.batch.recipe import Recipe
from posekit.batch.staging import Staged, StagedTable, stem_of
from posekit.batch.view_table import read_rows
from posekit.errors import PosekitError
from posekit.formats.own import View
from posekit.recovery.conductor import recover
from posekit.safe_io import extra
from posekit.skeleton import JOINTS

SHARDS_FOLDER: Final = "shards"
"""The folder of a run that holds the results."""
FRAMES_AT_ONCE: Final = 500
"""Frames that are recovered together where all joints are seen: what compiled loops take in one go."""
SHARD_SCHEMA: Final = "posekit.batch_shard/1"
METADATA_KEY: Final = b"posekit.batch"
NOISY_WEIGHT: Final = 3
"""Frames without noise that take the memory of one with noise, about."""
FREE_HIDDEN_JOINTS, HIDDEN_JOINT_FACTOR = 2, 4
"""Joints that may be hidden at no cost, and by what each further one multiplies the memory that a frame takes."""
MAX_WARNINGS: Final = 5
"""Warnings that are kept of one shard."""


@dataclass(frozen=True, kw_only=True)
class Shard:
    """Frames that are recovered together.

    Parameters
    ----------
    input : str
        The input's name.
    digest : str
        SHA-256 of its content.
    table : StagedTable
        The rows of image points that it is cut from.
    start, stop : int
        Rows of the table: from `start` to before `stop`.
    settings : str
        Hash of the recipe.
    recipe : Recipe
        What is asked of every frame.
    folder : Path
        Of the run.
    """

    input: str
    digest: str
    table: StagedTable
    start: int
    stop: int
    settings: str
    recipe: Recipe
    folder: Path

    def __len__(self) -> int:
        """Count the frames."""
        return self.stop - self.start

    @property
    def name(self) -> str:
        """The file's name: the same settings and content always give the same."""
        key = digests.of_values(self.settings, self.input, self.digest)
        return f"{stem_of(self.input)}.p{self.table.person}.{self.start:010d}-{self.stop:010d}.{key}.parquet"

    @property
    def path(self) -> Path:
        """The file."""
        return self.folder / SHARDS_FOLDER / self.name

    @property
    def says(self) -> dict[str, Any]:
        """What the file says of itself."""
        return {
            "schema": SHARD_SCHEMA,
            "input": self.input,
            "content": self.digest,
            "person": self.table.person,
            "rows": [self.start, self.stop],
            "settings": self.settings,
        }


@dataclass(frozen=True, kw_only=True)
class Finished:
    """A shard whose file is there.

    Parameters
    ----------
    frames, survivors, empty : int
        Frames, survivors, and frames without any.
    warnings : tuple of str
        What was warned of, each once.
    name, digest : str
        The file's name, and the SHA-256 of its content.
    """

    frames: int
    survivors: int
    empty: int
    warnings: tuple[str, ...] = ()
    name: str = ""
    digest: str = ""


def shards_of(staged: Staged, recipe: Recipe, settings: str, folder: Path) -> Iterator[Shard]:
    """Cut an input into shards, in order."""
    for table in staged.tables:
        for start in range(0, table.frames, recipe.shard_frames):
            yield Shard(
                input=staged.name,
                digest=staged.digest,
                table=table,
                start=start,
                stop=min(start + recipe.shard_frames, table.frames),
                settings=settings,
                recipe=recipe,
                folder=folder,
            )


def run_shard(shard: Shard) -> Finished:
    """Recover a shard's frames and write its file: whole, or not at all.

    Memory does not grow with the shard: frames are recovered in pieces (`portions`).

    Raises
    ------
    PosekitError
        Where its frames cannot be read, or options do not fit them.
    OutputError
        Where the file cannot be written.
    """
    pq = extra("pyarrow.parquet", "parquet", "writing Parquet")
    shard.recipe.check_versions()
    head = read_head(shard.table.head)
    schema = schema_of(shard.recipe)
    frames = survivors = empty = 0
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        with whole(shard.path, shard.folder / PARTS_FOLDER) as file:
            with writing(shard.path):
                writer = pq.ParquetWriter(
                    file,
                    schema,
                    compression="zstd",
                    use_dictionary=list(TEXT_COLUMNS),
                    write_page_checksum=True,
                )
            try:
                for piece in _pieces(shard, head):
                    table = table_of(piece, shard.input, shard.table.person, schema)
                    with writing(shard.path):
                        # A row group a piece: what reads the shard later need not hold more of it than this.
                        writer.write_table(table, row_group_size=max(table.num_rows, 1))
                    frames += len(piece.frame)
                    survivors += int(piece.count.sum())
                    empty += int((piece.count == 0).sum())
                totals = {"frames": frames, "survivors": survivors, "empty": empty}
                writer.add_key_value_metadata({METADATA_KEY: json.dumps({**shard.says, **totals}).encode()})
            finally:
                with writing(shard.path):
                    writer.close()
    says = [str(one.message) for one in caught if issubclass(one.category, UserWarning)]
    return Finished(
        frames=frames,
        survivors=survivors,
        empty=empty,
        warnings=tuple(dict.fromkeys(says))[:MAX_WARNINGS],
        name=shard.name,
        digest=digests.of_file(shard.path),
    )


def finished(shard: Shard, known: Mapping[str, str]) -> Finished | None:
    """Return what a shard's file holds; None where it is not there, damaged, or not what it should be.

    Parameters
    ----------
    shard : Shard
        The frames.
    known : mapping of str to str
        The SHA-256 of shards that the run has noted (`posekit.batch.intact.known_digests`).
    """
    if not shard.path.is_file() or not is_intact(shard.path, known):
        return None
    pq = extra("pyarrow.parquet", "parquet", "reading Parquet")
    pa = extra("pyarrow", "parquet", "reading Parquet")
    try:
        said = json.loads((pq.read_metadata(shard.path).metadata or {}).get(METADATA_KEY, b"{}"))
    except (pa.ArrowException, OSError, ValueError):
        return None
    if said.get("frames") != len(shard) or any(said.get(name) != value for name, value in shard.says.items()):
        return None
    return Finished(
        frames=said["frames"],
        survivors=said["survivors"],
        empty=said["empty"],
        name=shard.name,
        digest=known.get(shard.name) or digests.of_file(shard.path),
    )


def _pieces(shard: Shard, head: View) -> Iterator[ShardFrames]:
    """Recover the frames of a shard piece by piece."""
    noisy = bool(head.derived or head.deviation or shard.recipe.source.deviation)
    for rows in read_rows(Path(shard.table.path), shard.start, shard.stop):
        for piece in portions(rows, noisy=noisy):
            part = rows.part(piece)
            usable = np.flatnonzero(part.usable(head))
            lacking = part.lacking(head)
            found = replace(
                unrecovered(part, ""),
                reason=tuple(reason for reason, _ in lacking),
                rejected=tuple(json.dumps({lost_to: N_LEAVES}) for _, lost_to in lacking),
            )
            yield (
                found.with_part(usable, _recovered(part.part(usable), head, shard)) if len(usable) else found
            )


def portions(rows: ImageRows, *, noisy: bool) -> Iterator[slice]:
    """Divide frames into pieces that one process has the memory for.

    What a frame takes is measured (docs, "Batches"): some hundred kilobytes where all is seen, a few times that where
    noise is allowed for, and up to hundreds of megabytes where half of the body is hidden.
    """
    unseen = np.isnan(rows.points[:, : len(JOINTS), 0]).sum(axis=1)
    unseen[unseen == len(JOINTS)] = 0  # nothing is grown there
    weight = (NOISY_WEIGHT if noisy else 1) * HIDDEN_JOINT_FACTOR ** np.clip(
        unseen - FREE_HIDDEN_JOINTS, 0, 8
    ).astype(np.float64)
    start, taken = 0, 0.0
    for k, each in enumerate(weight.tolist()):
        if k > start and taken + each > FRAMES_AT_ONCE:
            yield slice(start, k)
            start, taken = k, 0.0
        taken += each
    yield slice(start, len(rows))


def _recovered(rows: ImageRows, head: View, shard: Shard) -> ShardFrames:
    """Recover frames; where none of several can be, each by itself, so that each has its own reason."""
    try:
        with _numbered(rows):
            return frames_of(rows, recover(rows.view(head), shard.recipe.settings), shard.recipe)
    except PosekitError as error:
        if len(rows) == 1:
            return unrecovered(rows, re.sub(r"^frames\[0\]: ", "", str(error)))
    # One frame that cannot be recovered is found in as many steps as halves can be halved.
    half = len(rows) // 2
    return _recovered(rows.part(slice(0, half)), head, shard).followed_by(
        _recovered(rows.part(slice(half, None)), head, shard)
    )


@contextmanager
def _numbered(rows: ImageRows) -> Iterator[None]:
    """Let warnings name frames by their numbers in the recording, not in these rows."""
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        yield
    for one in caught:
        text = re.sub(
            r"\bframes\[(\d+)\]", lambda found: f"frames[{rows.frame[int(found[1])]}]", str(one.message)
        )
        warnings.warn(text, one.category, stacklevel=3)
