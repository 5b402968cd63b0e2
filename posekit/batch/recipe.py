"""Everything that decides what a batch gives, apart from its inputs."""

from __future__ import annotations

from dataclasses import asdict, dataclass, field, replace
from importlib.metadata import version
from pathlib import Path
from typing import Any, Final

from posekit.batch import digests
from posekit.body import load_figure
from posekit.errors import InputError
from posekit.formats.own import View
from posekit.recovery.body import loaded, ranges_of
from posekit.recovery.noise import refuse_deviation
from posekit.recovery.person import refuse_settings
from posekit.safe_io.extras import extra
from posekit.settings import PartialTolerance, RecoverSettings, Scale, Tolerance
from posekit.views.camera import split_camera
from posekit.views.source import Source

SHARD_FRAMES: Final = 2000
"""Frames of a shard: about a second's work, and a file of a megabyte."""

RECORDED_PACKAGES: Final = ("posekit", "pin", "coal", "numpy", "pyarrow")
"""Whose versions decide results, or the bytes that they are written in."""


def versions() -> dict[str, str]:
    """Return the versions of what computes and writes the results."""
    extra("pyarrow", "parquet", "posekit batch")
    return {name: version(name) for name in RECORDED_PACKAGES}


@dataclass(frozen=True, kw_only=True)
class Recipe:
    """What is asked of every frame.

    Parameters
    ----------
    source : Source
        How key points are to be read: who, with which camera, with which lengths. Its deviation is that of the image
        points of all views.
    settings : RecoverSettings
        What is asked of every recovery.
    rank : bool
        Whether the table has each survivor's probability among those of its frame.
    q, margins : bool
        Whether the table has each survivor's configuration, and its worst margin by check. Each costs more than the
        recovery itself.
    shard_frames : int
        Frames of one output file, at most.
    made_with : mapping of str to str
        Versions of the packages that decide results, or the bytes that they are written in.

    Raises
    ------
    InputError
        Where one of them is impossible.
    """

    source: Source = field(default_factory=Source)
    settings: RecoverSettings = field(default_factory=RecoverSettings)
    rank: bool = True
    q: bool = False
    margins: bool = False
    shard_frames: int = SHARD_FRAMES
    made_with: dict[str, str] = field(default_factory=versions)

    def __post_init__(self) -> None:
        if not 1 <= self.shard_frames <= 1_000_000:
            raise InputError(f"--shard-frames: {self.shard_frames}; expected 1 to 1,000,000")
        said = [one for one in (self.source.deviation, self.settings.rooting.deviation) if one is not None]
        deviation = said[0] if said else None
        asked = loaded(self.settings)
        asked = asked.changed(rooting=replace(asked.rooting, deviation=deviation))
        if (asked.group, asked.nearer, asked.rooting.trust_head) != (None, None, True) or any(
            isinstance(one, Tolerance | Scale) for one in (asked.tolerance, asked.scale)
        ):
            raise InputError(
                "a batch groups nothing and takes no flips by hand, tolerances one by one (`PartialTolerance`) and a "
                "scale as text; expected settings of that kind"
            )
        object.__setattr__(self, "settings", asked)
        object.__setattr__(self, "source", replace(self.source, deviation=deviation))

    def document(self) -> dict[str, Any]:
        """Return all of it as plain values, with the content of the files that are named.

        Raises
        ------
        InputError
            Where one of those cannot be read.
        """
        asked = self.settings
        ranges = ranges_of(asked).name
        table = Path(ranges)
        taylor = asked.proportions == "taylor"
        return {
            "checks": list(map(str, asked.checks)),
            "ranges": [ranges, digests.of_file(table)] if table.is_file() else [ranges],
            "rules": list(asked.rules),
            "walkers": asked.walkers,
            **vars(asked.tolerance or PartialTolerance()),
            "contact_margin": asked.contact_margin,
            "scale": asked.scale or "",
            "proportions": asked.proportions if taylor else self.source.proportions,
            "infer": asked.infer,
            "root": asked.rooting.method,
            "refine": asked.refine,
            "length_deviation": asked.length_deviation,
            "coverage": asked.coverage,
            "rank": self.rank,
            "q": self.q,
            "margins": self.margins,
            "shard_frames": self.shard_frames,
            "made_with": dict(self.made_with),
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
        refuse_settings(view, self.settings)
