"""Limbs judged by anatomical ranges: limits, couplings, and every way to write a limb."""

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pinocchio as pin
import pytest

from posekit.body import load_figure
from posekit.skeleton import DOFS, HEAD, JOINT, POINTS, SIDES
from posekit.tree import Check
from posekit.validators import Ranges, Validator, joint_range, load_ranges
from posekit.validators.anatomical import Anatomy, Side
from posekit.validators.anatomical_shoulder import elevation_and_plane, turn_offset

FIGURE = load_figure()
MODEL = FIGURE.model
TABLE = load_ranges("anatomical").of(FIGURE)
assert TABLE.anatomy is not None
ANATOMY: Anatomy = TABLE.anatomy
CHECKS = joint_range(FIGURE, TABLE)
ARMS = tuple(f"{side}_shoulder.{angle}" for side in SIDES for angle in ("flexion", "abduction"))
PLACES = {*DOFS, "right_shoulder.elevation", "left_shoulder.elevation"} - set(ARMS)
GENERIC = {
    "neck": (5.0, 3.0, 4.0),
    "pelvis": (20.0, 3.0, 4.0),
    "shoulder": (25.0, 10.0, 8.0),
    "elbow": (60.0,),
    "hip": (10.0, 6.0, 5.0),
    "knee": (70.0,),
}
"""Degrees at which no other way to write the posture is inside the limits."""


def configurations(angles: np.ndarray) -> np.ndarray:
    """Stand figures with these angles (N, 22), degrees, somewhere."""
    q = np.tile(pin.neutral(FIGURE.model), (len(angles), 1))
    q[:, :3] = [0.2, -0.1, 4.0]
    q[:, 3:7] = np.array([0.3, -0.5, 0.7, 0.2]) / np.linalg.norm([0.3, -0.5, 0.7, 0.2])
    q[:, FIGURE.angle_index] = np.radians(angles)
    return q


def angles_of(changes: dict[str, float]) -> np.ndarray:
    flat = [GENERIC[joint.split("_")[-1]] for joint in dict.fromkeys(dof.split(".")[0] for dof in DOFS)]
    angles = dict(zip(DOFS, [angle for joint in flat for angle in joint], strict=True))
    return np.array([list((angles | changes).values())])


def posture(changes: dict[str, float]) -> np.ndarray:
    return FIGURE.forward_kinematics(configurations(angles_of(changes)))


def judged(points: np.ndarray, checks: list[Check] = CHECKS) -> dict[str, tuple[bool, float, float]]:
    """Return the verdict, value and margin of the last check of each place."""
    result: dict[str, tuple[bool, float, float]] = {}
    for check in checks:
        findings = check.judge(points[:, check.points])
        margin = np.broadcast_to(findings.margin, findings.value.shape)
        for k, where in enumerate(check.where):
            result[where] = (bool(findings.violated[0, k]), float(findings.value[0, k]), float(margin[0, k]))
    return result


def rejected(points: np.ndarray, checks: list[Check] = CHECKS) -> np.ndarray:
    return np.asarray(np.any([c.judge(points[:, c.points]).violated.any(axis=1) for c in checks], axis=0))


def other_side(name: str) -> str:
    side, _, rest = name.partition("_")
    return {"right": "left", "left": "right"}[side] + "_" + rest if rest else name


def wrapped(degrees: float) -> float:
    return (degrees + 180.0) % 360.0 - 180.0


def inside(angle: float, lower: float, upper: float) -> bool:
    middle = (lower + upper) / 2
    return lower <= middle + wrapped(angle - middle) <= upper


def legal_limb(joint: str, angles: tuple[float, float, float, float]) -> bool:
    """Judge a limb once more, number by number: is some way to write it inside all limits and couplings."""
    a, b, g, e = angles
    hinge = "elbow" if joint == "shoulder" else "knee"
    k = ANATOMY.spreads

    def end(coupled: str, side: Side, of: float) -> float:
        (coupling,) = ANATOMY.couplings_of(coupled, side)
        mean, spread = ANATOMY.coupled(coupling, np.array(of))
        return float(mean) + (k if side == "upper" else -k) * spread

    def ends(name: str, flexion: float) -> tuple[float, float, float]:
        """Limits of an angle of the hip, and the middle between its means."""
        motion = ANATOMY.motions[f"hip.{name}"]
        (lower, below), (upper, above) = motion.end("lower"), motion.end("upper")
        if name == "rotation":
            (coupling,) = ANATOMY.couplings_of("hip.rotation")
            mean, spread = ANATOMY.coupled(coupling, np.array(flexion))
            lower, limit = max(lower, float(mean)), max(lower - k * below, float(mean) - k * spread)
        else:
            limit = lower - k * below
        return limit, upper + k * above, (lower + upper) / 2

    def looks_turned(bend: float) -> tuple[float, float]:
        """How far a rotation reads too low and too high where the lower segment stands off the hinge's plane."""
        read = [0.0, 0.0]
        for side, outward in (("upper", 1), ("lower", -1)):
            at, squarely = (max(outward * end(f"{hinge}.valgus", side, of), 0.0) for of in (bend, 90.0))  # type: ignore[arg-type]
            share = np.sin(np.radians(at)) / max(abs(np.sin(np.radians(bend))), 1e-12)
            turn = max(np.degrees(np.arcsin(min(share, 1.0))) - squarely, 0.0)
            # Valgus of a bent arm looks like external rotation, of a bent leg like internal.
            inward = (outward * bend > 0) == (joint == "hip")
            read[inward] += turn
        return read[0], read[1]

    def in_sinus(ball: tuple[float, float, float], bend: float) -> bool:
        (sinus,) = ANATOMY.sinuses
        p, used = sinus.power, 0.0
        for name, angle in zip(("flexion", "abduction", "rotation"), ball, strict=True):
            lower, upper, middle = ends(name, ball[0])
            off = middle + wrapped(angle - middle) - middle
            reach = (upper - middle) if off > 0 else (middle - lower)
            free = looks_turned(bend)[off > 0] if name == "rotation" else 0.0
            if abs(off) > reach * max(1.0 - used, 0.1**p) ** (1 / p) + free:
                return False
            used += (abs(off) / reach) ** p
        return True

    for a1, b1, g1 in ((a, b, g), (a + 180, 180 - b, g + 180)):
        for g2, e2 in ((g1, e), (g1 + 180, -e)):
            if joint == "shoulder":
                elevation, plane = (float(x[0]) for x in elevation_and_plane(np.array([a1]), np.array([b1])))
                turn = g2 + float(turn_offset(np.array([a1]), np.array([b1]))[0])
                below, above = (end("shoulder.turn", side, elevation) for side in ("lower", "upper"))
                low, high = looks_turned(e2)
                middle = (below + above) / 2
                turn = middle + wrapped(turn - middle)
                ball = elevation <= end("shoulder.elevation", "upper", plane)
                ball = ball and below - low <= turn <= above + high
            else:
                middle = float(np.mean(TABLE.limits["right_hip.flexion"]))
                ball = in_sinus((middle + wrapped(a1 - middle), b1, g2), e2)
                ball = ball and wrapped(a1) <= end("hip.flexion", "upper", e2)
            if ball and inside(e2, *TABLE.limits[f"right_{hinge}.flexion"]):
                return True
    return False


def test_every_angle_is_judged_and_an_arms_direction_by_its_elevation() -> None:
    assert {where for check in CHECKS for where in check.where} == PLACES
    verdicts = judged(posture({}))
    assert not any(bad for bad, _, _ in verdicts.values())
    for dof, angle in zip(DOFS, angles_of({})[0], strict=True):
        assert dof in ARMS or verdicts[dof][1] == pytest.approx(angle, abs=1e-6)


# Shoulders and hips are bounded by couplings and a sinus, below.
PLAIN = [
    (dof, end) for dof in DOFS for end in ("lower", "upper") if "shoulder" not in dof and "hip" not in dof
]


def middle(dof: str) -> float:
    """Return the middle between the means of an angle's ends, where a sinus takes nothing from the others."""
    (lower, _), (upper, _) = (ANATOMY.motion(dof).end(side) for side in ("lower", "upper"))
    return (lower + upper) / 2


@pytest.mark.parametrize(("dof", "end"), PLAIN)
@pytest.mark.parametrize(
    ("outside", "passes"), [(-0.01, True), (0.0, True), (0.0005, True), (0.003, False), (1, False)]
)
def test_each_limit_just_passes_and_just_fails(dof: str, end: str, outside: float, passes: bool) -> None:
    lower, upper = TABLE.limits[dof]
    angle = upper + outside if end == "upper" else lower - outside
    verdicts = judged(posture({dof: angle}))
    bad, value, margin = verdicts.pop(dof)
    assert bad == (not passes)
    assert value == pytest.approx(angle, abs=1e-6)
    assert margin == pytest.approx(-outside, abs=1e-6)
    assert not any(bad for bad, _, _ in verdicts.values())


@pytest.mark.parametrize("side", SIDES)
@pytest.mark.parametrize("name", ["hip.flexion", "hip.abduction", "hip.rotation"])
@pytest.mark.parametrize("end", ["lower", "upper"])
@pytest.mark.parametrize(("outside", "passes"), [(-0.01, True), (0.0005, True), (0.003, False), (1, False)])
def test_each_end_of_the_hip_is_reached_where_the_other_angles_are_in_the_middle(
    side: str, name: str, end: Side, outside: float, passes: bool
) -> None:
    outward = 1 if end == "upper" else -1
    changes = {f"{side}_hip.{angle}": middle(f"{side}_hip.{angle}") for angle in ("flexion", "abduction")}
    limit = TABLE.limits[f"{side}_{name}"][end == "upper"]
    flexion = limit if name == "hip.flexion" else changes[f"{side}_hip.flexion"]
    (outward_end,) = ANATOMY.couplings_of("hip.rotation", "lower")
    lower = float(ANATOMY.coupled(outward_end, np.array(flexion))[0])
    changes[f"{side}_hip.rotation"] = (lower + ANATOMY.motions["hip.rotation"].end("upper")[0]) / 2
    changes[f"{side}_knee.flexion"] = 90.0
    for coupling in ANATOMY.couplings_of(name, end):
        if coupling.of == "hip.flexion":
            mean, spread = ANATOMY.coupled(coupling, np.array(changes[f"{side}_hip.flexion"]))
            limit = outward * min(outward * limit, outward * float(mean) + ANATOMY.spreads * spread)
    changes[f"{side}_{name}"] = limit + outward * outside
    verdicts = judged(posture(changes))
    bad, value, margin = verdicts.pop(f"{side}_{name}")
    assert bad == (not passes)
    assert value == pytest.approx(limit + outward * outside, abs=1e-6)
    assert margin == pytest.approx(-outside, abs=1e-6)
    assert not any(bad for bad, _, _ in verdicts.values())


HIP_POSTURES = {
    "sitting cross-legged (Ganokroj et al. 2021)": ((90.0, 28.9, -62.0), 120.0, True),
    "squatting (Ganokroj et al. 2021)": ((99.7, 15.0, -10.0), 130.0, True),
    "sitting, turned inward (Kouyoumdjian et al. 2012)": ((90.0, 0.0, 37.9), 90.0, True),
    "lying prone, turned inward (Kouyoumdjian et al. 2012)": ((0.0, 0.0, 35.2), 90.0, True),
    "lying prone, turned outward (Kouyoumdjian et al. 2012)": ((0.0, 0.0, -41.8), 90.0, True),
    "standing on one leg, the other abducted": ((0.0, 45.9, 0.0), 5.0, True),
    "pushing off in a run": ((-20.0, -5.0, 8.0), 30.0, True),
    "every end at once": ((120.0, 48.0, 36.0), 120.0, False),
    "every other end at once": ((-25.0, -26.0, -41.0), 60.0, False),
    "high flexion, adducted and turned inward: bone meets bone (Han et al.)": ((118, -25, 35), 120.0, False),
}
"""The clinic's flexion, abduction and rotation, the knee, and whether people do it."""


@pytest.mark.parametrize("name", HIP_POSTURES)
def test_the_hips_sinus_holds_what_people_do_and_no_corner(name: str) -> None:
    ball, knee, possible = HIP_POSTURES[name]
    zero = ANATOMY.motions["hip.flexion"].zero.mean
    changes = {
        "left_hip.flexion": ball[0] + zero,
        "left_hip.abduction": ball[1],
        "left_hip.rotation": ball[2],
    }
    bent = posture(changes | {"left_knee.flexion": knee})
    assert rejected(bent)[0] == (not possible)
    if not possible:  # and it is the sinus that says so
        box = replace(TABLE, anatomy=replace(ANATOMY, sinuses=()))
        assert not rejected(bent, joint_range(FIGURE, box))[0]


def test_a_hip_near_one_end_has_less_left_of_the_others() -> None:
    limits = []
    for flexion in (80.0, 100.0, 115.0, 121.0):
        points = posture(
            {"right_hip.flexion": flexion, "right_hip.abduction": 0.0, "right_knee.flexion": 90.0}
        )
        check = next(c for c in CHECKS if c.where[:1] == ("right_hip.flexion",) and len(c.where) == 4)
        findings = check.judge(points[:, check.points])
        lower, upper = (np.broadcast_to(x, (1, 4))[0] for x in (findings.lower, findings.upper))
        limits.append((upper - lower)[1:3])
    assert (np.diff(limits, axis=0) < 0).all()


@pytest.mark.parametrize("knee", [0.5, 5.0, 24.0, 40.0])
@pytest.mark.parametrize("side", SIDES)
def test_the_straighter_the_knee_the_less_the_hip_flexes(side: str, knee: float) -> None:
    (coupling,) = ANATOMY.couplings_of("hip.flexion", "upper")
    mean, spread = ANATOMY.coupled(coupling, np.array(knee))
    upper = float(mean) + ANATOMY.spreads * spread
    assert upper < TABLE.limits[f"{side}_hip.flexion"][1]
    for outside in (-0.01, 0.01, 5.0):
        changes = {f"{side}_hip.flexion": upper + outside, f"{side}_knee.flexion": knee}
        changes |= {f"{side}_hip.abduction": middle(f"{side}_hip.abduction")}
        verdicts = judged(posture(changes))
        bad, _, margin = verdicts.pop(f"{side}_hip.flexion")
        assert bad == (outside > 0)
        assert margin == pytest.approx(-outside, abs=1e-6)
        assert not any(bad for bad, _, _ in verdicts.values())


def test_a_high_kick_with_a_straight_knee_is_not_possible_and_a_crouch_is() -> None:
    kick = {"right_hip.flexion": 100.0, "right_knee.flexion": 0.0}
    assert judged(posture(kick))["right_hip.flexion"][0]
    assert not rejected(posture(kick | {"right_knee.flexion": 120.0}))[0]
    assert not rejected(posture(kick), joint_range(FIGURE))[0]


@pytest.mark.parametrize("abduction", [0.0, 45.0, 89.9, 90.0])
@pytest.mark.parametrize("end", ["lower", "upper"])
@pytest.mark.parametrize("side", SIDES)
def test_in_the_frontal_plane_the_turn_ends_where_goniometers_say(
    side: str, end: Side, abduction: float
) -> None:
    (coupling,) = ANATOMY.couplings_of("shoulder.turn", end)
    mean, spread = ANATOMY.coupled(coupling, np.array(abduction))
    outward = 1 if end == "upper" else -1
    limit = float(mean) + outward * ANATOMY.spreads * spread
    for outside in (-0.01, 0.01, 20.0):
        changes = {
            f"{side}_shoulder.flexion": 0.0,
            f"{side}_shoulder.abduction": abduction,
            f"{side}_shoulder.rotation": limit + outward * outside,
            f"{side}_elbow.flexion": 90.0,
        }
        verdicts = judged(posture(changes))
        bad, _, margin = verdicts.pop(f"{side}_shoulder.rotation")
        assert bad == (outside > 0)
        assert margin == pytest.approx(-outside, abs=1e-5)
        assert not any(bad for bad, _, _ in verdicts.values())


def test_an_arm_held_sideways_is_turned_no_further_however_its_angles_are_written() -> None:
    # At the pole flexion and rotation turn about one line: a box of limits passes any turn.
    turn = 130.0
    held = [posture({"right_shoulder.flexion": a, "right_shoulder.abduction": 90.0,
                     "right_shoulder.rotation": turn + a, "right_elbow.flexion": 90.0})
            for a in (-60.0, 0.0, 50.0, 170.0)]  # fmt: skip
    for points in held:
        np.testing.assert_allclose(points, held[0], atol=1e-9)
        assert judged(points)["right_shoulder.rotation"][0]
    box = Ranges(name="box", kind="configuration", limits=TABLE.limits)
    assert not judged(held[0], joint_range(FIGURE, box))["right_shoulder.rotation"][0]


def test_how_far_an_arm_is_raised_depends_on_the_plane() -> None:
    for plane in (180.0, 150.0, 135.0, 110.0, -20.0, -45.0, -70.0):
        (coupling,) = ANATOMY.couplings_of("shoulder.elevation")
        mean, spread = ANATOMY.coupled(coupling, np.array(plane))
        upper = float(mean) + ANATOMY.spreads * spread
        for outside in (-1.0, 1.0):
            p, e = np.radians([plane, upper + outside])
            abduction = np.degrees(np.arcsin(np.sin(e) * np.sin(p)))
            flexion = np.degrees(np.arctan2(np.sin(e) * np.cos(p), np.cos(e)))
            points = posture({"left_shoulder.flexion": flexion, "left_shoulder.abduction": abduction})
            points[:, JOINT["left_wrist"]] = np.nan
            verdicts = judged(points)
            bad, value, margin = verdicts.pop("left_shoulder.elevation")
            assert bad == (outside > 0)
            assert not any(bad for bad, _, _ in verdicts.values())
            assert (value, margin) == pytest.approx((upper + outside, -outside), abs=1e-6)


def test_verdicts_are_those_of_every_writing_tried_one_by_one() -> None:
    rng = np.random.default_rng(7)
    angles = np.repeat(angles_of({}), 1500, axis=0)
    right = [k for k, dof in enumerate(DOFS) if dof.startswith("right_")]
    angles[:, right] = rng.uniform(-180, 180, (len(angles), len(right)))
    # Half of them near the limits, where the verdict changes.
    limits = np.array([TABLE.limits[DOFS[k]] for k in right])
    near = limits[None, :, :].repeat(750, axis=0)
    pick = rng.random((750, len(right)))
    angles[:750, right] = near[..., 0] + (pick * 1.1 - 0.05) * (near[..., 1] - near[..., 0])
    points = FIGURE.forward_kinematics(configurations(angles))
    for joint in ("shoulder", "hip"):
        row = DOFS.index(f"right_{joint}.flexion")
        checks = [c for c in CHECKS if c.where[0].startswith(f"right_{joint}.")]
        found = ~rejected(points, checks)
        expected = [legal_limb(joint, tuple(map(float, limb))) for limb in angles[:, row : row + 4]]  # type: ignore[arg-type]
        assert 100 < found.sum() < 1400
        assert found.tolist() == expected


def some_postures(n: int, rng: np.random.Generator) -> np.ndarray:
    """Draw postures with right and left limbs anywhere a little beyond their limits."""
    limits = np.array([TABLE.limits[dof] for dof in DOFS])
    middle, half = limits.mean(axis=1), np.ptp(limits, axis=1) / 2
    return FIGURE.forward_kinematics(configurations(middle + rng.uniform(-1.1, 1.1, (n, 22)) * half))


def test_the_upper_segment_alone_never_rejects_what_the_whole_limb_passes(rng: np.random.Generator) -> None:
    q = configurations(rng.uniform(-180, 180, (3000, 22)))
    points = FIGURE.forward_kinematics(q)
    for part, whole in zip(CHECKS[2::2], CHECKS[3::2], strict=True):
        early = part.judge(points[:, part.points]).violated.any(axis=1)
        late = whole.judge(points[:, whole.points]).violated.any(axis=1)
        assert (late | ~early).all()
        assert early.any()


def test_the_verdict_does_not_depend_on_where_the_person_stands(rng: np.random.Generator) -> None:
    here = some_postures(1000, rng)
    turn = np.linalg.qr(rng.normal(size=(3, 3)))[0]
    turn *= np.sign(np.linalg.det(turn))
    there = here @ turn.T + rng.normal(size=3)
    np.testing.assert_array_equal(rejected(here), rejected(there))
    assert 50 < rejected(here).sum() < 990


def test_right_and_left_are_mirror_images(rng: np.random.Generator) -> None:
    points = some_postures(1000, rng)
    swapped = [POINTS.index(other_side(point)) for point in POINTS]
    mirrored = points[:, swapped] * [1.0, -1.0, 1.0]
    for check in CHECKS[2:]:
        where = tuple(other_side(name) for name in check.where)
        other = next(c for c in CHECKS if c.where == where)
        a, b = check.judge(points[:, check.points]), other.judge(mirrored[:, other.points])
        worst = [np.fmin.reduce(findings.margin, axis=1) for findings in (a, b)]
        np.testing.assert_allclose(worst[0], worst[1], atol=1e-6)
        np.testing.assert_array_equal(a.violated, b.violated)


@pytest.mark.parametrize("bend", [0.0, 1e-4, 0.05, 1.0, 20.0])
def test_a_looser_tolerance_never_rejects_more(rng: np.random.Generator, bend: float) -> None:
    angles = rng.uniform(-90, 90, (500, 22))
    for side in SIDES:
        for hinge in ("elbow", "knee"):
            angles[:, DOFS.index(f"{side}_{hinge}.flexion")] = bend
    points = FIGURE.forward_kinematics(configurations(angles))
    verdicts = [
        rejected(points, joint_range(FIGURE, TABLE, tolerance=t)) for t in (0.0, 1e-3, 0.1, 1.0, 10.0)
    ]
    for strict, loose in pairwise(verdicts):
        assert (strict | ~loose).all()


def test_more_spreads_never_reject_more(rng: np.random.Generator) -> None:
    points = some_postures(1000, rng)
    verdicts = []
    for spreads in (0.0, 0.5, 1.0, 2.0, 4.0):
        anatomy = replace(ANATOMY, spreads=spreads)
        wider = Ranges(name="wider", kind="configuration", limits=anatomy.limits(), anatomy=anatomy)
        verdicts.append(rejected(points, joint_range(FIGURE, wider)))
    for strict, loose in pairwise(verdicts):
        assert (strict | ~loose).all()
        assert strict.sum() > loose.sum()


@pytest.mark.parametrize("elbow", [0.0, 1e-9, 1e-6])
@pytest.mark.parametrize("rotation", [-170.0, -90.0, 0.0, 100.0, 180.0])
def test_a_straight_limb_may_be_turned_by_anything(rotation: float, elbow: float) -> None:
    changes = {"right_shoulder.rotation": rotation, "right_elbow.flexion": elbow}
    verdicts = judged(posture(changes))
    assert not any(bad for bad, _, _ in verdicts.values())
    assert np.isnan(verdicts["right_shoulder.rotation"][1])


def test_a_little_hyperextension_is_human_and_a_backward_bend_is_not() -> None:
    for hinge, ball in (("elbow", "shoulder"), ("knee", "hip")):
        lower = TABLE.limits[f"left_{hinge}.flexion"][0]
        assert lower < -3
        assert not rejected(posture({f"left_{hinge}.flexion": lower + 1.0}))[0]
        assert rejected(posture({f"left_{hinge}.flexion": lower - 20.0}))[0], ball


@pytest.mark.parametrize("missing", POINTS)
def test_a_missing_point_never_rejects_and_leaves_something_undecided(missing: str) -> None:
    points = posture({}).repeat(3, axis=0)
    k = POINTS.index(missing)
    points[:, k] = np.nan
    for check in CHECKS:
        findings = check.judge(points[:, check.points])
        assert not findings.violated.any()
        if k in check.points:
            assert findings.undecided.any(axis=1).all()


def test_with_the_ankle_missing_the_thigh_is_still_judged() -> None:
    points = posture({"right_hip.abduction": TABLE.limits["right_hip.abduction"][0] - 10})
    points[:, JOINT["right_ankle"]] = np.nan
    verdicts = judged(points)
    assert verdicts["right_hip.abduction"][0]
    assert np.isnan(verdicts["right_knee.flexion"][1])
    # Without the knee's angle the hamstrings say nothing.
    kick = posture({"right_hip.flexion": 100.0, "right_knee.flexion": 0.0})
    kick[:, JOINT["right_ankle"]] = np.nan
    assert not rejected(kick)[0]


def test_segments_of_no_length_are_undecided() -> None:
    points = posture({})
    points[:, JOINT["right_wrist"]] = points[:, JOINT["right_elbow"]]
    points[:, JOINT["left_knee"]] = points[:, JOINT["left_hip"]]
    points[:, HEAD] = np.nan
    verdicts = judged(points)
    assert np.isnan(verdicts["right_elbow.flexion"][1])
    assert np.isnan(verdicts["left_hip.flexion"][1])
    assert not any(bad for bad, _, _ in verdicts.values())


def test_an_empty_batch_is_judged() -> None:
    for check in CHECKS:
        findings = check.judge(np.empty((0, len(check.points), 3)))
        assert findings.violated.shape == (0, len(check.where))


def test_configurations_are_judged_as_the_postures_they_give() -> None:
    """Couplings are no limits of single angles: q alone must not slip past them."""
    rng = np.random.default_rng(8)
    lower, upper = (np.degrees(limit[7:]) for limit in (MODEL.lowerPositionLimit, MODEL.upperPositionLimit))
    q = np.tile(pin.neutral(MODEL), (200, 1))
    q[:, 7:] = np.radians(rng.uniform(0.7 * lower, 0.7 * upper, size=(200, len(lower))))
    validator = Validator(ranges="anatomical", checks=("joint-range",), strict=True)
    of_q = validator.check(q=q).verdicts
    points = FIGURE.forward_kinematics(q)
    assert of_q == validator.check(points[:, :14], points[:, 14:]).verdicts
    assert {"valid", "invalid"} <= set(of_q)
