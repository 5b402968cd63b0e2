"""What is in the folder of a batch, and in one of its shards."""

from __future__ import annotations

import json
from collections import Counter
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from posekit.batch.intact import MANIFEST_FILE, check_shard, known_digests
from posekit.batch.reading import FRAME_COLUMNS, shard_paths
from posekit.batch.run_folder import ASKED_FILE, MANIFEST_SCHEMA, RunFolder
from posekit.batch.shard import METADATA_KEY, SHARDS_FOLDER
from posekit.display.plural import plural
from posekit.errors import InputError
from posekit.formats.given_file import first_bytes
from posekit.formats.motion.parquet import opened
from posekit.inspection.telling import cut_long, histogram_line, judged_line, reason_lines
from posekit.safe_io import cut, extra, read_json, refusal

MAX_FAILURES_NAMED: Final = 3
"""Failures that are named."""
MAX_SURVIVORS_BELIEVED: Final = 100_000_000
"""Survivors that a frame is believed to have."""


def run_of(path: Path) -> Path | None:
    """Return the folder of a run, where a path is one, or a part of one that says it; else None."""
    folder = path
    if path.name in (ASKED_FILE, MANIFEST_FILE, SHARDS_FOLDER) and not (path / ASKED_FILE).is_file():
        folder = path.absolute().parent
    return folder if folder.is_dir() and (folder / ASKED_FILE).is_file() else None


def run_lines(folder: Path) -> list[str]:
    """Describe a run: inputs, how many shards are done, survivors, failures, settings.

    Raises
    ------
    InputError
        Where a note or a shard is damaged.
    """
    asked = RunFolder(path=folder).asked()
    if asked is None:
        raise InputError(
            f"{folder}: got no {ASKED_FILE}; expected the output of posekit batch; check the name"
        )
    manifest = _manifest(folder / MANIFEST_FILE)
    shards = shard_paths(folder) if (folder / SHARDS_FOLDER).is_dir() else []
    found = Tally()
    known = known_digests(folder)
    for shard in shards:
        check_shard(shard, known)
        found.add(shard)
    failed = manifest.get("failed", [])
    planned = manifest.get("shards")
    done = (
        f"{len(shards):,} of {plural(planned, 'shard')}"
        if isinstance(planned, int)
        else plural(len(shards), "shard")
    )
    of = f" of {manifest['planned']:,}" if isinstance(manifest.get("planned"), int) else ""
    ended = "" if manifest else "; it has not come to its first note"
    lines = [
        f"{plural(len(asked.inputs), 'input')}; {done} done, {found.frames:,}{of} frames, "
        f"{plural(len(failed), 'failure')}{ended}",
        *found.lines(),
    ]
    for one in failed[:MAX_FAILURES_NAMED]:
        lines.append(
            f"failed: {cut_long(str(one.get('shard') or one.get('input')))}: {cut_long(str(one.get('error')))}"
        )
    if len(failed) > MAX_FAILURES_NAMED:
        lines.append(f"and {len(failed) - MAX_FAILURES_NAMED} more failures, in {folder / MANIFEST_FILE}")
    return [*lines, _settings(asked.hash, asked.settings)]


def is_shard(path: Path) -> bool:
    """Tell whether a file is one of a batch's results."""
    if path.suffix.lower() != ".parquet" or not path.is_file() or not first_bytes(path).startswith(b"PAR1"):
        return False
    with opened(path) as file:
        return METADATA_KEY in (file.schema_arrow.metadata or {}) or METADATA_KEY in (
            file.metadata.metadata or {}
        )


def shard_lines(path: Path) -> list[str]:
    """Describe a shard: whose frames, survivors, what they were judged as, which columns there are.

    Raises
    ------
    InputError
        Where it is damaged.
    """
    check_shard(path, known_digests(path.parent.parent))
    with opened(path) as file:
        names = set(file.schema_arrow.names)
        said = _said(path, (file.metadata.metadata or {}).get(METADATA_KEY, b""))
    found = Tally()
    found.add(path)
    rows = said.get("rows")
    first_last = (
        f", rows {rows[0]} to {rows[1] - 1}"
        if isinstance(rows, list) and len(rows) == 2 and all(isinstance(row, int) for row in rows)
        else ""
    )
    kinds = {
        "probabilities": "probability" in names,
        "configurations": "fk_distance" in names,
        "margins": any(name.startswith("margin.") for name in names),
    }
    has = [name for name, there in kinds.items() if there]
    return [
        f"{cut(str(said.get('input')))}, person {cut(str(said.get('person')))}{first_last}",
        *found.lines(),
        f"with {', '.join(has) or 'joints alone'}; settings {cut(str(said.get('settings')))}",
    ]


@dataclass(kw_only=True)
class Tally:
    """What frames of shards have: counted shard by shard, so that memory does not grow with them."""

    histogram: NDArray[np.int64] = field(default_factory=lambda: np.zeros(1, dtype=np.int64))
    judged: Counter[str] = field(default_factory=Counter)
    reasons: Counter[str] = field(default_factory=Counter)
    inferred: int = 0
    refined: int = 0

    @property
    def frames(self) -> int:
        """How many there are."""
        return int(self.histogram.sum())

    def add(self, path: Path) -> None:
        """Count a shard's frames.

        Raises
        ------
        InputError
            Where it is damaged, or no shard of a batch.
        """
        for rows in _frames(path):
            counts = np.asarray(rows.column("survivors").to_numpy(), dtype=np.float64)
            if not ((counts >= 0) & (counts < MAX_SURVIVORS_BELIEVED)).all():
                raise _damaged(path, "survivors")
            own = np.bincount(counts.astype(np.int64))
            grown = np.zeros(max(len(own), len(self.histogram)), dtype=np.int64)
            grown[: len(self.histogram)] += self.histogram
            grown[: len(own)] += own
            self.histogram = grown
            judged, reasons, inferred = (_words(rows, name) for name in ("judged", "reason", "inferred"))
            self.judged.update(judged)
            self.reasons.update(reasons)
            self.inferred += sum(count for word, count in inferred.items() if word)

    def lines(self) -> list[str]:
        """Describe them."""
        lines = [histogram_line(self.histogram)]
        lines += reason_lines({word: count for word, count in self.reasons.items() if word})
        judged = {word: count for word, count in self.judged.items() if word}
        if judged:
            lines.append(judged_line(Counter(judged).elements()))
        if self.inferred:
            lines.append(f"joints inferred in {plural(self.inferred, 'frame')}")
        return lines


def _frames(path: Path) -> Iterator[Any]:
    """Yield the frames of a shard, a row each, a piece at a time."""
    pa = extra("pyarrow", "parquet", "reading Parquet")
    wanted = ["survivors", "survivor", "judged", "reason", "inferred"]
    with opened(path) as file:
        if not {*wanted, *FRAME_COLUMNS} <= set(file.schema_arrow.names):
            raise _damaged(path, "columns")
        for group in range(file.metadata.num_row_groups):
            table = file.read_row_group(group, columns=wanted, use_threads=False)
            first = np.asarray(table.column("survivor").to_numpy()) <= 0
            yield table.filter(pa.array(first))


def _words(table: Any, name: str) -> Counter[str]:
    """Count the words of a column."""
    counted = table.column(name).combine_chunks().value_counts().to_pylist()
    return Counter({str(one["values"] or ""): int(one["counts"]) for one in counted})


def _manifest(path: Path) -> dict[str, Any]:
    """Read how far a run is; nothing where it has not noted it yet."""
    if not path.is_file():
        return {}
    document = read_json(path)
    failed = document.get("failed") if isinstance(document, dict) else None
    if (
        not isinstance(document, dict)
        or document.get("schema") != MANIFEST_SCHEMA
        or not isinstance(failed, list)
        or not all(isinstance(one, dict) for one in failed)
    ):
        raise refusal(path, "", "a damaged note", f'"{MANIFEST_SCHEMA}"', "run posekit batch again")
    return document


def _said(path: Path, text: bytes) -> dict[str, Any]:
    """Read what a shard says of itself."""
    try:
        said = json.loads(text)
    except ValueError:
        said = None
    if not isinstance(said, dict):
        raise _damaged(path, "posekit.batch")
    return said


def _damaged(path: Path, where: str) -> InputError:
    return refusal(path, where, "a damaged shard", "what posekit batch wrote", "run posekit batch again")


def _settings(hash: str, settings: Mapping[str, Any]) -> str:
    """Say by what a run judges, and its hash."""
    checks, ranges, made = (settings.get(name) for name in ("checks", "ranges", "made_with"))
    told = [f"settings {cut(hash)}"]
    if isinstance(checks, list):
        told.append(f"checks {', '.join(cut(str(check)) for check in checks[:8]) or 'none'}")
    if isinstance(ranges, list) and ranges:
        told.append(f"ranges {cut(str(ranges[0]))}")
    if isinstance(made, dict):
        told.append(f"posekit {cut(str(made.get('posekit')))}")
    return "; ".join(told)
