"""Named tables of joint ranges, read from TOML."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from posekit.errors import InputError
from posekit.geometry import perpendicular, unit
from posekit.safe_io import cut, one_line, perhaps, read_toml
from posekit.skeleton import HIPS, JOINT
from posekit.tables.built_in import built_in_document

if TYPE_CHECKING:
    from posekit.body import Figure
    from posekit.validators.anatomical import Anatomy

RANGES_SCHEMA = "posekit.ranges/1"
MAX_BYTES = 1_000_000

Range = tuple[float, float]


@dataclass(frozen=True, kw_only=True)
class Ranges:
    """Joint ranges in degrees.

    Parameters
    ----------
    name : str
        What results call them.
    kind : {"configuration", "rotation", "projected"}
        Ranges of the URDF's own angles, or of those of Lee & Chen 1985, §3.2.A: as rotations from standing
        (`posekit.validators.rotation_angles`), or as printed (`posekit.validators.projected_angles`).
    limits : mapping
        ``"shoulder.flexion"`` (the paper's; both sides) or ``"right_shoulder.flexion"`` (configuration; angles
        that are not listed keep the URDF's limits) to (lower, upper), degrees.
    shortest_projection : float
        Fraction of a segment below which its projection has no direction to measure (of kind projected).
    knee_flexed : float
        Degrees of knee flexion from which on the hip's wider range applies.
    anatomy : Anatomy, optional
        Ranges with a mean and a spread for each end, and couplings (of kind configuration): `limits` are its own.
    """

    name: str
    kind: Literal["configuration", "rotation", "projected"]
    limits: Mapping[str, Range] = field(default_factory=dict)
    shortest_projection: float = 0.1
    knee_flexed: float = 5.0
    anatomy: Anatomy | None = None

    def __hash__(self) -> int:
        return hash((self.name, self.kind, frozenset(self.limits.items())))

    def with_hips(self, forward: float, outward: float) -> Ranges:
        """Return the ranges of somebody whose hips are so many degrees forward and outward (`Anatomy.with_hips`)."""
        if self.anatomy is None:
            return self
        anatomy = self.anatomy.with_hips(forward, outward)
        return replace(self, limits=anatomy.limits(), anatomy=anatomy)

    def of(self, figure: Figure) -> Ranges:
        """Return the ranges of a figure: anatomical ones depend on where its pelvis is (`Anatomy.on_pelvis`)."""
        if self.anatomy is None:
            return self
        pelvis, *hips = figure.neutral_points[[JOINT[name] for name in HIPS]]
        above_hips = float(np.linalg.norm(perpendicular(hips[0] - pelvis, unit(hips[1] - hips[0]))))
        anatomy = self.anatomy.on_pelvis(above_hips)
        return replace(self, limits=anatomy.limits(), anatomy=anatomy)


URDF_RANGES = Ranges(name="urdf", kind="configuration")

NAMED_TABLES = ("table1", "table1-printed", "anatomical")
"""Tables that come with the package."""


def load_ranges(name: str) -> Ranges:
    """Load ranges by name (`urdf`, `table1`, `table1-printed`, `anatomical`) or from a TOML file.

    Raises
    ------
    InputError
        Where there is no such table or it is not what `posekit.ranges/1` says.
    """
    if name == "urdf":
        return URDF_RANGES
    if name in NAMED_TABLES:
        return _named(name)
    try:
        exists = Path(name).exists()
    except (OSError, ValueError):
        exists = False
    if not name or not exists:
        raise InputError(
            one_line(
                f"--ranges {cut(name)}: no such table or file; expected urdf, {', '.join(NAMED_TABLES)} or the path "
                f"of a TOML file{perhaps(name, NAMED_TABLES)}"
            )
        )
    return _ranges(read_toml(name, limit=MAX_BYTES), name)


@cache
def _named(name: str) -> Ranges:
    if name == "table1-printed":
        return replace(_named("table1"), name=name, kind="projected")
    return _ranges(built_in_document("ranges", name), name)


def _ranges(document: dict[str, Any], source: str) -> Ranges:
    from posekit.tables.anatomy import AnatomyTable
    from posekit.tables.file_model import validated
    from posekit.tables.ranges import RangesTable

    if document.get("kind") == "anatomical":
        from posekit.validators.anatomical_table import anatomy_of

        anatomy = anatomy_of(validated(AnatomyTable, document, source))
        return Ranges(name=source, kind="configuration", limits=anatomy.limits(), anatomy=anatomy)
    table = validated(RangesTable, document, source)
    return Ranges(
        name=source,
        kind=table.kind,
        limits={angle: (lower, upper) for angle, (lower, upper) in table.joints.items()},
        shortest_projection=table.shortest_projection,
        knee_flexed=table.knee_flexed,
    )
