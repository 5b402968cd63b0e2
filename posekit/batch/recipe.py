"""Everything that decides what a batch gives, apart from its inputs."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass, field, replace
from functools import cached_property
from importlib.metadata import version
from pathlib import Path
from typing import Any, Final

from posekit.batch import digests
from posekit.body import load_figure
from posekit.errors import InputError
from posekit.formats.own import PER_METRE, ScaledOrthographicModel, View
from posekit.recovery.conductor import recover
from posekit.recovery.noise import refuse_deviation
from posekit.recovery.recovery import Recovery
from posekit.settings import EXACT_TOLERANCE, MEASURED_TOLERANCE, PHOTOGRAPH_TOLERANCE, Rooting, Tolerance
from posekit.settings.scale import parse_scale
from posekit.validators import PHYSICAL, Ranges, check_names, load_ranges
from posekit.validators.walking import DEFAULT_RULES, thresholds_of
from posekit.views.camera import split_camera
from posekit.views.source import Source

SHARD_FRAMES: Final = 2000
"""Frames of a shard: about a second's work, and a file of a megabyte."""

PACKAGES: Final = ("posekit", "pin", "coal", "numpy", "pyarrow")
"""Whose versions decide results, or the bytes that they are written in."""


def versions() -> dict[str, str]:
    """Return the versions of what computes and writes the results."""
    return {name: version(name) for name in PACKAGES}


@dataclass(frozen=True, kw_only=True)
class Recipe:
    """What is asked of every frame.

    Parameters
    ----------
    source : Source
        How key points are to be read: who, with which camera, with which lengths.
    checks : sequence of str
        As `posekit.recover` takes them.
    ranges : str
        ``urdf``, ``table1``, … or a TOML table.
    rules : sequence of int
    walkers : {"paper", "people"}
    rigid, tangent, angle : float, optional
        Tolerances: metres, metres, degrees. Those that are not given are as `posekit recover` has them.
    contact_margin : float
        Metres.
    scale : str
        How the scale of uncalibrated views is found, as `posekit.settings.scale.parse_scale` reads it; empty for the
        default.
    proportions : {"figure", "taylor"}
    infer : bool
        Whether joints that were not seen are completed.
    root : str
        How the neck of calibrated views is placed.
    refine : bool, optional
        Whether survivors become the likeliest postures near them; by default where the noise is known.
    length_deviation : float, optional
        Relative standard deviation of lengths, for that.
    rank : bool
        Whether the table has each survivor's probability among those of its frame.
    q, margins : bool
        Whether the table has each survivor's configuration, and its worst margin by check. Each costs more than the
        recovery itself.
    shard_frames : int
        Frames of one output file, at most.

    Raises
    ------
    InputError
        Where one of them is impossible.
    """

    source: Source = field(default_factory=Source)
    checks: Sequence[str] = PHYSICAL
    ranges: str = "urdf"
    rules: Sequence[int] = DEFAULT_RULES
    walkers: str = "paper"
    rigid: float | None = None
    tangent: float | None = None
    angle: float | None = None
    contact_margin: float = 0.0
    scale: str = ""
    proportions: str = "figure"
    infer: bool = True
    root: str = "auto"
    refine: bool | None = None
    length_deviation: float | None = None
    rank: bool = True
    q: bool = False
    margins: bool = False
    shard_frames: int = SHARD_FRAMES
    made_with: dict[str, str] = field(default_factory=versions)

    def __post_init__(self) -> None:
        if not 1 <= self.shard_frames <= 1_000_000:
            raise InputError(f"--shard-frames: {self.shard_frames}; expected 1 to 1,000,000")
        object.__setattr__(self, "checks", check_names(self.checks))
        if self.scale:
            parse_scale(self.scale)
        thresholds_of(self.walkers)
        _ = self.table, self.rooting, self.tolerance(uncalibrated=False)

    @cached_property
    def table(self) -> Ranges:
        """The joint ranges."""
        return load_ranges(self.ranges)

    @cached_property
    def rooting(self) -> Rooting:
        """How a neck is placed."""
        return Rooting(method=self.root, deviation=self.source.deviation)  # type: ignore[arg-type]

    def tolerance(self, *, uncalibrated: bool) -> Tolerance | None:
        """Return the tolerances that are given, the rest as usual; None where none is."""
        if self.rigid is None and self.tangent is None and self.angle is None:
            return None
        usual = PHOTOGRAPH_TOLERANCE if uncalibrated else MEASURED_TOLERANCE
        rigid = usual.rigid if self.rigid is None else self.rigid
        return Tolerance(
            rigid=rigid,
            tangent=usual.tangent if self.tangent is None else self.tangent,
            placement=rigid <= EXACT_TOLERANCE.rigid,
            angle=usual.angle if self.angle is None else self.angle,
        )

    def document(self) -> dict[str, Any]:
        """Return all of it as plain values, with the content of the files that are named.

        Raises
        ------
        InputError
            Where one of those cannot be read.
        """
        own = asdict(replace(self, source=Source()))
        del own["source"]
        table = Path(self.ranges)
        return {
            **own,
            "checks": list(self.checks),
            "rules": list(self.rules),
            "ranges": [self.ranges, digests.of_file(table)] if table.is_file() else [self.ranges],
            "source": self.reading(),
            "figure": load_figure().hash,
        }

    def reading(self) -> dict[str, Any]:
        """Return as plain values what decides which views are read from key points."""
        own = asdict(self.source)
        for name in ("lengths", "calibrate"):
            if own[name] is not None:
                own[name] = digests.of_input(own[name])
        camera = split_camera(self.source.camera) if self.source.camera else None
        if camera is not None:
            own["camera"] = [digests.of_file(camera[0]) if camera[0].is_file() else str(camera[0]), camera[1]]
        layout = Path(self.source.skeleton)
        if self.source.skeleton and layout.is_file():
            own["skeleton"] = digests.of_file(layout)
        return own

    def check_versions(self) -> None:
        """Refuse to go on with other versions than those that the run was begun with.

        Raises
        ------
        InputError
            Where a machine of a cluster has others.
        """
        for name, expected in self.made_with.items():
            found = version(name)
            if found != expected:
                raise InputError(
                    f"{name} is {found} here; expected {expected}, as where the run was started; install it"
                )

    def check_view(self, view: View) -> None:
        """Refuse options that say nothing about such a view, before any frame is recovered.

        Raises
        ------
        InputError
            Where a calibrated view is given a scale or Taylor's proportions, an uncalibrated one a root, or one whose
            camera is not an `opencv` one a deviation.
        """
        refuse_deviation(view, self.source.deviation)
        if isinstance(view.camera, ScaledOrthographicModel):
            if self.root != "auto":
                raise InputError(
                    "--root: the view's camera is not known, and so no depth is; leave the option out"
                )
        elif self.scale:
            raise InputError("--scale: the view's camera is calibrated; leave the option out")
        elif self.proportions == "taylor":
            raise InputError(
                "--proportions: taylor is for uncalibrated views (scaled-orthographic); leave the option out"
            )

    def recover(self, view: View) -> Recovery:
        """Recover some frames: `posekit.recover` with what is asked."""
        uncalibrated = isinstance(view.camera, ScaledOrthographicModel)
        return recover(
            view,
            checks=self.checks,
            ranges=self.table,
            rules=self.rules,
            walkers=self.walkers,
            tolerance=self.tolerance(uncalibrated=uncalibrated),
            contact_margin=self.contact_margin,
            scale=parse_scale(self.scale, per_unit=PER_METRE[view.unit]) if self.scale else None,
            proportions=self.proportions if self.proportions == "taylor" else "figure",
            infer=self.infer,
            rooting=Rooting(method=self.rooting.method) if uncalibrated else self.rooting,
            refine=self.refine,
            length_deviation=self.length_deviation,
        )
