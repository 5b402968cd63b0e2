"""One view in, every physically possible posture out: root, tree or solver, certify, rank, answer."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Mapping
from dataclasses import replace
from functools import cache, cached_property
from typing import Any, Final, NamedTuple

import numpy as np
import pinocchio
from numpy.typing import NDArray

import posekit
from posekit.body import Figure, LengthUncertainty, segment_lengths
from posekit.cameras import PinholeCamera, ScaledOrthographicCamera, View
from posekit.errors import refusal
from posekit.geometry import Array
from posekit.progress import watched
from posekit.ranking import Up, deviation_of_tolerance, log_terms, softmax
from posekit.recovery.answer import answer_of, joint_radius
from posekit.recovery.certify import (
    Certificate,
    Certifier,
    group_of,
    noisy_contact,
    noisy_tolerance,
    solver_limits,
)
from posekit.recovery.gather import Found, gathered
from posekit.recovery.person import person_of, sided, uncertainty_of
from posekit.recovery.recovery import Recovery
from posekit.recovery.scales import figure_linkage, from_near, from_usual_distance
from posekit.recovery.sight import SHARP_PIXELS, Sight, sight_of
from posekit.settings import EXACT, MEASURED, PHOTOGRAPH, RecoverSettings, Tolerance
from posekit.skeleton import HEAD_POINTS, JOINTS, RIGID_SEGMENTS, SEGMENT_NAMES, SEGMENTS, TREE_SEGMENTS
from posekit.solver import Limits, Modes, Problem, solve
from posekit.tree import Trees, grow

#: Frames that are recovered together, under noise and where points may be exact: enough to spread NumPy's overhead. The
#: result does not depend on them.
FRAMES_AT_ONCE, EXACT_FRAMES_AT_ONCE = 64, 128

#: Modes of a frame that are certified and ranked, by chi2: frames with more are rare, and the rest improbable.
MANY: Final = 3000

#: Largest chi2 of the best mode of exact points, with `SHARP_PIXELS`: noise of a pixel leaves some 30.
EXACT_CHI2: Final = 0.05

#: Factor on the deviations of image points, relative deviation added to lengths, and largest chi2 of the solve that
#: finds why a frame is empty.
LOOSE_TIMES, LOOSE_LENGTHS, LOOSE_CHI2 = 20.0, 0.1, 1e3

#: Standard deviations from which a residual explains an empty frame, and residuals that are named.
NAMED_DEVIATIONS, MOST_NAMED = 3.0, 3

#: Rejected leaves of a frame in which nothing is grown.
LOST: Final = {"root/not_known": 8192}

#: Difference in depth below which neither end of a segment is nearer.
LEVEL_METRES: Final = 1e-6


class Chosen(NamedTuple):
    """Rows of the survivors of one frame that are listed, the likeliest first, and what is left out."""

    rows: NDArray[np.intp]
    probability: Array
    rejected: Counter[str]
    unlisted: int
    unlisted_probability: float


def recover(
    view: View,
    settings: RecoverSettings | None = None,
    *,
    figure: Figure | None = None,
    **changes: Any,
) -> Recovery:
    """Recover every posture behind a view that passes the checks.

    The result of a frame depends on that frame alone, unless `RecoverSettings.clip_lengths` asks for one set of lengths
    from all frames.

    Parameters
    ----------
    view : View
    settings : RecoverSettings, optional
    figure : Figure, optional
        The built-in one by default; the view's own lengths, stature and head points are applied to it.
    **changes
        Fields of `RecoverSettings` that differ from `settings`.

    Raises
    ------
    InputError
        If a setting has no meaning for such a view, or the view contradicts itself.

    Examples
    --------
    >>> import posekit
    >>> from posekit.recovery.conductor import recover
    >>> len(recover(posekit.builtin_view("seq1"), contact_margin=0.01))
    5
    """
    settings = (settings or RecoverSettings()).changed(**changes)
    person = person_of(view, settings, figure)
    lengths = uncertainty_of(view, settings, own_figure=figure is not None)
    conductor = _Conductor(view, settings, person, lengths)
    found: list[Found] = []
    block = EXACT_FRAMES_AT_ONCE if conductor.sight.may_be_exact else FRAMES_AT_ONCE
    for start in watched(range(0, len(view), block), "recovering"):
        part = np.arange(start, min(start + block, len(view)))
        found += conductor.frames(part)
    recovery = gathered(view, conductor.sight, person, found, conductor.document(), conductor.tolerances())
    if settings.clip_lengths and len(recovery.survivors):
        measured = _clip_lengths(recovery)
        whole = replace(view, lengths=measured, stature=None, length_deviation=CLIP_DEVIATION)
        again = settings.changed(clip_lengths=False, stature=None, length_deviation=None, follow=0)
        recovery = recover(whole, again, figure=figure)
        recovery = replace(recovery, settings={**recovery.settings, "clip_lengths": True})
    if settings.follow:
        from importlib import import_module

        # Following is a layer above this one; it is loaded only if a path is wanted.
        recovery = import_module("posekit.following").follow(recovery, paths=settings.follow)
    return recovery


#: Relative deviation of lengths that were estimated from the frames of a clip.
CLIP_DEVIATION: Final = 0.02


def _clip_lengths(recovery: Recovery) -> dict[str, float]:
    """Return the lengths of one person over all frames: medians over the survivors nearest to the answers."""
    nearest = np.asarray(recovery.answer.survivor)
    return segment_lengths(recovery.survivors.joints[nearest[nearest >= 0]])


class _Conductor:
    """What is the same for all frames of a view: person, noise, checks, and the way up."""

    def __init__(
        self, view: View, settings: RecoverSettings, person: Figure, lengths: LengthUncertainty
    ) -> None:
        self.view, self.settings, self.person = view, settings, person
        self.sight: Sight = sight_of(view, person, settings, lengths)
        self.photograph = isinstance(view.camera, ScaledOrthographicCamera)
        self.lengths = np.array([person.lengths[name] for name in SEGMENT_NAMES])
        self.given = settings.tolerance(PHOTOGRAPH if self.photograph else MEASURED)
        if self.given is not None and settings.refine:
            raise refusal("", "refine", "tolerances beside it", "one of them", "leave the tolerances out")
        self.up = _up_of(view)
        hands = [settings.nearer] if isinstance(settings.nearer, Mapping) else list(settings.nearer or [])
        if len(hands) not in (0, 1, len(view)):
            raise refusal(
                "", "nearer", f"{len(hands)} frames", f"{len(view)}, or one for all", "give one a frame"
            )
        flips = np.zeros((1, len(SEGMENTS)), dtype=np.int8)
        if hands:
            from posekit.recovery.objects import read_nearer

            flips = np.array([read_nearer(figure_linkage(person), hand) for hand in hands])
        self.nearer = np.broadcast_to(flips, (len(view), len(SEGMENTS)))
        self.lengths_known = lengths
        self.exact = Certifier(person, settings, self.given or EXACT, self.up.direction)

    @cached_property
    def noisy(self) -> Certifier:
        """The checks under noise: with wider tolerances, and a torso whose side uncertain lengths may leave open."""
        known = self.lengths_known
        contact = noisy_contact(self.settings.contact_margin, known, photograph=self.photograph)
        loose = noisy_tolerance(self.person, known, sized=self.photograph)
        figure, settings = sided(self.person, known), self.settings.changed(contact_margin=contact)
        return Certifier(figure, settings, loose, self.up.direction)

    @cached_property
    def limits(self) -> Limits | None:
        """Joint ranges that pull at the solver's postures."""
        return solver_limits(self.person, self.exact)

    @cached_property
    def pull(self) -> Callable[[Array], Array] | None:
        """Residuals of the checks that have some; None if none has."""
        pulling = [check.residuals for check in self.noisy.checks if hasattr(check, "residuals")]
        if not pulling:
            return None
        return lambda joints: np.concatenate([residuals(joints) for residuals in pulling], axis=1)

    def frames(self, part: NDArray[np.intp]) -> list[Found]:
        """Recover some frames: exactly where points are exact, else with the tolerance given, else under noise."""
        sight = self.sight
        rows = np.flatnonzero(np.isin(sight.frame, part))
        open_ = {int(k) for k in part if not sight.reasons[k]}
        done: dict[int, Found] = {}
        whole = np.asarray(np.isfinite(sight.root).all(axis=1) & np.isfinite(sight.image).all(axis=(1, 2)))
        ready = rows[whole[rows]]
        if self.given is not None:
            self._grown(ready, self.given, "tolerated", done)
            for k in open_ - set(done):
                done[k] = Found({}, None, LOST, "tolerated", "its neck is not known, or a joint is not seen")
        elif sight.may_be_exact:
            self._grown(ready, EXACT, "exact", done)
            if self.settings.refine is False:
                for k in open_ - set(done):
                    done[k] = Found({}, None, {}, "exact", "no posture is exact")
            left = rows[~np.isin(sight.frame[rows], list(done))]
            if not self.photograph:
                self._solved(left, done, sharp=True)
        left = rows[[int(k) in open_ and int(k) not in done for k in sight.frame[rows]]]
        self._solved(left, done, sharp=False)
        return [
            done[k] if k in done else Found({}, None, LOST, "", sight.reasons[k] or "no posture fits")
            for k in part.tolist()
        ]

    def _grown(
        self, rows: NDArray[np.intp], tolerance: Tolerance, judged: str, done: dict[int, Found]
    ) -> None:
        """Grow the exact tree of some rows; frames without an exact posture are left open."""
        if not len(rows):
            return
        sight = self.sight.take(rows)
        trees: Trees = grow(
            sight.camera,
            sight.image,
            sight.root,
            self.lengths,
            self.exact.early,
            judge=self.exact.judge,
            head=sight.head,
            tolerance=tolerance.tangent,
        )
        frame, head = sight.frame[trees.frame], sight.head[trees.frame]
        verdict = self.exact.certify(trees.joints, head)
        terms = log_terms(
            trees.joints,
            deviation=deviation_of_tolerance(tolerance.rigid),
            lengths=self.lengths,
            length_residual=trees.length_residual,
            up=self.up,
        )
        score = np.sum(list(terms.values()), axis=0)
        columns: dict[str, Any] = {
            "joints": trees.joints,
            "head": head,
            "branch": np.array(trees.branches, dtype=np.str_),
            "scale": self._scale(sight, trees.frame),
        }
        for k in np.unique(sight.frame).tolist():
            own = np.flatnonzero(frame == k)
            hypotheses = np.flatnonzero(sight.frame == k).tolist()
            lost: Counter[str] = Counter()
            for h in hypotheses:
                lost.update(trees.rejected[h])
            if judged == "exact" and not self._closes(trees.joints[own], lost):
                continue
            chosen = self._chosen(k, own, columns, score, verdict)
            chosen.rejected.update(lost)
            levels = trees.levels[hypotheses].sum(axis=0).tolist()
            done[k] = self._found(k, chosen, columns, verdict, judged, None)._replace(levels=levels)

    def _closes(self, joints: Array, lost: Mapping[str, int]) -> bool:
        """Tell whether some branch closes torso and hips exactly, which only exact image points do."""
        if "rigid-parts" in [check.name for check in self.exact.checks]:
            return bool(len(joints)) or any(
                not name.startswith(("rigid-parts/", "no-solution/")) for name in lost
            )
        start, end = np.array(RIGID_SEGMENTS).T
        off = np.linalg.norm(joints[:, start] - joints[:, end], axis=2) - self.lengths[-len(RIGID_SEGMENTS) :]
        return bool((np.abs(off) <= 10 * EXACT.rigid).all(axis=1).any())

    def _solved(self, rows: NDArray[np.intp], done: dict[int, Found], *, sharp: bool) -> None:
        """Solve some rows under noise; `sharp` treats points and lengths as exact, and leaves empty frames open."""
        if not len(rows):
            return
        frames = np.unique(self.sight.frame[rows])
        if len(frames) > FRAMES_AT_ONCE:
            for at in range(0, len(frames), FRAMES_AT_ONCE):
                part = np.isin(self.sight.frame[rows], frames[at : at + FRAMES_AT_ONCE])
                self._solved(rows[part], done, sharp=sharp)
            return
        sight = self.sight.take(rows)
        problem = self._problem(sight, sharp=sharp)
        modes = solve(problem, most=MANY, pull=self.pull)
        if sharp:
            least = np.full(len(problem), np.inf)
            np.minimum.at(least, modes.frame, modes.chi2)
            modes = modes.take(((least < EXACT_CHI2) & (problem.freedom > 0))[modes.frame])
        frame, joints, scale = sight.frame[modes.frame], modes.joints, self._scale(sight, modes.frame)
        if self.photograph:
            joints, scale = from_near(joints, _middle(sight)[modes.frame], scale)
        head = np.full((len(joints), len(HEAD_POINTS), 3), np.nan)
        verdict = self.noisy.certify(joints, head)
        volume = modes.log_evidence + 0.5 * modes.chi2
        score = np.sum(
            list(log_terms(joints, chi2=modes.chi2, log_volume=volume, up=self.up).values()), axis=0
        )
        hidden = np.asarray(~np.isfinite(self.view.image[frame]).all(axis=2))
        columns: dict[str, Any] = {
            "joints": joints if self.settings.infer else np.where(hidden[..., None], np.nan, joints),
            "head": head,
            "chi2": modes.chi2,
            "inferred": hidden,
            "scale": scale,
        }
        solved = np.unique(frame).tolist()
        chosen = [self._chosen(k, np.flatnonzero(frame == k), columns, score, verdict) for k in solved]
        rows = np.concatenate([one.rows for one in chosen]) if chosen else np.empty(0, dtype=np.intp)
        covariance, start = modes.covariance(rows), 0
        if self.photograph:
            # A larger person farther away gives the same picture.
            x = self.lengths_known.common * modes.x[rows, :-1]
            covariance = covariance + x[:, :, None] * x[:, None]
        for k, one in zip(solved, chosen, strict=True):
            own, start = covariance[start : start + len(one.rows)], start + len(one.rows)
            if len(one.rows) or not sharp:
                done[k] = self._found(k, one, columns, verdict, "noisy", own)
        empty = [] if sharp else np.setdiff1d(sight.frame, frame).tolist()
        if empty:
            some = np.flatnonzero(np.isin(sight.frame, empty))
            strict = problem.take(some)
            loose = replace(
                strict,
                length_deviation=strict.length_deviation + LOOSE_LENGTHS,
                whitening=strict.whitening / LOOSE_TIMES,
            )
            # The nearest posture of loose points and lengths is measured with the stated deviations.
            nearest = replace(solve(loose, max_chi2=LOOSE_CHI2, most=1), problem=strict)
            owner = sight.frame[some][nearest.frame]
            for k in empty:
                why = self._why(nearest.take(np.flatnonzero(owner == k)[:1]))
                done[k] = Found({}, None, {"noise/no_mode": 1}, "noisy", why)

    def _problem(self, sight: Sight, *, sharp: bool) -> Problem:
        """Lay the problem of some rows out for the solver."""
        problem = Problem.seen(
            sight.camera,
            sight.image,
            SHARP_PIXELS * sight.deviation if sharp else sight.deviation,
            lengths=self.lengths,
            length_deviation=0.0 if sharp else sight.lengths.deviations,
            size_deviation=0.0 if sharp or self.photograph else sight.size_deviation,
            root=None if self.photograph else np.where(sight.given[:, None], sight.root, np.nan),
            limits=self.limits,
            robust=bool(self.view.derived) and not self.photograph,
        )
        return (
            from_usual_distance(problem, _middle(sight), sight.size_deviation) if self.photograph else problem
        )

    def _chosen(
        self, k: int, own: NDArray[np.intp], columns: Mapping[str, Any], score: Array, verdict: Certificate
    ) -> Chosen:
        """Choose the survivors of a frame among its postures, and list those that hold the coverage."""
        rejected = Counter(verdict.reason[row] for row in own.tolist() if verdict.reason[row])
        valid = own[verdict.valid[own]]
        rows = valid
        if self.nearer[k].any():
            rows = valid[self._by_hand(columns["joints"][valid], k)]
        if len(rows) < len(valid):
            rejected["nearer/given"] += len(valid) - len(rows)
        probability = softmax(score[rows], np.zeros(len(rows), dtype=np.intp))
        order = np.argsort(-probability, kind="stable")
        most = len(rows)
        if "chi2" in columns and most:
            held = np.cumsum(probability[order])
            most = min(int(np.searchsorted(held, self.settings.coverage - 1e-12)) + 1, most)
        listed, rest = order[:most], order[most:]
        return Chosen(rows[listed], probability[listed], rejected, len(rest), float(probability[rest].sum()))

    def _found(
        self,
        k: int,
        chosen: Chosen,
        columns: Mapping[str, Any],
        verdict: Certificate,
        judged: str,
        covariance: Array | None,
    ) -> Found:
        """Gather the survivors of a frame, with its answer."""
        rows, probability, rejected, unlisted, rest = chosen
        if not len(rows):
            worst = max(rejected, key=lambda name: rejected[name], default="")
            return Found(
                {}, None, rejected, judged, f"no posture passes: most fail {worst.replace('/', ' at ')}"
            )
        count = len(rows)
        table: dict[str, Any] = {"chi2": np.zeros(count), "branch": np.full(count, "")}
        table |= {
            "radius": np.zeros((count, len(JOINTS))),
            "inferred": np.zeros((count, len(JOINTS)), np.bool_),
        }
        table |= {name: values[rows] for name, values in columns.items()} | {"probability": probability}
        margins = {name: values[rows] for name, values in verdict.margins.items()}
        given = bool(self.sight.given[self.sight.frame == k].all())
        answer = answer_of(
            table["joints"],
            probability,
            covariance,
            self.lengths if covariance is None else self._answer_lengths(table["joints"], probability),
            relative=self.photograph or (covariance is not None and not given),
            unlisted=rest,
        )
        if covariance is not None:
            block = covariance.reshape(-1, len(JOINTS), 3, len(JOINTS), 3)
            if self.photograph:
                # There is no place in space: radii are about the middle of the joints.
                block = block - block.mean(axis=1, keepdims=True)
                block = block - block.mean(axis=3, keepdims=True)
            table["radius"] = joint_radius(np.einsum("njajb->njab", block))
        if self.settings.group is not None:
            table["group"] = group_of(table["joints"], self.settings.group)
        return Found(table, answer, rejected, judged, "", (), unlisted, rest, margins)

    def _answer_lengths(self, joints: Array, probability: Array) -> Array:
        """Return the lengths of the answer: the person's, in the mean size of the survivors."""
        start, end = np.array(TREE_SEGMENTS).T
        each = np.log(np.linalg.norm(joints[:, start] - joints[:, end], axis=2) / self.lengths[: len(start)])
        size = np.nan_to_num(each).mean(axis=1) @ (probability / probability.sum())
        return np.asarray(self.lengths * np.exp(size))

    def _by_hand(self, joints: Array, k: int) -> NDArray[np.bool_]:
        """Tell which postures have the flips that were given by hand for a frame."""
        start, end = np.array(SEGMENTS).T
        ahead = (joints[:, end, 2] - joints[:, start, 2]) * self.nearer[k]
        return np.asarray(~(ahead < -LEVEL_METRES).any(axis=1))

    def _scale(self, sight: Sight, rows: NDArray[np.intp]) -> Array:
        if not isinstance(sight.camera, ScaledOrthographicCamera):
            return np.full(len(rows), np.nan)
        return np.asarray(sight.camera.scale)[rows]

    def _why(self, nearest: Modes) -> str:
        """Say why a frame has no posture: the residuals of the nearest one that are over three deviations."""
        if not len(nearest):
            return (
                "no posture is near the image points: the camera, the lengths or left and right may be wrong"
            )
        size = {name: float(value[0]) for name, value in nearest.residuals().items()}
        named = sorted((name for name in size if size[name] > NAMED_DEVIATIONS), key=lambda name: -size[name])
        if not named:
            return "every posture is less likely than 1 in 10,000 by chi-square: give a larger --deviation"
        words = ", ".join(f"{name} by {size[name]:.1f} deviations" for name in named[:MOST_NAMED])
        return f"no posture fits: the nearest misses {words}"

    def document(self) -> dict[str, Any]:
        """Return everything that decided the result, as JSON values."""
        return {
            **self.settings.to_json(),
            "checks": [check.name for check in self.exact.checks],
            "figure": self.person.hash,
            "moved_lengths": dict(self.person.moved_lengths),
            "shoulders": self.person.shoulder_side,
            "up": self.up.source,
            "prior": "people",
            "derived": list(self.view.derived),
            "versions": versions(),
        }

    def tolerances(self) -> dict[str, Any]:
        """Return the tolerances of exact and tolerated frames, and the noise of the others where there are any."""
        lengths = self.sight.lengths
        found: dict[str, Any] = {"exact": vars(EXACT)}
        if self.given is not None:
            found["tolerated"] = vars(self.given)
        if "noisy" in vars(self):
            found["noisy"] = {
                "deviation": float(np.nanmedian(self.sight.deviation)),
                "size": lengths.common,
                "by_segment": dict(lengths.own),
                "certified": vars(self.noisy.tolerance),
                "contact_margin": self.noisy.settings.contact_margin,
            }
        return found


def _middle(sight: Sight) -> Array:
    """Return the middle of the trunk's image points (H, 2) before a scaled orthographic camera, metres."""
    return np.asarray(np.nanmean(sight.camera.normalize(sight.image)[:, :6], axis=1))


@cache
def versions() -> dict[str, str]:
    """Return the versions of the packages that decide a result."""
    return {"posekit": posekit.__version__, "pin": pinocchio.__version__, "numpy": np.__version__}


def _up_of(view: View) -> Up:
    """Return the direction against gravity: as the calibration states it, else as if the camera were level."""
    camera = view.camera
    if isinstance(camera, PinholeCamera) and camera.R is not None and camera.up:
        axis = np.eye(3)["xyz".index(camera.up[1])] * (-1.0 if camera.up[0] == "-" else 1.0)
        return Up(direction=camera.R @ axis, source=f"{camera.up}, as the calibration source")
    return Up.level()
