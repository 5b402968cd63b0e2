"""Any articulated object: brute force over flips and scales, and random objects with truth."""

import itertools

import numpy as np
import pytest

import posekit
from posekit.recovery.objects import (
    Linkage,
    LinkageFamily,
    linkage_names,
    load_linkage,
    name_nearer,
    parse_scale,
    read_nearer,
    recover_object,
    search,
)
from posekit.recovery.objects.linkage import linkage_of_robot
from posekit.robots import Robot


def chain(lengths, **about):
    names = [f"p{k}" for k in range(len(lengths) + 1)]
    return Linkage.from_names(
        name="chain", segments=dict(zip(itertools.pairwise(names), lengths, strict=True)), **about
    )


def tetrahedron(rng):
    """A rigid body of four points with a rod at one of them."""
    points = rng.normal(size=(5, 3))
    pairs = [*itertools.combinations(range(4), 2), (3, 4)]
    segments = {(f"p{a}", f"p{b}"): float(np.linalg.norm(points[a] - points[b])) for a, b in pairs}
    return Linkage.from_names(name="body", points=[f"p{k}" for k in range(5)], segments=segments), points


def four_bar(rng):
    """A closed chain of four bars, bent out of its plane."""
    points = rng.normal(size=(4, 3))
    pairs = [(0, 1), (1, 2), (2, 3), (0, 3)]
    segments = {(f"p{a}", f"p{b}"): float(np.linalg.norm(points[a] - points[b])) for a, b in pairs}
    return Linkage.from_names(name="bars", points=[f"p{k}" for k in range(4)], segments=segments), points


@pytest.mark.parametrize("name", linkage_names())
def test_built_in_linkages_load(name):
    linkage = load_linkage(name)
    assert len(linkage.lengths) == len(linkage.segments) > 2


@pytest.mark.parametrize("seed", range(5))
def test_foreshortening_is_taylors_equation(seed):
    rng = np.random.default_rng(seed)
    linkage, points = four_bar(rng)
    s = 80.0
    family = LinkageFamily(linkage=linkage, image=points[:, :2] * s)
    ends = np.array(linkage.segments)
    depth = np.abs(points[ends[:, 1], 2] - points[ends[:, 0], 2])
    np.testing.assert_allclose(family.foreshortening(s), depth, atol=1e-9)
    assert s >= family.minimum_scale * (1 - 1e-12)
    flips = family.flips_of(points)
    np.testing.assert_allclose(family.points(s, flips), points - [0, 0, points[0, 2]], atol=1e-9)
    with pytest.raises(posekit.InputError, match=r"which .* needs"):
        family.foreshortening(0.9 * family.minimum_scale)


@pytest.mark.parametrize("seed", range(6))
def test_search_finds_what_brute_force_finds(seed):
    linkage, points = four_bar(np.random.default_rng(seed))
    family = LinkageFamily(linkage=linkage, image=points[:, :2] * 80.0)
    found = search(family, {"closure": 1.0})
    # Residual of every flip on a fine grid of scales: loops close where the depths sum to zero.
    s = family.minimum_scale / np.cos(np.linspace(0, np.pi / 2 - 0.01, 20_000))
    dZ = family.foreshortening(s)
    around = np.array([1.0, 1.0, 1.0, -1.0])
    for flips in itertools.product((-1.0, 1.0), repeat=3):
        gap = (dZ * np.array([1.0, *flips]) * around).sum(axis=1)
        for k in np.flatnonzero(np.diff(np.sign(gap)) != 0):
            exact = found.s[found.residual < 1e-20]
            assert np.abs(exact / s[k] - 1).min() < 1e-2
    assert np.abs(found.s[found.residual < 1e-20] / 80.0 - 1).min() < 1e-9
    assert (np.diff(found.residual) > -1e-20).all()


@pytest.mark.parametrize("seed", range(4))
def test_the_truth_is_recovered_by_closure(seed):
    linkage, points = tetrahedron(np.random.default_rng(seed))
    found = recover_object(linkage, [points[:, :2] * 50.0], scale="closure")
    true = points - points[0]
    shifted = found.points - found.points[:, :1]
    assert np.abs(shifted - true).max(axis=(1, 2)).min() < 1e-6
    assert found.frames[0]["judged"] == "exact"
    # Every posture has the lengths and the image.
    ends = np.array(linkage.segments)
    apart = np.linalg.norm(found.points[:, ends[:, 1]] - found.points[:, ends[:, 0]], axis=2)
    np.testing.assert_allclose(apart, np.broadcast_to(linkage.lengths, apart.shape), atol=1e-5)
    image = found.points[..., :2] * found.scale[:, None, None]
    np.testing.assert_allclose(image, np.broadcast_to(points[:, :2] * 50.0, image.shape), atol=1e-6)


CHANGES = ("larger", "another unit", "mirrored", "turned", "moved", "another order")


def changed_object(linkage, image, change):
    """Return names, segments, image and the map of postures (N, P, 3) that a change makes."""
    names, order = list(linkage.points), np.arange(len(linkage.points))
    moved, lengths = (lambda points: points), np.array(linkage.lengths)
    if change == "larger":  # the object is the same, the picture larger: the scale alone changes
        image = 3 * image
    elif change == "another unit":
        lengths, moved = 1000 * lengths, (lambda points: 1000 * points)
    elif change == "mirrored":
        image, moved = image * [-1, 1], (lambda points: points * [-1, 1, 1])
    elif change == "turned":
        image, moved = image @ [[0, 1], [-1, 0]], (lambda points: points @ [[0, 1, 0], [-1, 0, 0], [0, 0, 1]])
    elif change == "moved":
        image = image + np.array([300.0, -200.0])
    else:
        order = np.random.default_rng(1).permutation(len(names))
        image, moved = image[order], (lambda points: points[:, order])
    segments = {
        tuple(names[end] for end in ends): length
        for ends, length in zip(linkage.segments, lengths.tolist(), strict=True)
    }
    return [names[k] for k in order], segments, image, moved


@pytest.mark.parametrize("change", CHANGES)
@pytest.mark.parametrize("kind", ["min", "closure"])
@pytest.mark.parametrize("make", [tetrahedron, four_bar])
def test_postures_of_an_object_move_with_it(make, kind, change):
    linkage, points = make(np.random.default_rng(2))
    image = points[:, :2] * 50.0
    names, segments, seen, moved = changed_object(linkage, image, change)
    first = recover_object(linkage, [image], scale=kind)
    other = recover_object(
        Linkage.from_names(name="other", points=names, segments=segments), [seen], scale=kind
    )
    assert len(first.points) == len(other.points) > 0

    def centred(one):
        return one - one.mean(axis=1, keepdims=True)

    expected, found = centred(moved(first.points)), centred(other.points)
    size = np.abs(expected).max()
    apart = np.abs(expected[:, None] - found[None]).max(axis=(2, 3))
    assert apart.min(axis=0).max() < 1e-5 * size and apart.min(axis=1).max() < 1e-5 * size
    factor = {"larger": 3.0, "another unit": 1e-3}.get(change, 1.0)
    np.testing.assert_allclose(np.sort(other.scale), np.sort(first.scale) * factor, rtol=1e-6)
    rejected = [sum(one.frames[0]["rejected"].values()) for one in (first, other)]
    assert rejected[0] == rejected[1]


def test_survivors_and_rejected_are_all_flips():
    linkage, points = tetrahedron(np.random.default_rng(7))
    found = recover_object(linkage, [points[:, :2] * 50.0], scale=50.0)
    free = 1 << (len(linkage.points) - 1)
    assert len(found.points) + sum(found.frames[0]["rejected"].values()) == free


def test_noise_keeps_the_truth():
    rng = np.random.default_rng(3)
    linkage, points = tetrahedron(rng)
    size = float(linkage.lengths.max())
    image = (points[:, :2] + 0.003 * size * rng.normal(size=(5, 2))) * 50.0
    found = recover_object(linkage, [image], scale=50.0, tolerance=(0.02 * size, 0.02 * size))
    assert found.frames[0]["judged"] == "given"
    off = np.abs((found.points - found.points[:, :1]) - (points - points[0])).max(axis=(1, 2))
    assert off.min() < 0.3 * size


def flat_linkage(points, kind):
    """Return the chain through points in a plane, with the constraint that they satisfy."""
    names = [f"p{k}" for k in range(len(points))]
    segments = {
        pair: float(np.linalg.norm(points[k + 1] - points[k]))
        for k, pair in enumerate(itertools.pairwise(names))
    }
    shape = {
        "coplanar": {"coplanar": [names]},
        "perpendicular": {"perpendicular": [("p0-p1", "p1-p2")]},
        "collinear": {"collinear": [names[::2]]},
    }[kind]
    return Linkage.from_names(name="flat", segments=segments, points=names, **shape)


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize("kind", ["coplanar", "collinear", "perpendicular"])
def test_noise_keeps_the_truth_of_a_shape(kind, seed):
    rng = np.random.default_rng(seed)
    flat = np.array([[0, 0, 0], [3, 0, 0], [3, 2, 0], [1, 4, 0], [0.5, 2, 0]], dtype=float)
    if kind == "collinear":
        flat = np.array([[0, 0, 0], [1, 1, 0], [2, 0, 0], [3, 2, 0], [4, 0, 0]], dtype=float)
    points = flat @ np.linalg.qr(rng.normal(size=(3, 3)))[0].T
    linkage = flat_linkage(points, kind)
    size = float(linkage.lengths.max())
    image = (points[:, :2] + 0.002 * size * rng.normal(size=(5, 2))) * 50.0
    found = recover_object(linkage, [image], scale=50.0, tolerance=(0.02 * size, 0.02 * size))
    exact = recover_object(linkage, [points[:, :2] * 50.0], scale=50.0)
    true = points - points[0]
    for one, within in ((found, 0.35 * size), (exact, 1e-6)):
        off = np.abs(one.points - one.points[:, :1] - true).max(axis=(1, 2))
        assert off.min() < within


def test_human_of_taylor_has_its_flips():
    human = load_linkage("taylor_human")
    rng = np.random.default_rng(0)
    points = np.zeros((12, 3))
    index = {name: k for k, name in enumerate(human.points)}
    middle = {"mid_shoulders": np.zeros(3)}
    step = rng.normal(size=(20, 3))
    step /= np.linalg.norm(step, axis=1)[:, None]
    size = dict(zip(human.segment_names, human.lengths, strict=True))
    middle["mid_hips"] = 24 * step[0]
    for k, (name, half) in enumerate((("shoulder", 9), ("hip", 7))):
        centre = middle[f"mid_{name}s"]
        points[index[f"right_{name}"]], points[index[f"left_{name}"]] = (
            centre + half * step[k + 1],
            centre - half * step[k + 1],
        )
    k = 3
    for start, end in (("shoulder", "elbow"), ("elbow", "wrist"), ("hip", "knee"), ("knee", "ankle")):
        for side in ("right", "left"):
            a, b = f"{side}_{start}", f"{side}_{end}"
            points[index[b]] = points[index[a]] + size[f"{a}-{b}"] * step[k]
            k += 1
    found = recover_object(human, [points[:, :2] * 10.0], scale=10.0)
    assert len(found.points) == 2048
    true = points - points[0]
    assert np.abs(found.points - found.points[:, :1] - true).max(axis=(1, 2)).min() < 1e-9


def test_flips_by_hand_leave_one_posture():
    linkage = chain([5.0, 3.0, 4.0])
    rng = np.random.default_rng(5)
    step = rng.normal(size=(3, 3))
    step *= linkage.lengths[:, None] / np.linalg.norm(step, axis=1)[:, None]
    points = np.concatenate([np.zeros((1, 3)), np.cumsum(step, axis=0)])
    family = LinkageFamily(linkage=linkage, image=points[:, :2] * 20.0)
    hand = name_nearer(linkage, family.flips_of(points))
    np.testing.assert_array_equal(read_nearer(linkage, hand, 1)[0], family.flips_of(points))
    found = recover_object(linkage, [points[:, :2] * 20.0], scale=20.0, nearer=hand)
    assert len(found.points) == 1
    np.testing.assert_allclose(found.points[0], points, atol=1e-9)


@pytest.mark.parametrize("kind", ["coplanar", "perpendicular", "collinear"])
def test_shape_fixes_the_scale(kind):
    rng = np.random.default_rng(11)
    flat = np.array([[0, 0, 0], [3, 0, 0], [3, 2, 0], [1, 4, 0], [0.5, 2, 0]], dtype=float)
    if kind == "collinear":
        flat = np.array([[0, 0, 0], [1, 1, 0], [2, 0, 0], [3, 2, 0], [5, 0, 0]], dtype=float)
    R, _ = np.linalg.qr(rng.normal(size=(3, 3)))
    points = flat @ R.T
    linkage = flat_linkage(points, kind)
    found = search(LinkageFamily(linkage=linkage, image=points[:, :2] * 30.0), {kind: 1.0})
    assert np.abs(found.s[found.residual < 1e-18] / 30.0 - 1).min() < 1e-6


def test_a_hidden_point_leaves_the_rest():
    linkage, points = tetrahedron(np.random.default_rng(2))
    image = points[:, :2] * 50.0
    image[4] = np.nan
    found = recover_object(linkage, [image], scale=50.0)
    assert np.isnan(found.points[:, 4]).all() and np.isfinite(found.points[:, :4]).all()


@pytest.mark.parametrize(
    ("segments", "message"),
    [
        ({("a", "b"): 1.0, ("c", "d"): 1.0}, "connected"),
        ({("a", "b"): 1.0, ("b", "c"): 1.0, ("a", "c"): 3.0}, "loop that closes"),
        ({("a", "b"): -1.0}, "positive length"),
    ],
)
def test_impossible_objects_are_refused(segments, message):
    with pytest.raises(posekit.InputError, match=message):
        Linkage.from_names(name="x", segments=segments)


def test_points_are_those_that_segments_name(tmp_path):
    rod = Linkage.from_names(name="rod", segments={"a-b": 5.0, "b-c": 3.0})
    assert rod.points == ("a", "b", "c") and rod.segment("c-b") == 1
    file = tmp_path / "rod.toml"
    file.write_text('schema = "posekit.linkage/1"\n[segments]\na-b = 5\nb-c = 3\n')
    read = load_linkage(file)
    assert (read.name, read.points, read.segments) == ("rod", rod.points, rod.segments)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("[segments]\na-b = 5\n", "schema: got null"),
        ('schema = "posekit.linkage/1"\n[segments]\na-b = "long"\n', "fields of posekit.linkage/1"),
        ('schema = "posekit.linkage/1"\nwidth = 2\n[segments]\na-b = 5\n', "width"),
        ("[segments\n", "expected a TOML file"),
    ],
)
def test_files_that_are_no_linkage_are_refused(text, message, tmp_path):
    file = tmp_path / "rod.toml"
    file.write_text(text)
    with pytest.raises(posekit.InputError, match=message):
        load_linkage(file)


@pytest.mark.parametrize("count", [2, 3])
def test_flips_are_given_for_all_frames_or_each(count):
    rod = chain([5.0, 3.0])
    image = np.tile([[0.0, 0.0], [30.0, 0.0], [30.0, 20.0]], (2, 1, 1))
    hands = [{"p0-p1": "p0"}] * count
    if count == 2:
        each, all_ = (recover_object(rod, image, scale=10.0, nearer=one) for one in (hands, hands[0]))
        np.testing.assert_array_equal(each.points, all_.points)
        assert (each.flips[:, 0] == 1).all() and len(each.points) == 4
    else:
        with pytest.raises(posekit.InputError, match=r"nearer: got 3 frames"):
            recover_object(rod, image, scale=10.0, nearer=hands)


@pytest.mark.parametrize("text", ["", "nothing", "-3", "stature:", "closure:0", "closure,height"])
def test_impossible_scales_are_refused(text):
    with pytest.raises(posekit.InputError, match="scale"):
        parse_scale(text)


def test_a_robot_is_recovered_with_its_configuration():
    robot = posekit.load_robot("panda", bodies="none")
    linkage = load_linkage("panda")
    import pinocchio as pin

    rng = np.random.default_rng(4)
    q = pin.neutral(robot.model)
    lower, upper = robot.lower, robot.upper
    inner = np.isfinite(lower) & np.isfinite(upper)
    q[inner] = lower[inner] + rng.uniform(0.3, 0.7, inner.sum()) * (upper - lower)[inner]
    if robot.free_flyer:
        q[:7] = [0, 0, 0, 0, 0, 0, 1]
    data = robot.model.createData()
    pin.framesForwardKinematics(robot.model, data, q)
    points = np.array([data.oMf[robot.model.getFrameId(name)].translation for name in linkage.points])
    R, _ = np.linalg.qr(rng.normal(size=(3, 3)))
    points = points @ (R * np.sign(np.linalg.det(R))).T
    found = recover_object(linkage, [points[:, :2] * 500.0], scale="closure", robot=robot)
    sure = np.flatnonzero(found.certified)
    assert len(sure) and sure.max() < len(sure)
    true = points - points[0]
    off = np.abs(found.points[sure] - found.points[sure, :1] - true).max(axis=(1, 2))
    assert off.min() < 1e-6
    pin.framesForwardKinematics(robot.model, data, found.q[sure[int(off.argmin())]])
    placed = np.array([data.oMf[robot.model.getFrameId(name)].translation for name in linkage.points])
    apart = np.linalg.norm(placed[:, None] - placed, axis=2) - np.linalg.norm(
        points[:, None] - points, axis=2
    )
    assert np.abs(apart).max() < 1e-5
    document = found.document()
    assert document["schema"] == "posekit.object/1" and document["frames"][0]["postures"][0]["certified"]


def test_points_of_a_robot_are_its_base_its_turning_joints_and_its_ends():
    """Segments are the distances that no joint changes; nothing is known behind a joint that slides."""
    arm = [("shoulder", "revolute", 0.2), ("elbow", "revolute", 0.3), ("wrist", "continuous", 0.25)]
    arm += [("hand", "fixed", 0.1), ("slide", "prismatic", 0.1), ("finger", "revolute", 0.1)]
    limit = '<limit lower="-1" upper="1" velocity="1" effort="1"/>'
    parts, above = ['<link name="base"/>'], "base"
    for k, (name, kind, x) in enumerate(arm):
        axis = f'<axis xyz="0 {k % 2} {1 - k % 2}"/>'
        ends = f'<parent link="{above}"/><child link="{name}_link"/><origin xyz="{x} 0 0"/>'
        parts.append(
            f'<joint name="{name}" type="{kind}">{ends}{axis}{limit}</joint><link name="{name}_link"/>'
        )
        above = f"{name}_link" if name != "hand" else "wrist_link"
    linkage = linkage_of_robot(Robot(urdf=f'<robot name="arm">{"".join(parts)}</robot>', fixed_base=True))
    assert linkage.points == ("base", "shoulder", "elbow", "wrist", "hand_link")
    found = dict(zip(linkage.segment_names, linkage.lengths.tolist(), strict=True))
    steps = {"base-shoulder": 0.2, "shoulder-elbow": 0.3, "elbow-wrist": 0.25, "wrist-hand_link": 0.1}
    assert found == pytest.approx(steps)
