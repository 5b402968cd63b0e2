r"""Comparison with Lee & Chen 1985: the binary tree (§3.1), and the counts of survivors in Tables 3 and 4 (§4).

Lee & Chen do not print the walker's speed, its lean, and the gait phase of frame 1. A setting is one choice of these
three values, and survivors are counted at each setting of a grid. Each printed count is compared with the counts at all
settings, and with the count at the closest setting. At the closest setting, all counts together are most similar to the
printed counts.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cache
from itertools import product
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from posekit.body import load_figure
from posekit.cameras import LeeChenCamera, View
from posekit.cameras.head import TABLE_A2, solve_pose
from posekit.geometry import Array
from posekit.papers.lee_chen_camera import F
from posekit.papers.lee_chen_constraints import body_of
from posekit.papers.rows import Row, printed, row
from posekit.settings import Tolerance
from posekit.skeleton import JOINT, JOINTS, PARENTS, RIGID_SEGMENTS, SEGMENT_NAMES, SIDES
from posekit.synthesis import Walker, builtin_view, random_postures, walker_view
from posekit.synthesis.views import PAPER_STEP, SEQUENCES
from posekit.tree import Trees, ancestors, grow
from posekit.validators.check import Check, Judgement
from posekit.validators.collision import Collision
from posekit.validators.joint_range import JointRange
from posekit.validators.rigid_parts import RigidParts
from posekit.validators.walking import WalkingRules

#: Settings of the walker: speeds (leg lengths/s) of mid gait, additional leans (degrees) up to the lean of the gait
#: model, and number of phases of frame 1.
GRIDS: Final = {
    "quick": (np.linspace(0.5, 1.3, 5), np.linspace(-4.0, 4.0, 5), 20),
    "fine": (np.linspace(0.5, 1.3, 9), np.linspace(-4.0, 4.0, 9), 100),
}

#: Allowed error of distances inside the torso. The paper prints no value. With 1 cm, nearly frontal torsos stay
#: ambiguous, as in the paper.
RIGID_METRES: Final = 0.01

TANGENT_METRES: Final = 0.001
#: Allowed shortfall of a segment relative to its image, metres, in the tables and in the comparison of the shoulders.
LOOSE_TANGENT_METRES: Final = 0.01

#: Largest distance of any joint from the representative of its group (§3.4); the paper does not print it.
GROUP_METRES: Final = 0.05

#: Largest distance of a joint between the input and a survivor that counts as the input.
SAME_METRES: Final = 1e-6

#: Distance of a body from the camera at which every wrong start of a segment still reaches the next ray, metres.
FAR_METRES: Final = 1e5

#: Percentiles of the counts over all settings; counts between them are usual.
PERCENTILES: Final = (5.0, 95.0)


@dataclass(frozen=True, kw_only=True, eq=False)
class Walks:
    """Counts of survivors of one sequence of Lee & Chen at S settings of the walker.

    Parameters
    ----------
    name : str
        ``seq1`` or ``seq2``.
    settings : array (S, 3)
        Velocity (leg lengths/s), lean (degrees), phase of frame 1 (cycles).
    levels : int array (S, 2, 3, 14)
        Number of nodes at each of the 14 levels of the tree, in frames 1, 3 and 5: after the physical checks, and after
        walking rules 1 and 2 as well.
    final : int array (S, 2)
        Number of groups of similar survivors in frame 1, after Rules 1 and 2, and after Rules 1 to 5.
    truth : bool array (S,)
        Whether the true posture of frame 1 survives Rules 1 to 5.
    """

    name: str
    settings: Array
    levels: NDArray[np.int64]
    final: NDArray[np.int64]
    truth: NDArray[np.bool_]

    @property
    def cells(self) -> NDArray[np.int64]:
        """Computed counts at each setting (S, 86), in the order of the printed counts."""
        return np.concatenate([self.levels.reshape(len(self.levels), -1), self.final], axis=1)

    @property
    def theirs(self) -> NDArray[np.int64]:
        """The printed counts (86,)."""
        given = printed()["lee_chen"]
        tables = [np.ravel(given[kind][self.name]) for kind in ("physical", "motion")]
        return np.concatenate([*tables, given["final"][self.name][1:]])

    @property
    def distance(self) -> Array:
        """Distance (S,) of each setting from the printed counts: sum of ``|log2(count / printed)|`` over all counts."""
        # A count of zero is replaced by half a survivor, so that its logarithm is finite.
        return np.asarray(np.abs(np.log2(np.maximum(self.cells, 0.5) / self.theirs)).sum(axis=1))


def walk_rows(effort: str = "quick") -> Iterator[Row]:
    """Yield a `Row` for each comparison with §3.1 and §4; `effort` ``fine`` has about 16 times as many settings."""
    walks = [count_walks(name, effort) for name in SEQUENCES]
    chosen = closest(effort)
    setting = walks[0].settings[chosen]
    yield from _tree_rows(setting)
    yield _shoulders_row(sequence("seq2", setting))
    for one in walks:
        yield from _table_rows(one, chosen)
    yield from _remark_rows(walks, chosen, effort)
    for one in walks:
        yield _deciding_row(one.name, setting)


def closest(effort: str = "quick") -> int:
    """Return the index of the setting with the smallest sum of distances (`Walks.distance`) over both sequences."""
    return int(np.argmin(np.sum([count_walks(name, effort).distance for name in SEQUENCES], axis=0)))


@cache
def count_walks(name: str, effort: str = "quick", tangent: float = TANGENT_METRES) -> Walks:
    """Count the survivors of a sequence at all settings of the grid of an effort.

    Parameters
    ----------
    name : {"seq1", "seq2"}
        The sequence of Lee & Chen 1985, §4; each has its own camera position.
    effort : {"quick", "fine"}
        Key of `GRIDS`.
    tangent : float
        Largest gap between the end of a segment and the ray of its image point if the segment is too short, metres.
    """
    velocities, leans, phases = GRIDS[effort]
    parts = [_counted(name, v, lean, phases, tangent) for v, lean in product(velocities, leans)]
    settings, levels, final, truth = (np.concatenate(each) for each in zip(*parts, strict=True))
    return Walks(name=name, settings=settings, levels=levels, final=final, truth=truth)


def _counted(
    name: str, velocity: float, lean: float, phases: int, tangent: float
) -> tuple[NDArray[Any], ...]:
    """Return the four arrays of `Walks` for all phases of a walker with one velocity and lean."""
    walker = Walker(velocity=velocity, lean=float(np.radians(lean)))
    cycle = walker.cycle_duration
    levels = np.zeros((phases, 2, 3, len(JOINTS)), dtype=np.int64)
    final, truth = np.zeros((phases, 2), dtype=np.int64), np.zeros(phases, dtype=bool)
    for k, frame in enumerate(printed()["lee_chen"]["frames"]):
        # One view holds frame `frame` of the sequences of all phases.
        start = (frame - 1) * PAPER_STEP / cycle
        view = walker_view(walker, camera=SEQUENCES[name][0], frames=phases, dt=cycle / phases, phase0=start)
        trees, head = grown(view, tangent)
        kept = allowed(trees, head, (1, 2))
        levels[:, 0, k] = trees.levels
        levels[:, 1, k] = ancestors(trees.frame[kept], trees.code[kept], phases)
        if frame == 1:
            left = kept & allowed(trees, head, (3, 4, 5))
            away = np.linalg.norm(trees.joints - view.truth[trees.frame], axis=-1).max(axis=1)
            for phase in range(phases):
                own = trees.frame == phase
                final[phase] = [len(representatives(trees.joints[own & some])) for some in (kept, left)]
                truth[phase] = (away[own & left] < SAME_METRES).any()
    settings = np.array([(velocity, lean, phase / phases) for phase in range(phases)])
    return settings, levels, final, truth


def grown(view: View, tangent: float = TANGENT_METRES, *, pruned: bool = True) -> tuple[Trees, Array]:
    """Compute each frame's tree of postures by Lee & Chen's method; return the trees and head points (F, 5, 3).

    The torso is checked only by distances between its joints, so that its mirror image passes, too. Joint angles are
    checked with the ranges ``table1-printed``.
    """
    image = np.concatenate([view.image[:, :1], view.head_image], axis=1)
    pose = solve_pose(TABLE_A2, image, LeeChenCamera(f=None))
    trees = grow(
        LeeChenCamera(f=pose.f),
        view.image,
        pose.points_cam[:, 0],
        np.array([load_figure().lengths[name] for name in SEGMENT_NAMES]),
        physical_checks() if pruned else [],
        judge=_judged,
        head=pose.points_cam[:, 1:],
        tolerance=tangent,
    )
    return trees, pose.points_cam[:, 1:]


@cache
def physical_checks() -> Sequence[Check]:
    """Return the checks of Lee & Chen's §3.2, one for each part of the body, so that they prune the tree early."""
    distances = [RigidParts(segments=(segment,), torso=False) for segment in RIGID_SEGMENTS]
    return [*distances, *JointRange().parts, *Collision().parts]


def _judged(check: Check, points: Array) -> Judgement:
    tolerance = Tolerance(rigid=RIGID_METRES, tangent=TANGENT_METRES)
    return check.judge(body_of(points, tolerance, ranges="table1-printed", walkers="paper-printed"))


def allowed(trees: Trees, head: Array, rules: Sequence[int]) -> NDArray[np.bool_]:
    """Return whether each survivor (N,) passes Lee & Chen's walking rules (§3.3), with thresholds ``paper-printed``."""
    points = np.concatenate([trees.joints, head[trees.frame]], axis=1)
    return np.asarray(~_judged(WalkingRules(rules=tuple(rules)), points).violated.any(axis=1))


def representatives(joints: Array) -> list[int]:
    """Return indices of representatives: each posture (N, 14, 3) is within `GROUP_METRES` of one of them (§3.4)."""
    left, found = np.arange(len(joints)), []
    while len(left):
        found.append(int(left[0]))
        left = left[np.linalg.norm(joints[left] - joints[left[0]], axis=-1).max(axis=1) > GROUP_METRES]
    return found


def sequence(name: str, setting: Array) -> View:
    """Return the view with the five frames of a sequence at one setting (velocity, lean, phase)."""
    velocity, lean, phase = setting.tolist()
    walker = Walker(velocity=velocity, lean=float(np.radians(lean)))
    return walker_view(walker, camera=SEQUENCES[name][0], phase0=phase)


def _tree_rows(setting: Array) -> Iterator[Row]:
    yield row("leaves", f"2^13 = {2**13}", False)
    view = builtin_view("seq1").take([0])
    trees, _ = grown(view, pruned=False)
    truth, worst = view.truth[0], 0.0
    rays = truth / truth[:, 2:]
    for joint in range(1, len(JOINTS)):
        ray, length = rays[joint], np.linalg.norm(truth[joint] - truth[PARENTS[joint]])
        for parent, end in np.unique(trees.joints[:, [PARENTS[joint], joint]], axis=0):
            roots = np.roots([ray @ ray, -2 * ray @ parent, parent @ parent - length**2]).real
            worst = max(worst, float(np.abs(np.outer(roots, ray) - end).max(axis=1).min()))
    yield row("spheres", f"{worst:.0e} m off at most", worst < SAME_METRES, n=len(trees.frame))
    figure = load_figure()
    points = figure.forward_kinematics(random_postures(figure, 1, np.random.default_rng(1985), "urdf"))
    far = points[:, : len(JOINTS)] + [0.0, 0.0, FAR_METRES]
    lengths = np.array([figure.lengths[name] for name in SEGMENT_NAMES])
    camera = LeeChenCamera(f=F)
    count = len(grow(camera, camera.project(far), far[:, 0], lengths, []).frame)
    yield row("paths", f"{count} leaves at level 13", count == 2**13, far=FAR_METRES / 1000)
    first = sequence("seq1", setting).take([0])
    (pruned, _), (whole, head) = grown(first), grown(first, pruned=False)
    every = np.concatenate([whole.joints, head[whole.frame]], axis=1)
    broken = [_judged(check, every).violated.any(axis=1) for check in physical_checks()]
    kept = ~np.any(broken, axis=0)
    ours, brute = (
        " ".join(map(str, ancestors(frame, code, 1)[0]))
        for frame, code in ((pruned.frame, pruned.code), (whole.frame[kept], whole.code[kept]))
    )
    yield row("pruning", f"{ours} nodes a level", ours == brute, n=len(kept), found=brute)


def _shoulders_row(view: View) -> Row:
    """Count the pairs of shoulder candidates (near or far) in SEQ2, frame 1, that have the known shoulder width."""
    truth, lengths = view.truth[0], printed()["lee_chen"]["lengths"]
    places = []
    for joint in (1, 2):
        ray, length = truth[joint] / truth[joint, 2], lengths[f"neck-{JOINTS[joint]}"] / 100
        roots = np.roots([ray @ ray, -2 * ray @ truth[0], truth[0] @ truth[0] - length**2]).real
        places.append([root * ray for root in roots])
    pairs = np.array(list(product(*places)))
    apart = np.linalg.norm(pairs[:, 0] - pairs[:, 1], axis=1)
    kept = pairs[np.abs(apart - lengths["right_shoulder-left_shoulder"] / 100) < RIGID_METRES]
    true = bool((np.abs(kept - truth[1:3]).max(axis=(1, 2), initial=0) < SAME_METRES).any())
    here = f"{len(kept)} of {len(pairs)} have it, {'the input' if true else 'not the input'} among them"
    return row("shoulders", here, true and len(kept) < len(pairs), within=100 * RIGID_METRES)


def _table_rows(walks: Walks, chosen: int) -> Iterator[Row]:
    """Yield a row for each tree level in Table 3 or 4, and for each pruning step of §4.2."""
    name, columns = walks.name.upper(), np.arange(2 * 3 * len(JOINTS)).reshape(6, -1)
    table = f"Table {'3' if walks.name == 'seq1' else '4'} ({name})"
    for level, joint in enumerate(JOINTS):
        key = f"level-{walks.name}-shoulders" if level in (1, 2) else "level"
        place = {"table": table, "level": level, "joint": joint.replace("_", " ")}
        yield _count_row(key, walks, chosen, columns[:, level], place)
    for step, column in (
        ("Rules 1-2", columns[3, -1]),
        ("grouped (Figs. 6 to 8)", columns.size),
        ("Rules 3-5", columns.size + 1),
    ):
        yield _count_row("final", walks, chosen, np.array([column]), {"sequence": name, "step": step})


def _count_row(key: str, walks: Walks, chosen: int, columns: NDArray[np.intp], place: dict[str, Any]) -> Row:
    """Compare printed counts with the closest setting; the verdict is "differs" if a count is outside `PERCENTILES`."""
    theirs, cells = walks.theirs[columns], walks.cells[:, columns]
    ours = cells[chosen]
    low, high = np.percentile(cells, PERCENTILES, axis=0, method="inverted_cdf")
    usual = bool(((low <= theirs) & (theirs <= high)).all())
    return row(
        key,
        _in_columns(ours.tolist()),
        bool((ours == theirs).all()) or None if usual else False,
        counts=_in_columns(theirs.tolist()),
        below=_in_columns([f"{share:.0%}" for share in (cells < theirs).mean(axis=0)]),
        equal=_in_columns([f"{share:.0%}" for share in (cells == theirs).mean(axis=0)]),
        **place,
    )


def _in_columns(values: Sequence[Any]) -> str:
    """Write counts as text: frames 1, 3, 5 after the physical checks, then after walking rules 1 and 2 as well."""
    half = len(values) // 2
    return "; ".join(" / ".join(map(str, part)) for part in (values[:half], values[half:]) if len(part))


def _remark_rows(walks: Sequence[Walks], chosen: int, effort: str) -> Iterator[Row]:
    """Compare Lee & Chen's remarks in §4.1.B and §4.2 with the counts at all settings."""
    pelvis, left, wrist = JOINT["pelvis"], JOINT["left_shoulder"], JOINT["right_wrist"]
    given = printed()["lee_chen"]
    for one in walks:
        alone = one.levels[:, 0, :, pelvis] == one.levels[:, 0, :, left]
        table = np.array(given["physical"][one.name])
        theirs = (table[:, pelvis] == table[:, left]).mean()
        here = f"in {alone.mean():.0%} of the frames of all settings"
        yield row("pelvis", here, bool(alone.all()), sequence=one.name.upper(), theirs=theirs)
    torsos = [float(one.levels[:, 0, :, pelvis].mean()) for one in walks]
    yield row(
        "torsos", f"{torsos[1]:.2f} torsos are left in SEQ2, {torsos[0]:.2f} in SEQ1", torsos[1] < torsos[0]
    )
    nodes = walks[0].levels[:, 0, 0]
    part = nodes[:, wrist] / np.maximum(nodes[:, wrist - 1], 1)
    share = ((part > 1) & (part < 2)).mean()
    yield row("wrist", f"between one and two times in {share:.0%} of the settings", None)
    for name, joint in (("elbows", JOINT["right_elbow"]), ("knees", JOINT["right_knee"])):
        same = [(one.levels[:, 1, :, joint] == one.levels[:, 1, :, joint + 1]).mean(axis=0) for one in walks]
        here = ", ".join("/".join(f"{share:.0%}" for share in each) for each in same) + " of the settings"
        theirs = ", ".join(
            "/".join(
                "yes" if levels[joint] == levels[joint + 1] else "no" for levels in given["motion"][one.name]
            )
            for one in walks
        )
        yield row("pairs", here, None, name=name, theirs=theirs)
    tight, loose = nodes[:, left], count_walks("seq1", effort, LOOSE_TANGENT_METRES).levels[:, 0, 0, left]
    beyond = np.array([_beyond(setting) for setting in walks[0].settings])
    shares = (tight == 4).mean(), (loose == 4).mean()
    here = f"4 nodes in {shares[0]:.0%} of the settings with 1 mm allowed, in {shares[1]:.0%} with 1 cm"
    most, over = 1000 * beyond.max(), (beyond > TANGENT_METRES).mean()
    yield row("shoulder-nodes", here, bool((tight == 4).all()), most=most, share=over)
    for one in walks:
        here = f"{'yes' if one.truth[chosen] else 'no'} at the closest setting"
        yield row("input", here, bool(one.truth[chosen]), sequence=one.name.upper(), share=one.truth.mean())


def _beyond(setting: Array) -> Array:
    r"""Return the gap (2,), metres, between each elbow's ray and the reach of the wrong shoulder in SEQ1, frame 1.

    The elbow is on a ray with unit direction d, at the length l of the upper arm from the shoulder S. It does not exist
    if the distance of S from the ray, :math:`|S - (S \cdot d) d|`, exceeds l.
    """
    points, beyond = sequence("seq1", setting).truth[0], []
    for side in SIDES:
        shoulder, elbow = points[JOINT[f"{side}_shoulder"]], points[JOINT[f"{side}_elbow"]]
        ray, line = (each / np.linalg.norm(each) for each in (shoulder, elbow))
        # Both shoulder candidates lie on one ray, symmetric about the foot of the perpendicular from the neck.
        other = (2 * (points[JOINT["neck"]] @ ray) - shoulder @ ray) * ray
        beyond.append(np.linalg.norm(other - (other @ line) * line) - np.linalg.norm(elbow - shoulder))
    return np.array(beyond)


def _deciding_row(name: str, setting: Array) -> Row:
    """Count how many survivors of walking rules 1 and 2 in frame 1 are rejected by rule 3, by rule 4 and by rule 5."""
    trees, head = grown(sequence(name, setting).take([0]))
    kept = allowed(trees, head, (1, 2))
    rejected = [int((kept & ~allowed(trees, head, (rule,))).sum()) for rule in (3, 4, 5)]
    here = f"of {int(kept.sum())} survivors Rules 3, 4 and 5 reject {', '.join(map(str, rejected))}"
    return row(f"decides-{name}", here, None)
