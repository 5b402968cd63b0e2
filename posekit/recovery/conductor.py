"""`recover`: locate the neck in a view, find all postures by tree or by solver, check them, and rank them."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterator, Mapping
from dataclasses import replace
from functools import cached_property, partial
from typing import Any, Final

import numpy as np
import pinocchio

import posekit
from posekit.body import Figure, with_head
from posekit.cameras import PinholeCamera, ScaledOrthographicCamera, View
from posekit.errors import refusal
from posekit.geometry import Array, Flags, Ints, norm, up_vector
from posekit.progress import watched
from posekit.ranking import Up, deviation_of_tolerance, log_terms
from posekit.recovery.certify import certified, noisy_judge, solver_limits
from posekit.recovery.gather import Gathering
from posekit.recovery.objects import read_nearer
from posekit.recovery.person import figure_of_view, uncertainty_of
from posekit.recovery.recovery import Recovery
from posekit.recovery.scales import figure_linkage, from_near, from_usual_distance
from posekit.recovery.sight import SHARP_PIXELS, Sight, sight_of
from posekit.settings import EXACT, MEASURED, PHOTOGRAPH, RecoverSettings
from posekit.skeleton import HEAD_POINTS, RIGID_SEGMENTS, SEGMENTS
from posekit.solver import Modes, Problem, solve
from posekit.tree import grow
from posekit.validators.judge import PostureJudge, chosen_checks, early_checks

#: Packages that influence a result, whose versions it records.
VERSIONED: Final = {"posekit": posekit, "pin": pinocchio, "numpy": np}

#: Number of frames whose trees are grown together, and of frames that are solved together: enough to share NumPy's
#: overhead, few enough to keep memory small. Results do not depend on these numbers.
GROWN_AT_ONCE, SOLVED_AT_ONCE = 512, 64

#: Largest number of modes of a frame that are certified and ranked, by lowest chi2; few frames have more.
MANY: Final = 3000

#: Largest chi2 of the best mode of exact points under `SHARP_PIXELS`; noise of 1 pixel causes about 30.
EXACT_CHI2: Final = 0.05

#: Factor on the deviations of image points, relative deviation added to lengths, and largest chi2 of the solution that
#: explains why a frame is empty.
LOOSE_TIMES, LOOSE_LENGTHS, LOOSE_CHI2 = 20.0, 0.1, 1e3

#: Smallest residual (standard deviations) that is named as a reason for an empty frame, and largest number of them.
NAMED_DEVIATIONS, MOST_NAMED = 3.0, 3


def recover(view: View, settings: RecoverSettings | None = None, *, figure: Figure | None = None) -> Recovery:
    """Recover every posture that fits a view and passes the checks.

    The result of a frame depends on that frame alone.

    Parameters
    ----------
    view : View
    settings : RecoverSettings, optional
    figure : Figure, optional
        Figure that gets the lengths, stature and head points of the view; by default the built-in figure.

    Raises
    ------
    InputError
        If a setting does not apply to this kind of view, or the view's data contradict each other.

    Examples
    --------
    >>> import posekit
    >>> from posekit.recovery.conductor import recover
    >>> len(recover(posekit.builtin_view("seq1"), posekit.RecoverSettings(contact_margin=0.01)))
    5
    """
    settings = settings or RecoverSettings()
    conductor = _Conductor(view, settings, figure)
    for stage, at_once in conductor.stages():
        left = np.array(sorted(conductor.found.open), dtype=np.intp)
        starts = range(0, len(left), at_once)
        for start in watched(starts, "recovering") if starts else ():
            stage(left[start : start + at_once])
    recovery = conductor.found.recovery(conductor.margins, **conductor.about())
    if settings.follow:
        from importlib import import_module

        # Following is a layer above this one; it is loaded only if a path is wanted.
        recovery = import_module("posekit.following.paths").follow(recovery, paths=settings.follow)
    return recovery


class _Conductor:
    """Recovery of one view: the person, noise, checks and up direction that all frames share."""

    def __init__(self, view: View, settings: RecoverSettings, figure: Figure | None) -> None:
        person = figure_of_view(view, settings, figure)
        lengths = uncertainty_of(view, settings, own_figure=figure is not None)
        self.view, self.settings, self.person, self.lengths = view, settings, person, lengths
        self.sight: Sight = sight_of(view, person, settings, lengths)
        self.photograph = isinstance(view.camera, ScaledOrthographicCamera)
        given = settings.tolerance(PHOTOGRAPH if self.photograph else MEASURED)
        if given is not None and settings.refine:
            raise refusal("", "refine", "refine and tolerances", "one of them", "leave the tolerances out")
        self.judged, self.tolerance = ("exact", EXACT) if given is None else ("tolerated", given)
        self.up = _up_of(view)
        chosen = chosen_checks(settings, of_robot=False, in_time=False)
        self.checks = [check for check in chosen if not getattr(check, "over_time", False)]
        self.exact = PostureJudge(person, settings, self.tolerance, self.up.direction)
        nearer = np.zeros((len(view), len(SEGMENTS)), dtype=np.int8)
        if settings.nearer:
            nearer[:] = read_nearer(figure_linkage(person), settings.nearer, len(view))
        self.found = Gathering(view, self.sight, person, settings, nearer)

    @cached_property
    def noisy(self) -> PostureJudge:
        """Judge with tolerances for postures recovered from noisy image points."""
        return noisy_judge(
            self.person, self.settings, self.lengths, self.up.direction, photograph=self.photograph
        )

    def stages(self) -> Iterator[tuple[Callable[[Ints], None], int]]:
        """Yield functions that recover frames, in order, and the largest number of frames per call."""
        found = self.found
        if self.judged == "tolerated":
            yield self._grow, GROWN_AT_ONCE
            why = "its neck is not known, or a joint is not seen"
            found.close(*found.open, judged="tolerated", reason=why)
        elif self.sight.may_be_exact:
            yield self._grow, GROWN_AT_ONCE
            if self.settings.refine is False:
                found.close(*found.open, judged="exact", reason="no posture is exact", rejected={})
            elif not self.photograph:
                yield partial(self._solve, sharp=True), SOLVED_AT_ONCE
        yield partial(self._solve, sharp=False), SOLVED_AT_ONCE

    def _grow(self, part: Ints) -> None:
        """Grow the trees of the frames `part`; frames whose points cannot be exact are left to the solver."""
        whole = np.isfinite(self.sight.root).all(axis=1) & np.isfinite(self.sight.image).all(axis=(1, 2))
        sight = self.sight.take(np.flatnonzero(whole & np.isin(self.sight.frame, part)))
        if not len(sight.frame):
            return
        tolerance, lengths = self.tolerance, self.found.lengths
        trees = grow(
            sight.camera,
            sight.image,
            sight.root,
            lengths,
            early_checks(self.settings),
            judge=self.exact,
            head=sight.head,
            tolerance=tolerance.tangent,
        )
        lost: dict[int, dict[str, int]] = {}
        levels: dict[int, Ints] = {}
        for k, rejected, own in zip(sight.frame.tolist(), trees.rejected, trees.levels, strict=True):
            lost[k] = dict(Counter(lost[k]) + Counter(rejected)) if k in lost else rejected
            levels[k] = levels.get(k, 0) + own
        frame = sight.frame[trees.frame]
        if self.judged == "exact":
            lost = {k: lost[k] for k in self._closing(frame, trees.joints, lost)}
        kept = np.flatnonzero(np.isin(frame, list(lost)))
        row, joints, short = trees.frame[kept], trees.joints[kept], trees.length_residual[kept]
        columns = {
            "frame": frame[kept],
            "joints": joints,
            "head": sight.head[row],
            "branch": trees.branches[kept],
            "scale": sight.scale[row],
        }
        deviation = deviation_of_tolerance(tolerance.rigid)
        terms = log_terms(joints, deviation=deviation, lengths=lengths, length_residual=short, up=self.up)
        # The tree has judged checks with `parts` completely. Other checks have judged only the points that they name.
        late = [check for check in self.checks if not hasattr(check, "parts")]
        reason = np.full(len(joints), "")
        if late:
            reason, _ = certified(self.exact, late, with_head(joints, sight.head[row]))
        self.found.add(self.judged, lost, columns, terms, reason)
        for k in lost:
            self.found.frames["levels"][k] = levels[k].tolist()

    def _closing(self, frame: Ints, joints: Array, lost: Mapping[int, Mapping[str, int]]) -> set[int]:
        """Return the frames with exact image points: some branch has the correct lengths in torso and hips."""
        start, end = np.array(RIGID_SEGMENTS).T
        apart = norm(joints[:, start] - joints[:, end])
        off = np.abs(apart - self.found.lengths[-len(RIGID_SEGMENTS) :])
        closing = set(frame[(off <= 10 * EXACT.rigid).all(axis=1)].tolist())
        if "rigid-parts" in [check.name for check in self.checks]:
            before = ("rigid-parts/", "no-solution/")
            others = lost.keys() - closing
            closing |= {k for k in others if not all(name.startswith(before) for name in lost[k])}
        return closing

    def _solve(self, part: Ints, *, sharp: bool) -> None:
        """Solve the frames `part` under noise; if `sharp`, points and lengths are treated as exact."""
        sight = self.sight.take(np.flatnonzero(np.isin(self.sight.frame, part)))
        problem = self._problem(sight, sharp=sharp)
        pulling = [check.residuals for check in self.checks if hasattr(check, "residuals")]
        pull = (lambda joints: np.concatenate([one(joints) for one in pulling], axis=1)) if pulling else None
        modes = solve(problem, most=MANY, pull=pull)
        if sharp:
            best = modes.chi2[np.searchsorted(modes.frame, modes.frame)]
            modes = modes.take((best < EXACT_CHI2) & (problem.freedom > 0)[modes.frame])
        frame, joints, scale = sight.frame[modes.frame], modes.joints, sight.scale[modes.frame]
        if self.photograph:
            joints, scale = from_near(joints, sight.middle[modes.frame], scale)
        hidden = np.asarray(~np.isfinite(self.view.image[frame]).all(axis=2))
        columns = {
            "frame": frame,
            "joints": joints if self.settings.infer else np.where(hidden[..., None], np.nan, joints),
            "head": np.full((len(joints), len(HEAD_POINTS), 3), np.nan),
            "chi2": modes.chi2,
            "inferred": hidden,
            "scale": scale,
        }
        reason, _ = certified(self.noisy, self.checks, with_head(joints))
        volume = modes.log_evidence + 0.5 * modes.chi2
        terms = log_terms(joints, chi2=modes.chi2, log_volume=volume, up=self.up)
        lost: dict[int, dict[str, int]] = {k: {} for k in set(frame.tolist())}
        self.found.add("noisy", lost, columns, terms, reason, partial(self._covariance, modes), leave=sharp)
        if not sharp:
            self._diagnose(sight, problem, [k for k in part.tolist() if k not in lost])

    def _covariance(self, modes: Modes, rows: Ints) -> Array:
        """Return the covariances of the joints of selected modes (N, 42, 42), square metres."""
        found = modes.covariance(rows)
        if self.photograph:
            # In an uncalibrated picture a larger person at a larger distance looks the same, so size adds its own
            # covariance.
            x = self.lengths.common * modes.x[rows, :-1]
            found += x[:, :, None] * x[:, None]
        return found

    def _diagnose(self, sight: Sight, problem: Problem, empty: list[int]) -> None:
        """Store the largest residuals of the frames `empty`, which have no posture, under larger deviations."""
        some = np.flatnonzero(np.isin(sight.frame, empty))
        if not len(some):
            return
        strict = problem.take(some)
        records = strict.records.copy()
        records["length_weight"] = 1 / (1 / records["length_weight"] + LOOSE_LENGTHS)
        records["image"] /= LOOSE_TIMES
        loose = replace(strict, records=records)
        # Residuals of the nearest posture are in units of the stated deviations.
        nearest = replace(solve(loose, max_chi2=LOOSE_CHI2, most=1), problem=strict)
        owner = sight.frame[some][nearest.frame]
        for k in empty:
            why = _why(nearest.take(np.flatnonzero(owner == k)[:1]))
            self.found.close(k, judged="noisy", reason=why, rejected={"noise/no_mode": 1})

    def _problem(self, sight: Sight, *, sharp: bool) -> Problem:
        """Return the solver's problem for the rows of a `Sight`; if `sharp`, points and lengths count as exact."""
        problem = Problem.seen(
            sight.camera,
            sight.image,
            SHARP_PIXELS * sight.deviation if sharp else sight.deviation,
            lengths=self.found.lengths,
            length_deviation=0.0 if sharp else self.lengths.deviations,
            size_deviation=0.0 if sharp or self.photograph else sight.size_deviation,
            root=None if self.photograph else np.where(sight.given[:, None], sight.root, np.nan),
            limits=solver_limits(self.person, self.checks, self.settings.ranges),
            robust=bool(self.view.derived) and not self.photograph,
        )
        return (
            from_usual_distance(problem, sight.middle, sight.size_deviation) if self.photograph else problem
        )

    def margins(self, points: Array, noisy: Flags) -> dict[str, Array]:
        """Return the worst margin (N,) of postures (N, 19, 3) by check; `noisy` marks postures from noisy points."""
        found: dict[str, Array] = {}
        for rows, judge in ((~noisy, self.exact), (noisy, self.noisy)):
            if rows.any():
                for name, values in certified(judge, self.checks, points[rows])[1].items():
                    found.setdefault(name, np.full(len(points), np.nan))[rows] = values
        return found

    def about(self) -> dict[str, Any]:
        """Return the settings and tolerances that the result depends on, as JSON values."""
        tolerances: dict[str, Any] = {"exact": vars(EXACT), self.judged: vars(self.tolerance)}
        if "noisy" in vars(self):
            tolerances["noisy"] = {
                "deviation": float(np.nanmedian(self.sight.deviation)),
                "size": self.lengths.common,
                "by_segment": dict(self.lengths.own),
                "certified": vars(self.noisy.tolerance),
                "contact_margin": self.noisy.settings.contact_margin,
            }
        settings = {
            **self.settings.to_json(),
            "checks": [check.name for check in self.checks],
            "figure": self.person.hash,
            "moved_lengths": dict(self.person.moved_lengths),
            "shoulders": self.person.shoulder_side,
            "up": self.up.source,
            "prior": "people",
            "derived": list(self.view.derived),
            "versions": {name: module.__version__ for name, module in VERSIONED.items()},
        }
        return {"settings": settings, "tolerances": tolerances}


def _why(nearest: Modes) -> str:
    """Return why a frame has no posture: the residuals above three standard deviations in the nearest posture."""
    if not len(nearest):
        return "no posture is near the image points: the camera, the lengths or left and right may be wrong"
    size = {name: float(value[0]) for name, value in nearest.residuals().items()}
    named = sorted((name for name in size if size[name] > NAMED_DEVIATIONS), key=lambda name: -size[name])
    if not named:
        return "every posture is less likely than 1 in 1,000 by chi-square: give a larger --deviation"
    misses = ", ".join(f"{name} by {size[name]:.1f} deviations" for name in named[:MOST_NAMED])
    return f"no posture fits: the nearest misses {misses}"


def _up_of(view: View) -> Up:
    """Return the up direction of the calibration; without it, the up direction of a level camera."""
    camera = view.camera
    if isinstance(camera, PinholeCamera) and camera.R is not None and camera.up:
        return Up(direction=camera.R @ up_vector(camera.up), source=f"{camera.up}, as the calibration source")
    return Up.level()
