"""How many of the 2048 flips survive each check, and whether the truth and its mirror image do."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from posekit.formats.markdown import table_lines
from posekit.papers.taylor_views import StudyPictures
from posekit.recovery.taylor_figure.completion import taylor_checks
from posekit.recovery.taylor_figure.human import Human
from posekit.settings import MEASURED_TOLERANCE, Tolerance
from posekit.tree import Leaves
from posekit.validators import Ranges, load_ranges

AT_ONCE = 50
"""Pictures whose 2048 leaves are held at once."""

RANGE_NAMES = ("urdf", "table1")

Keys = NDArray[np.int64]


@dataclass(frozen=True, kw_only=True, eq=False)
class Survival:
    """What some checks leave of the flips of F pictures.

    Parameters
    ----------
    checks : str
        What was asked.
    count : int array (F,)
        Survivors of each picture.
    truth, mirror : bool array (F,)
        Whether the true flips are among them, and whether all of them reversed are: the same image in the mirror.
    """

    checks: str
    count: NDArray[np.int64]
    truth: NDArray[np.bool_]
    mirror: NDArray[np.bool_]

    def __post_init__(self) -> None:
        for name in ("count", "truth", "mirror"):
            values = np.array(getattr(self, name))
            values.flags.writeable = False
            object.__setattr__(self, name, values)

    @property
    def pair(self) -> NDArray[np.bool_]:
        """Whether the true flips and their mirror image both survive: the checks do not tell them apart (F,)."""
        return self.truth & self.mirror

    def row(self) -> list[str]:
        """Write the checks, mean, median and 95 % of the survivors, and the shares of truth, mirror and both."""
        median, high = np.percentile(self.count, [50, 95])
        return [
            self.checks,
            f"{self.count.mean():.1f}",
            f"{median:g}",
            f"{high:.0f}",
            f"{self.truth.mean():.1%}",
            f"{self.mirror.mean():.1%}",
            f"{self.pair.mean():.1%}",
            f"{(self.count == 0).mean():.1%}",
        ]


TABLE_HEAD = (
    "checks",
    "survivors, mean",
    "median",
    "95 %",
    "truth among them",
    "its mirror image among them",
    "both",
    "no survivor",
)


def survival_lines(table: Sequence[Survival]) -> list[str]:
    """Lay the table out in Markdown."""
    return table_lines(TABLE_HEAD, [one.row() for one in table])


def survival(
    human: Human,
    seen: Iterable[StudyPictures],
    *,
    tolerance: Tolerance = MEASURED_TOLERANCE,
    ranges: Sequence[str] = RANGE_NAMES,
) -> list[Survival]:
    """Count what each check leaves alone, and what all leave together.

    Parameters
    ----------
    human : Human
        Taylor's human: its points and segments.
    seen : iterable of StudyPictures
        All pictures count alike.
    tolerance : Tolerance
        What the checks allow.
    ranges : sequence of str
        Names of joint-range tables, each a row alone and a row with all other checks.

    Returns
    -------
    list of Survival
        None of the checks first: the flips themselves.
    """
    tables = {name: load_ranges(name) for name in ranges}
    alone = ("rigid parts", *(f"joint range, {name}" for name in ranges), "collision")
    rows: dict[str, list[tuple[Keys, Keys, Keys]]] = {}
    for pictures in seen:
        for part in pictures.parts(AT_ONCE):
            leaves = human.grow(part.image, part.lengths, part.scale)
            rows_of = np.arange(len(part))
            truth, mirror = (
                _keys(rows_of, human.code(leaves, part.truth, mirrored=m)) for m in (False, True)
            )
            living = _living(human, leaves, part, tables, tolerance)
            for name in ("none", *alone):
                rows.setdefault(name, []).append((living[name], truth, mirror))
            for name in ranges:
                together = living["rigid parts"]
                for other in (f"joint range, {name}", "collision"):
                    together = np.intersect1d(together, living[other], assume_unique=True)
                rows.setdefault(f"all, {name}", []).append((together, truth, mirror))
    return [_count(name, parts) for name, parts in rows.items()]


def _living(
    human: Human, leaves: Leaves, part: StudyPictures, tables: Mapping[str, Ranges], tolerance: Tolerance
) -> dict[str, Keys]:
    """Return the keys of what each check leaves alone of the same leaves."""
    living = {"none": _keys(leaves.frame, leaves.code)}
    wanted: dict[str, tuple[str, Ranges]] = {"rigid parts": ("rigid-parts", next(iter(tables.values())))}
    wanted |= {f"joint range, {name}": ("joint-range", table) for name, table in tables.items()}
    wanted["collision"] = ("collision", next(iter(tables.values())))
    for label, (name, table) in wanted.items():
        checks = taylor_checks(part.figure, human.points, (name,), ranges=table, tolerance=tolerance)
        kept = human.spanned.tree.prune(leaves, checks)
        living[label] = _keys(kept.frame, kept.code)
    return living


def _count(name: str, parts: Sequence[tuple[Keys, Keys, Keys]]) -> Survival:
    count = [np.bincount(keys >> 32, minlength=len(truth)) for keys, truth, _ in parts]
    return Survival(
        checks=name,
        count=np.concatenate(count),
        truth=np.concatenate([np.isin(truth, keys) for keys, truth, _ in parts]),
        mirror=np.concatenate([np.isin(mirror, keys) for keys, _, mirror in parts]),
    )


def _keys(frame: NDArray[np.integer], code: NDArray[np.int32]) -> Keys:
    """Return one number for each node of many trees."""
    return frame.astype(np.int64) << 32 | code
