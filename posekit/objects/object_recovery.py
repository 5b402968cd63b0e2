"""One uncalibrated view of any articulated object in, every posture behind it out."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, replace
from importlib.metadata import version

import numpy as np

from posekit.errors import InputError, PosekitError
from posekit.formats.own import Family
from posekit.formats.own.object_result import ObjectFrame, ObjectResult
from posekit.formats.own.object_view import ObjectView
from posekit.objects.articulated import ArticulatedObject
from posekit.objects.certify import Certifier
from posekit.objects.growth import GrownObject, grow
from posekit.objects.nearer_ends import NearerEnds
from posekit.objects.object_plan import ObjectPlan
from posekit.objects.object_scales import CLOSED_RESIDUAL, family_of
from posekit.objects.object_tolerance import ObjectTolerance
from posekit.settings.scale import Scale

NOT_ASKED = "undecided: no configuration was asked for"


def recover_object(
    view: ObjectView,
    thing: ArticulatedObject,
    *,
    scale: Scale | None = None,
    nearer: Sequence[Mapping[str, str]] | None = None,
    tolerance: ObjectTolerance | None = None,
    certify: bool = True,
    progress: Callable[[int], None] | None = None,
) -> ObjectResult:
    """Recover every posture of an object behind a view.

    Parameters
    ----------
    view : ObjectView
        The image points of its frames, and the camera's aspect.
    thing : ArticulatedObject
        The linkage, and its robot where it has one: see `load_object`.
    scale : Scale, optional
        How the scale is found: by default the view's own, or the least that the lengths allow.
    nearer : sequence of mapping, optional
        Flips given by hand: segment to the name of its nearer end, one mapping for all frames or one a frame.
    tolerance : ObjectTolerance, optional
        In the linkage's unit. By default each frame is judged as exact where a loop closes exactly that need not
        have, as closed where the scale was found so that it does, else as measured.
    certify : bool
        Whether to look for the configurations of a robot.
    progress : callable, optional
        Called with the number of frames done since the last call.

    Returns
    -------
    ObjectResult

    Raises
    ------
    InputError
        Where the view is of another object, a name is unknown, or no frame can be what the view says: the first
        frame's reason.

    Examples
    --------
    >>> import numpy as np
    >>> from posekit.formats.own import ScaledOrthographicModel
    >>> from posekit.formats.own.object_view import ObjectView
    >>> from posekit.linkages import Linkage
    >>> rod = ArticulatedObject(linkage=Linkage.from_names(name="rod", segments={("a", "b"): 5.0, ("b", "c"): 3.0}))
    >>> view = ObjectView(
    ...     points=("a", "b", "c"), camera=ScaledOrthographicModel(scale=10.0), time=np.zeros(1),
    ...     image=np.array([[[0.0, 0.0], [30.0, 0.0], [30.0, 30.0]]]), unit=None,
    ... )
    >>> recover_object(view, rod).frames[0].points[..., 2].round(9) + 0.0
    array([[ 0., -4., -4.],
           [ 0.,  4.,  4.]])
    """
    if view.points != thing.linkage.points:
        raise InputError(
            f"the view's points are not those of the linkage {thing.linkage.name}; read it with that linkage"
        )
    hand = _by_hand(nearer, thing, len(view))
    longest = float(thing.working.lengths.max())
    exact, measured = ObjectTolerance.exact(longest), ObjectTolerance.measured(longest)
    given = None if tolerance is None else tolerance.times(thing.factor)
    certifier = None
    if thing.robot is not None:
        certifier = Certifier(thing.robot, thing.linkage.points)
    plans: dict[tuple[bytes, tuple[tuple[str, str], ...]], ObjectPlan] = {}
    frames: list[ObjectFrame] = []
    for k in range(len(view)):
        seen = np.isfinite(view.image[k, :, 0])
        choices = hand[k]
        key = (seen.tobytes(), tuple(sorted(choices.items())))
        try:
            if key not in plans:
                plans[key] = ObjectPlan.of(thing, seen, choices)
            plan = plans[key]
            family = family_of(
                plan,
                view.image[k],
                camera=view.camera,
                scale=scale,
                allowed=_allowed(scale, given, exact, measured),
                unit=view.unit,
            )
            grown = _grow(plan, view, k, family, given, exact, measured)
            frames.append(_frame(view, k, plan, family, grown, certifier if certify else None))
        except PosekitError as error:
            frames.append(_nothing(view, k, thing, str(error)))
        if progress is not None:
            progress(1)
    if all(frame.reason for frame in frames):
        raise InputError(f"frames[0]: {frames[0].reason}")
    names = thing.linkage.nodes
    return ObjectResult(
        unit=view.unit,
        linkage=thing.linkage.name,
        points=thing.linkage.points,
        segments=tuple((names[a], names[b]) for a, b in thing.linkage.segments),
        lengths=thing.working.lengths / thing.back,
        configuration_names=() if thing.robot is None else thing.robot.configuration_names,
        settings={
            "scale": "default" if scale is None else asdict(scale),
            "nearer": None if nearer is None else [dict(choices) for choices in nearer],
            "tolerance": "exact, else measured" if tolerance is None else asdict(tolerance),
            "exact": asdict(exact.times(1 / thing.factor)),
            "measured": asdict(measured.times(1 / thing.factor)),
            "robot": None if thing.robot is None else {"name": thing.robot.name, "hash": thing.robot.hash},
            "versions": {name: version(name) for name in ("posekit", "pin", "numpy")},
        },
        frames=frames,
    )


def _by_hand(
    nearer: Sequence[Mapping[str, str]] | None, thing: ArticulatedObject, frames: int
) -> list[dict[str, str]]:
    """Check flips that were given by hand; one mapping a frame."""
    if nearer is None:
        return [{} for _ in range(frames)]
    NearerEnds.of(nearer, thing.linkage, frames)
    return [dict(nearer[0 if len(nearer) == 1 else k]) for k in range(frames)]


def _allowed(
    scale: Scale | None, given: ObjectTolerance | None, exact: ObjectTolerance, measured: ObjectTolerance
) -> float:
    """Return by how much a segment may be too short: nothing at a scale that was given as exact."""
    if given is not None:
        return given.tangent
    return exact.tangent if scale is not None and scale.how == "value" else measured.tangent


def _grow(
    plan: ObjectPlan,
    view: ObjectView,
    k: int,
    family: Family,
    given: ObjectTolerance | None,
    exact: ObjectTolerance,
    measured: ObjectTolerance,
) -> GrownObject:
    """Grow the trees of one frame: exactly, and as measured where nothing shows that it is exact."""
    image, aspect = view.image[k], view.camera.aspect
    scales = family.chosen / plan.thing.back
    if given is not None:
        return grow(plan, image, aspect, scales, given, "given")
    grown = grow(plan, image, aspect, scales, exact, "exact")
    fitted = family.how.split("+")
    if grown.exact(fitted=fitted):
        return grown
    if (family.minima_residual[:1] <= CLOSED_RESIDUAL).any() and len(grown.postures):
        return replace(grown, judged="closed")  # the scale was found so that they close, exact image or not
    return grow(plan, image, aspect, scales, measured, "measured")


def _frame(
    view: ObjectView,
    k: int,
    plan: ObjectPlan,
    family: Family,
    grown: GrownObject,
    certifier: Certifier | None,
) -> ObjectFrame:
    """Gather what became of one frame, in the result's unit."""
    thing = plan.thing
    points = plan.place(grown.points)
    count, S = len(points), len(thing.linkage.segments)
    flips = np.zeros((count, S), dtype=np.int8)
    flips[:, list(plan.segments)] = grown.flips
    certified: tuple[bool | None, ...] = (None,) * count
    reasons: tuple[str, ...] = ("",) * count
    q = distance = None
    if certifier is not None:
        certificate = certifier.certify(points, tolerance=max(grown.tolerance.point, grown.tolerance.tangent))
        q, distance = certificate.q, certificate.distance
        certified, reasons = tuple(certificate.certified), tuple(certificate.reasons)
    elif thing.robot is not None:
        certified, reasons = (False,) * count, (NOT_ASKED,) * count
    back = thing.back
    return ObjectFrame(
        time=float(view.time[k]),
        judged=grown.judged,
        levels=grown.levels,
        points=points / back,
        branches=tuple(grown.branches),
        flips=flips,
        scales=family.chosen[grown.hypothesis],
        margins={name: values / back for name, values in grown.margins.items()},
        q=q,
        fk_distance=distance,
        certified=certified,
        reasons=reasons,
        rejected=grown.rejected,
        family=replace(family, mirrored=int(grown.mirrored.sum())),
    )


def _nothing(view: ObjectView, k: int, thing: ArticulatedObject, reason: str) -> ObjectFrame:
    """Make the frame of which nothing was grown."""
    P, S = len(thing.linkage.points), len(thing.linkage.segments)
    return ObjectFrame(
        time=float(view.time[k]),
        judged=None,
        reason=reason,
        levels=(),
        points=np.empty((0, P, 3)),
        branches=(),
        flips=np.empty((0, S), dtype=np.int8),
        scales=np.empty(0),
        margins={},
        certified=(),
        reasons=(),
        rejected={},
    )
