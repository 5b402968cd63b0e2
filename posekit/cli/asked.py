"""What the options of a command ask of every recovery."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

from posekit.cli.judging_options import Judging, Tolerances
from posekit.cli.noise_options import Uncertain
from posekit.cli.options import about, progress_so_far
from posekit.cli.terminal import say
from posekit.errors import InputError, PosekitError

if TYPE_CHECKING:
    from posekit.formats.own import View
    from posekit.recovery.recovery import Recovery
    from posekit.recovery.scaled_sequences import ScaledFollowing
    from posekit.settings import RecoverSettings
    from posekit.views.opened import Opened

MAX_EXPLAINED: Final = 500_000
"""Pruned branches in a result, 1.5 GB to be read: exact frames have some hundreds, noisy ones a hundred thousand."""


def settings_of(
    judging: Judging, tolerances: Tolerances, uncertain: Uncertain | None = None, **others: Any
) -> RecoverSettings:
    """Make the settings of recoveries from groups of options, and others by the names of the settings.

    Raises
    ------
    InputError
        Where an option is impossible, whatever the view.
    """
    from posekit.recovery.body import loaded
    from posekit.settings import RecoverSettings, Rooting

    if uncertain is not None:
        others |= {
            "infer": uncertain.infer,
            "rooting": Rooting(method=uncertain.root, deviation=uncertain.deviation),  # type: ignore[arg-type]
            "refine": uncertain.refine,
            "length_deviation": uncertain.length_deviation,
            "coverage": uncertain.coverage,
        }
    asked = RecoverSettings(
        checks=judging.names,
        ranges=judging.ranges,
        rules=judging.numbers,
        walkers=judging.walkers,
        tolerance=tolerances.given,
        **others,
    )
    return loaded(asked)


@contextmanager
def leaving_out(one: Opened, people: Sequence[Opened], recovered: Sequence[object]) -> Iterator[None]:
    """Warn of a person who cannot be recovered where others can; refuse the whole where nobody can be."""
    try:
        yield
    except PosekitError as error:
        if len(people) == 1 or (one is people[-1] and not recovered):
            raise
        say(f"posekit: warning: person {one.person} is left out: {error}", err=True)


def refuse_unrecovered(recovery: Recovery, path: Path) -> None:
    """Refuse a view in none of whose frames anything could be grown."""
    if all(frame.reason for frame in recovery.frames):
        raise InputError(f"{path}: {recovery.frames[0].reason}")


def refuse_unexplained(recovery: Recovery, path: Path, *, explain: bool) -> None:
    """Refuse to list more pruned branches than can be written and read again."""
    count = recovery.pruned_count if explain else 0
    if count > MAX_EXPLAINED:
        raise InputError(
            f"{path}: --explain: {count:,} branches were pruned; expected at most {MAX_EXPLAINED:,}; give fewer "
            "frames, or leave it out"
        )


def follow_scaled(
    seen: View, path: Path, settings: RecoverSettings, *, paths: int, deviation: float
) -> ScaledFollowing:
    """Find the scale of a person's lengths with the paths through all frames of a view that comes from `path`.

    Raises
    ------
    InputError
        Where nobody says how noisy the image points are, or no path is asked for.
    """
    from posekit.recovery.conductor import recover
    from posekit.recovery.scaled_sequences import AT_ONE_SCALE
    from posekit.recovery.scaled_sequences import follow_scaled as find

    if not paths:
        raise InputError(
            "--follow-scale: it is found by following; expected --follow K with it; give --follow 1"
        )
    if settings.refine is False or (
        settings.rooting.deviation is None and seen.deviation is None and not seen.derived
    ):
        raise InputError(
            "--follow-scale: the scale is told by what noise can explain; expected a standard deviation in pixels; "
            "give --deviation, 1 for points that are all but exact, and no --no-refine"
        )
    told = settings.length_deviation
    refined = settings.changed(refine=True, length_deviation=AT_ONE_SCALE if told is None else told)
    with progress_so_far("trying scales") as done, about(path):
        return find(seen, lambda one: recover(one, refined), deviation=deviation, k=paths, progress=done)


def check_noise(seen: View, deviation: float | None) -> None:
    """Refuse a deviation where it has no effect; of one that the view itself says, say so.

    Raises
    ------
    InputError
        Where the option is given for a `lee-chen` camera.
    """
    from posekit.recovery.noise import noiseless_camera, refuse_deviation

    refuse_deviation(seen, deviation)
    camera = noiseless_camera(seen)
    if camera and seen.deviation is not None:
        say(
            f"posekit: warning: the view's deviation of {seen.deviation:g} px has no effect: its camera is "
            f"{camera}, whose noise is not allowed for",
            err=True,
        )
