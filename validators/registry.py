"""The registry of checks: what ``--checks`` may name, and how checks are made from names, settings and objects.

Those that come with posekit are in `CHECK_KINDS`. Others are found by name: in the entry-point group
``posekit.checks``, or as ``package.module:Class``; or they are given as objects (docs, "Write your own check").
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from importlib import import_module
from importlib.metadata import entry_points
from typing import Any, Final

import numpy as np

from posekit.body import Figure
from posekit.errors import InputError
from posekit.safe_io import cut, perhaps
from posekit.settings import CheckSettings
from posekit.settings.check import check_settings
from posekit.skeleton import POINTS
from posekit.tree import Check, Scope, given_check
from posekit.validators.collision import collision
from posekit.validators.joint_range import joint_range
from posekit.validators.options import CheckOptions
from posekit.validators.rigid_parts import rigid_parts
from posekit.validators.walking import walking

ENTRY_POINTS: Final = "posekit.checks"
"""The entry-point group of other packages' checks: a subclass of `posekit.tree.Check`, or a function that makes one or
several of a figure and parameters."""

CACHED_SUITES: Final = 64
"""Kinds of checks of one figure and its options that are kept: a frame is judged by some fifteen."""

CHECK_NAME: Final = re.compile(r"[A-Za-z][A-Za-z0-9_-]*")
"""What a check may be called: files have columns and members of that name."""


@dataclass(frozen=True, kw_only=True)
class CheckKind:
    """A kind of check that comes with posekit.

    Parameters
    ----------
    make : callable
        Makes its checks for a figure.
    scope : Scope
        Theirs.
    """

    make: Callable[[Figure, CheckOptions], Sequence[Check]]
    scope: Scope = Scope.POSTURE


CHECK_KINDS: Final[Mapping[str, CheckKind]] = {
    "rigid-parts": CheckKind(
        make=lambda figure, options: rigid_parts(
            figure, tolerance=options.rigid_tolerance, mode=options.rigid_mode, limbs=options.limbs
        )
    ),
    "joint-range": CheckKind(
        make=lambda figure, options: joint_range(
            figure, options.ranges, tolerance=options.angle_tolerance, directions=options.directions
        )
    ),
    "collision": CheckKind(
        make=lambda figure, options: collision(
            figure, contact_margin=options.contact_margin, exact=options.exact
        )
    ),
    "walking": CheckKind(
        make=lambda figure, options: walking(figure, options.rules, options.thresholds), scope=Scope.MOTION
    ),
}
"""By the name that ``--checks`` takes, in the order in which they are applied; other checks come after them."""

ALL_CHECKS: Final = tuple(CHECK_KINDS)
PHYSICAL_CHECKS: Final = tuple(name for name, kind in CHECK_KINDS.items() if kind.scope is not Scope.MOTION)

AnyCheck = str | Check | CheckSettings
"""A check by its name, itself, or as settings record it."""


def chosen_checks(checks: Iterable[AnyCheck]) -> tuple[CheckSettings, ...]:
    """Return what settings record of some checks, each once, in the order in which they are applied.

    Raises
    ------
    InputError
        Where a name is no check's, or something is given that is no check.
    """
    chosen = list(dict.fromkeys(map(check_settings, checks)))
    for one in chosen:
        if one.name not in CHECK_KINDS and given_check(one) is None:
            _found(one.name)
    rank = {name: place for place, name in enumerate(ALL_CHECKS)}
    return tuple(sorted(chosen, key=lambda one: rank.get(one.name, len(rank))))


def check_names(checks: Iterable[AnyCheck]) -> tuple[str, ...]:
    """Return the names of some checks, each once, in the order in which they are applied; refuse what is no check."""
    return tuple(dict.fromkeys(one.name for one in chosen_checks(checks)))


def make_checks(
    figure: Figure, checks: Iterable[AnyCheck], options: CheckOptions | None = None, **changes: Any
) -> list[Check]:
    """Make checks for a figure.

    Parameters
    ----------
    figure : Figure
        The figure that they are made for.
    checks : iterable of str, Check or CheckSettings
        Which; see `chosen_checks`.
    options : CheckOptions, optional
        What they are made with.
    **changes
        Some of the options, in place of those.

    Raises
    ------
    InputError
        Where a check is unknown or cannot be made, or an option is impossible.
    """
    options = replace(options or CheckOptions(), **changes)
    made: list[Check] = []
    for settings in chosen_checks(checks):
        if settings.name not in CHECK_KINDS:
            made += _made(figure, settings)
        elif settings.parameters:
            own = options.with_parameters(settings.name, settings.parameters)
            made += CHECK_KINDS[settings.name].make(figure, own)
        else:
            made += _built_in(settings.name, figure, options)
    up = np.array(options.up)
    return [check.oriented(up) if check.scope is Scope.VIEW else check for check in made]


@lru_cache(maxsize=CACHED_SUITES)
def _built_in(name: str, figure: Figure, options: CheckOptions) -> tuple[Check, ...]:
    """Make the checks of a kind once: they never change, and a single frame takes little longer than making them."""
    return tuple(CHECK_KINDS[name].make(figure, options))


def _made(figure: Figure, settings: CheckSettings) -> Sequence[Check]:
    """Make somebody's own checks, and refuse what is none."""
    given = given_check(settings)
    if given is not None:
        return [_proven(given, figure)]
    factory = _found(settings.name)
    parameters = {name: _immutable(value) for name, value in settings.parameters.items()}
    try:
        made = factory(**parameters) if isinstance(factory, type) else factory(figure, **parameters)
    except TypeError as error:
        raise InputError(f"--checks: {settings.name}: it cannot be made: {error}") from None
    return [_proven(check, figure) for check in (made if isinstance(made, list | tuple) else [made])]


def _immutable(value: Any) -> Any:
    return tuple(_immutable(one) for one in value) if isinstance(value, list) else value


def _found(name: str) -> Callable[..., Any]:
    """Find what makes somebody's own check, by the name of an entry point or of a class."""
    known = {entry.name: entry for entry in entry_points(group=ENTRY_POINTS)}
    module, _, inside = name.partition(":")
    if name not in known and not (module and inside):
        names = (*ALL_CHECKS, *sorted(known))
        raise InputError(
            f"--checks: {cut(name)!r} is not a check; expected some of {', '.join(names)}{perhaps(name, names)}"
        )
    try:
        if name in known:
            found = known[name].load()
        else:
            found = import_module(module)
            for part in inside.split("."):
                found = getattr(found, part)
    except (ImportError, AttributeError) as error:
        raise InputError(
            f"--checks: {cut(name)}: it cannot be imported ({error}); expected a class in a module that every process "
            "finds, such as one of an installed package"
        ) from None
    if not callable(found) or (
        name not in known and not (isinstance(found, type) and issubclass(found, Check))
    ):
        raise InputError(
            f"--checks: {cut(name)} makes no check; expected a class that inherits from posekit.validators.Check, "
            f"or in the entry-point group {ENTRY_POINTS} a function of the figure"
        )
    return found  # type: ignore[no-any-return]


def _proven(check: Check, figure: Figure) -> Check:
    """Ask somebody's own check about the figure as it stands, and refuse it where its answer is none."""
    kind = type(check).__qualname__
    if not isinstance(check, Check):
        raise InputError(
            f"--checks: {kind} is no check; expected a class that inherits from posekit.validators.Check"
        )
    missing = [name for name in ("name", "unit", "places", "points") if not hasattr(check, name)]
    if missing:
        raise InputError(f"--checks: {kind} does not say its {missing[0]}")
    if not CHECK_NAME.fullmatch(check.name):
        raise InputError(
            f"--checks: {cut(repr(check.name))} is no name of a check; expected letters, digits, - and _"
        )
    wrong = [point for point in check.points if not 0 <= point < len(POINTS)]
    if wrong or not check.points or not check.places:
        raise InputError(
            f"--checks: {check.name}: expected at least one place and one point, each an index into "
            f"posekit.skeleton.POINTS, 0 to {len(POINTS) - 1}; it reads {wrong or list(check.points)}"
        )
    standing = figure.neutral_points[None, list(check.points)]
    found = check.judge(np.concatenate([standing, np.full_like(standing, np.nan)]))
    expected = (2, len(check.places))
    for what, shape in (("value", np.shape(found.value)), ("verdict", np.shape(found.violated))):
        if shape != expected:
            raise InputError(
                f"--checks: {check.name}: judge returns a {what} of shape {shape} for two postures; expected "
                f"{expected}, a row a posture and a column a place"
            )
    if found.violated[1].any():
        raise InputError(
            f"--checks: {check.name}: it rejects a posture none of whose points is known; expected NaN there, "
            "which is undecided"
        )
    return check
