"""What the options of `posekit recover` ask of every view."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from contextlib import nullcontext
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING

import typer

from posekit.cli.judging_options import Tolerances
from posekit.cli.options import about, progress, progress_so_far
from posekit.errors import InputError, PosekitError

if TYPE_CHECKING:
    from posekit.formats.own import View
    from posekit.recovery.recovery import Recovery
    from posekit.recovery.scaled_sequences import ScaledFollowing
    from posekit.settings import Rooting
    from posekit.validators import Ranges
    from posekit.views.opening import Opened


@dataclass(frozen=True, kw_only=True)
class Asked:
    """What is asked of every view, as `posekit.recover` takes it where nothing else is said.

    Parameters
    ----------
    tolerances : Tolerances
        What is not given is as it is for such a view.
    scale : str
        As the option has it: its unit is the view's.
    """

    checks: tuple[str, ...]
    ranges: Ranges
    rules: tuple[int, ...]
    walkers: str
    tolerances: Tolerances
    contact_margin: float
    group: float | None
    scale: str
    proportions: str
    nearer: Sequence[Mapping[str, str]] | None
    infer: bool
    rooting: Rooting
    refine: bool | None
    length_deviation: float | None
    paths: int
    scale_deviation: float | None

    def recover_all(
        self, people: Sequence[Opened], path: Path
    ) -> list[tuple[Opened, Recovery, ScaledFollowing | None]]:
        """Recover everybody before anything is written; of several people, warn of those who cannot be.

        Where the scale of their lengths is asked for, they are followed by now.
        """
        self.check_noise(people[0].view)  # one camera sees them all
        recovered = []
        for one in people:
            try:
                found = None if self.scale_deviation is None else self.follow_scaled(one.view, path)
                recovery = self.recover(one.view, path) if found is None else found.recovery
                recovered.append((one, _some(recovery, path), found))
            except PosekitError as error:
                if len(people) == 1 or (one is people[-1] and not recovered):
                    raise
                typer.echo(f"posekit: warning: person {one.person} is left out: {error}", err=True)
        return recovered

    def follow_scaled(self, seen: View, path: Path) -> ScaledFollowing:
        """Find the scale of a person's lengths with the paths through all frames.

        Raises
        ------
        InputError
            Where nobody says how noisy the image points are, or no path is asked for.
        """
        from posekit import recovery

        if not self.paths:
            raise InputError(
                "--follow-scale: it is found by following; expected --follow K with it; give --follow 1"
            )
        if self.refine is False or (
            self.rooting.deviation is None and seen.deviation is None and not seen.derived
        ):
            raise InputError(
                "--follow-scale: the scale is told by what noise can explain; expected a standard deviation in pixels; "
                "give --deviation, 1 for points that are all but exact, and no --no-refine"
            )
        with progress_so_far("trying scales") as done, about(path):
            return recovery.follow_scaled(
                seen,
                lambda one: replace(self, refine=True).recover(one, path, quiet=True),
                deviation=self.scale_deviation or 0.0,
                k=self.paths,
                progress=done,
            )

    def recover(self, seen: View, path: Path, *, quiet: bool = False) -> Recovery:
        """Recover a view that comes from `path`."""
        from posekit import objects, recovery, settings
        from posekit.formats import own as files

        uncalibrated = isinstance(seen.camera, files.ScaledOrthographicModel)
        per_unit = files.PER_METRE[seen.unit]
        shown = nullcontext(None) if quiet else progress("recovering", len(seen.time))
        with shown as done, about(path):
            return recovery.recover(
                seen,
                checks=self.checks,
                ranges=self.ranges,
                rules=self.rules,
                walkers=self.walkers,
                tolerance=self.tolerances.filled(
                    settings.PHOTOGRAPH_TOLERANCE if uncalibrated else settings.MEASURED_TOLERANCE
                ),
                contact_margin=self.contact_margin,
                group=self.group,
                scale=objects.parse_scale(self.scale, per_unit=per_unit) if self.scale else None,
                proportions=self.proportions,
                infer=self.infer,
                nearer=self.nearer,
                rooting=self.rooting,
                refine=self.refine,
                length_deviation=self.length_deviation,
                progress=done,
            )

    def check_noise(self, seen: View) -> None:
        """Refuse a deviation where it has no effect; of one that the view itself says, say so.

        Raises
        ------
        InputError
            Where the option is given for another camera than an `opencv` one.
        """
        from posekit.recovery.noise import noiseless_camera, refuse_deviation

        refuse_deviation(seen, self.rooting.deviation)
        camera = noiseless_camera(seen)
        if camera and seen.deviation is not None:
            typer.echo(
                f"posekit: warning: the view's deviation of {seen.deviation:g} px has no effect: its camera is "
                f"{camera}, and noise is allowed for where it is opencv",
                err=True,
            )


def _some(recovery: Recovery, path: Path) -> Recovery:
    """Refuse a view in none of whose frames anything could be grown."""
    if all(frame.reason for frame in recovery.frames):
        raise InputError(f"{path}: {recovery.frames[0].reason}")
    return recovery
