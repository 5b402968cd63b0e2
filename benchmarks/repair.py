"""Faults that are planted in BVH files and repaired: number of files that pass, and unchanged contents of the files.

    python -m benchmarks.repair [--data DIR] [--clips 10] [--only KIND,KIND] [--seed 0]

Faults are written into the text of the files, in a span of frames, without posekit's representation of motion. The
clips pass without a fault; the cases are clips that fail with the fault. Kept: the hierarchy with all names and
channels, the number of frames, and the lines of frames outside of the span. A slide displaces all frames after it, so
that at best the larger side of the span is kept. Without ``--data`` the sample walk is used.
"""

from __future__ import annotations

import re
import tempfile
import time
import warnings
from collections import Counter, defaultdict
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np

import posekit
from benchmarks.common import data_of, files_below, parser, sampled, table
from posekit.errors import PosekitError
from posekit.formats.bvh import UNITS
from posekit.geometry import Array

MARGIN, LEAST_FRAMES = 8, 60


@dataclass
class Clip:
    """The text of a BVH file: everything before the frames, and the frames (T, C) with their columns."""

    head: str
    values: Array
    columns: dict[str, list[tuple[str, int]]]
    metre: float
    up: Array
    rate: float
    name: str

    @property
    def root(self) -> list[int]:
        """Columns of the first joint's position, in the order x, y, z."""
        first = next(iter(self.columns.values()))
        return [k for axis in "XYZ" for name, k in first if name == f"{axis}position"]

    def rotations(self, *parts: str) -> list[list[int]]:
        """Return the rotation columns of the joints whose names contain one of the parts."""
        found = [own for name, own in self.columns.items() if any(part in name.lower() for part in parts)]
        return [[k for kind, k in own if kind.endswith("rotation")] for own in found]

    def text(self, values: Array) -> str:
        """Return the file's text; unchanged frames have their original lines."""
        own = self.head.rstrip("\n").split("\n")
        lines = [" ".join(f"{one:.6f}" for one in row) for row in values]
        return "\n".join([*own, *lines, ""])


def read(path: Path) -> Clip | None:
    """Read a file with posekit's unit and up axis; None if it does not pass or is too short."""
    motion = posekit.open(path)
    source = path.read_text(encoding="utf-8", errors="replace")
    match = re.search(r"Frame Time\s*:\s*\S+[^\n]*\n", source)
    if match is None or not isinstance(motion, posekit.Motion) or motion.up_vector is None:
        return None
    columns: dict[str, list[tuple[str, int]]] = {}
    count = 0
    for name, given in re.findall(
        r"(?:ROOT|JOINT)\s+([^\n]+?)\s*\n.*?CHANNELS\s+\d+([^\n]*)", source, re.DOTALL
    ):
        columns[name] = [(kind, count + k) for k, kind in enumerate(given.split())]
        count += len(given.split())
    values = np.array(
        [line.split() for line in source[match.end() :].splitlines() if line.strip()], dtype=float
    )
    if len(values) < LEAST_FRAMES or values.shape[1] != count or not posekit.validate(motion).ok.all():
        return None
    return Clip(
        source[: match.end()],
        values,
        columns,
        1.0 / UNITS.get(motion.unit, 1.0),
        motion.up_vector,
        motion.rate or 30.0,
        path.name,
    )


def lifted(size: float) -> Callable[..., Array]:
    def plant(clip: Clip, values: Array, span: slice, rng: np.random.Generator) -> Array:
        values[span][:, clip.root] += size * clip.metre * clip.up
        return values

    return plant


def slide(clip: Clip, values: Array, span: slice, rng: np.random.Generator) -> Array:
    way = rng.normal(size=3)
    way -= (way @ clip.up) * clip.up
    far = np.zeros(len(values))
    far[span] = 0.1 / clip.rate
    values[:, clip.root] += np.cumsum(far)[:, None] * clip.metre * way / np.linalg.norm(way)
    return values


def jump(clip: Clip, values: Array, span: slice, rng: np.random.Generator) -> Array:
    way = rng.normal(size=3)
    values[span.start, clip.root] += 0.2 * clip.metre * way / np.linalg.norm(way)
    return values


def frozen(clip: Clip, values: Array, span: slice, rng: np.random.Generator) -> Array:
    values[span] = values[span.start - 1]
    return values


def shuffled(clip: Clip, values: Array, span: slice, rng: np.random.Generator) -> Array:
    values[span] = rng.permutation(values[span])
    return values


def trembling(clip: Clip, values: Array, span: slice, rng: np.random.Generator) -> Array:
    turning = sorted(k for own in clip.rotations("") for k in own)
    values[span, turning] += rng.normal(0, 2.0, (span.stop - span.start, len(turning)))
    return values


def swapped(clip: Clip, values: Array, span: slice, rng: np.random.Generator) -> Array:
    """Exchange the channels of left and right joints, and mirror them as far as Euler angles allow."""
    moved = values.copy()
    for name, own in clip.columns.items():
        other = re.sub(
            "left|right",
            lambda at: {"left": "right", "right": "left"}[at[0].lower()].title(),
            name,
            flags=re.I,
        )
        if other != name and other in clip.columns:
            for (_, here), (_, there) in zip(own, clip.columns[other], strict=True):
                moved[span, here] = values[span, there]
    return moved


def bent(*parts: str) -> Callable[..., Array]:
    def plant(clip: Clip, values: Array, span: slice, rng: np.random.Generator) -> Array:
        joints = clip.rotations(*parts)
        if joints:
            one = joints[int(rng.integers(len(joints)))]
            values[span, one[int(rng.integers(len(one)))]] += rng.choice((-1, 1)) * rng.uniform(60, 120)
        return values

    return plant


#: Kinds of faults by name, with the number of frames of their spans.
KINDS: dict[str, tuple[Callable[..., Array], int]] = {
    "floating 10 cm": (lifted(0.1), 30),
    "sinking 10 cm": (lifted(-0.1), 30),
    "slide 10 cm/s": (slide, 45),
    "jump": (jump, 1),
    "frozen": (frozen, 29),
    "shuffled": (shuffled, 20),
    "trembling": (trembling, 25),
    "swapped sides": (swapped, 20),
    "elbow": (bent("forearm", "lowerarm", "elbow"), 20),
    "knee": (bent("leg_", "shin", "lowerleg", "knee", "leg"), 20),
}


def kept(clip: Clip, before: str, after: str, span: slice) -> tuple[bool, float]:
    """Return whether hierarchy and number of frames are unchanged, and the share of unchanged outside lines."""
    old, new = before.splitlines(), after.splitlines()
    start = len(clip.head.splitlines())
    same = old[:start] == new[:start] and len([one for one in new if one.strip()]) == len(old)
    outside = [k for k in range(len(clip.values)) if not span.start <= k < span.stop]
    lines = [old[start + k] == new[start + k] for k in outside if start + k < len(new)]
    return same, float(np.mean(lines)) if lines else 0.0


def main() -> None:
    made = parser(__doc__)
    made.add_argument("--clips", type=int, default=10)
    made.add_argument("--only", default="")
    made.add_argument("--keep", type=Path, help="folder for the cases that do not pass")
    given = made.parse_args()
    warnings.simplefilter("ignore", UserWarning)
    rng = np.random.default_rng(given.seed)
    results: dict[str, list[tuple[bool, bool, float, float]]] = defaultdict(list)
    with sampled() as samples, tempfile.TemporaryDirectory() as spare:
        posekit.convert(samples / "walk.npz", samples / "walk.bvh")
        paths = [one for one in files_below(data_of(given)) if one.suffix == ".bvh"] or [samples / "walk.bvh"]
        clips: list[Clip] = []
        for path in paths:
            clip = read(path) if len(clips) < given.clips else None
            clips += [clip] if clip is not None else []
        left: Counter[str] = Counter()
        for name in given.only.split(",") if given.only else KINDS:
            plant, length = KINDS[name]
            for clip in clips:
                length = max(1, round(length * clip.rate / 30)) if length > 1 else 1
                length = min(length, len(clip.values) - 2 * MARGIN)
                first = int(rng.integers(MARGIN, len(clip.values) - MARGIN - length + 1))
                span = slice(first, first + length)
                file, target = Path(spare) / clip.name, Path(spare) / f"repaired.{clip.name}"
                broken = clip.text(plant(clip, clip.values.copy(), span, rng))
                file.write_text(broken)
                if posekit.validate(file).ok.all():
                    continue
                start = time.process_time()
                try:
                    done = posekit.repair(file, target)
                except PosekitError as error:
                    print(f"refused: {name}, {clip.name}: {error}")
                    results[name].append((False, False, 0.0, 0.0))
                    continue
                seconds = time.process_time() - start
                report = posekit.validate(target)
                passes = bool(report.ok.all())
                results[name].append((passes, *kept(clip, broken, target.read_text(), span), seconds))
                if not passes:
                    left.update(check for check, one in report.by_check().items() if one["frames"])
                    print(
                        f"does not pass: {name} from {span.start}, {clip.name}: {report.decision}; {done.notes}"
                    )
                    if given.keep:
                        given.keep.mkdir(parents=True, exist_ok=True)
                        (given.keep / f"{name.replace('/', ' ')}.{clip.name}").write_text(broken)
                target.unlink()
    rows = [
        (
            name,
            len(each),
            sum(one[0] for one in each),
            sum(one[1] for one in each),
            f"{np.mean([one[2] for one in each]):.0%}",
            f"{np.mean([one[3] for one in each]):.2f}",
        )
        for name, each in results.items()
    ]
    print(
        f"{len(clips)} clips; {sum(row[2] for row in rows)} of {sum(row[1] for row in rows)} pass; left {dict(left)}"
    )
    print(table(("fault", "cases", "pass", "hierarchy kept", "outside lines kept", "s"), rows))


if __name__ == "__main__":
    main()
