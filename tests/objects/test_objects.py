"""Any articulated object from an uncalibrated view: the truth is among the survivors, and the rest is said plainly."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from posekit.errors import InputError
from posekit.formats.own import ScaledOrthographicModel
from posekit.formats.own.object_view import ObjectView
from posekit.linkages import Linkage, span
from posekit.objects import (
    ArticulatedObject,
    ObjectTolerance,
    load_object,
    object_lines,
    recover_object,
    tolerance_of,
)
from posekit.objects.drawn_views import draw_configurations
from posekit.objects.spread import ImageSpread
from posekit.objects.triangles import Triangles, triangles
from posekit.robots.kinematics import Kinematics, body_points
from posekit.settings.scale import Scale

SCALE = 320.0
VALUE = Scale(how="value", value=SCALE)
CLOSURE = Scale(how="constraints", weights={"closure": 1.0})


def view_of(thing, truth, scale=None, unit="m", missing=()):
    """See postures (F, P, 3), metres or relative units, at `SCALE`."""
    image = truth[..., :2] * SCALE
    for name in missing:
        image[:, thing.linkage.points.index(name)] = np.nan
    return ObjectView(
        points=thing.linkage.points,
        camera=ScaledOrthographicModel(scale=scale),
        time=np.arange(len(truth), dtype=float),
        image=image,
        truth=truth,
        unit=None if thing.linkage.unit is None else unit,
    )


def to_root(truth):
    """Put the first point that is seen at depth zero."""
    return truth - truth[..., :1, :] * [0, 0, 1]


def robot_of(thing):
    """Return the robot of an object that has one."""
    assert thing.robot is not None
    return thing.robot


def family_of(frame):
    """Return the scales of a frame of which something was grown."""
    assert frame.family is not None
    return frame.family


def off(frame, truth):
    """Return the largest distance of a point, for the survivor that is nearest to the truth (P, 3)."""
    apart = np.linalg.norm(frame.points - to_root(truth), axis=-1)
    return np.inf if not len(apart) else np.nanmax(apart, axis=1).min()


def drawn(seed, segments, loops):
    """Draw a random object with its posture: a tree of some segments, and chords that close loops."""
    rng = np.random.default_rng(seed)
    points = rng.uniform(-1, 1, (segments + 1, 3))
    edges = {(int(rng.integers(0, k)), k) for k in range(1, segments + 1)}
    while len(edges) < segments + loops and len(edges) < segments * (segments + 1) // 2:
        a, b = sorted(rng.choice(segments + 1, 2, replace=False).tolist())
        edges.add((a, b))
    names = [f"p{k}" for k in range(segments + 1)]
    linkage = Linkage.from_names(
        name="drawn",
        points=names,
        segments={
            (names[a], names[b]): float(np.linalg.norm(points[a] - points[b])) for a, b in sorted(edges)
        },
    )
    return ArticulatedObject(linkage=linkage), points[None]


class TestLaws:
    @given(seed=st.integers(0, 10_000), segments=st.integers(1, 9), loops=st.integers(0, 3))
    @settings(deadline=None, max_examples=30, derandomize=True)
    def test_the_truth_is_among_the_survivors_with_its_flips(self, seed, segments, loops):
        thing, truth = drawn(seed, segments, loops)
        result = recover_object(view_of(thing, truth), thing, scale=VALUE)
        frame = result.frames[0]
        assert off(frame, truth[0]) < 1e-9
        ends = np.array(thing.linkage.segments)
        flips = np.sign(truth[0, ends[:, 1], 2] - truth[0, ends[:, 0], 2])
        assert (frame.flips == flips).all(axis=1).any()
        if len(thing.linkage.segments) == segments:  # a tree: all of them
            assert len(frame) == 2**segments

    @given(seed=st.integers(0, 10_000), segments=st.integers(2, 8), loops=st.integers(0, 3))
    @settings(deadline=None, max_examples=15, derandomize=True)
    def test_every_survivor_has_the_lengths_and_the_image(self, seed, segments, loops):
        thing, truth = drawn(seed, segments, loops)
        frame = recover_object(view_of(thing, truth), thing, scale=VALUE).frames[0]
        a, b = np.array(thing.linkage.segments).T
        lengths = np.linalg.norm(frame.points[:, a] - frame.points[:, b], axis=-1)
        np.testing.assert_allclose(lengths - thing.linkage.lengths, 0, atol=1e-5)
        np.testing.assert_allclose(frame.points[..., :2] * SCALE - truth[..., :2] * SCALE, 0, atol=1e-9)
        assert (frame.points[:, 0, 2] == 0).all()

    @given(seed=st.integers(0, 10_000), segments=st.integers(2, 8), loops=st.integers(0, 3))
    @settings(deadline=None, max_examples=15, derandomize=True)
    def test_survivors_and_losses_are_all_flips(self, seed, segments, loops):
        thing, truth = drawn(seed, segments, loops)
        frame = recover_object(view_of(thing, truth), thing, scale=VALUE).frames[0]
        assert len(frame) + sum(frame.rejected.values()) == 2**segments
        assert frame.levels[-1][1] == len(frame)
        assert next(name for name, _ in frame.levels) == thing.linkage.points[0]

    def test_without_a_robot_everything_comes_in_mirror_pairs(self):
        thing, truth = drawn(5, 6, 2)
        frame = recover_object(view_of(thing, truth), thing, scale=VALUE).frames[0]
        assert family_of(frame).mirrored == len(frame) and len(frame) % 2 == 0
        mirrored = frame.points * [1, 1, -1]
        assert all(np.abs(frame.points - one).max(axis=(1, 2)).min() < 1e-9 for one in mirrored)
        assert set(frame.certified) == {None} and frame.q is None

    def test_relative_lengths_mean_the_same_in_any_unit(self):
        thing, truth = drawn(7, 6, 2)
        large = Linkage.from_names(
            name="large",
            points=thing.linkage.points,
            segments=dict(
                zip(thing.linkage.segment_names, (thing.linkage.lengths * 1e6).tolist(), strict=True)
            ),
        )
        other = ArticulatedObject(linkage=large)
        one = recover_object(view_of(thing, truth), thing, scale=VALUE).frames[0]
        view = view_of(other, truth)
        two = recover_object(view, other, scale=Scale(how="value", value=SCALE / 1e6)).frames[0]
        assert one.branches == two.branches
        np.testing.assert_allclose(two.points, one.points * 1e6, atol=1e-2)

    @pytest.mark.parametrize("name", ["panda", "ur5", "allegro"])
    def test_robots_with_their_configurations(self, robots, name):
        thing, truth = robots(name)
        result = recover_object(view_of(thing, truth, scale=SCALE), thing)
        assert result.configuration_names == robot_of(thing).configuration_names
        kinematics = Kinematics(model=robot_of(thing).model, points=body_points(thing.linkage.points))
        for frame, posture in zip(result.frames, truth, strict=True):
            assert frame.judged == "exact"
            nearest = int(np.abs(frame.points - to_root(posture)).max(axis=(1, 2)).argmin())
            assert off(frame, posture) < 1e-6
            assert frame.certified[nearest] is True and frame.reasons[nearest] == ""
            assert frame.q is not None and frame.fk_distance is not None
            placed = kinematics.positions(frame.q)
            apart = np.linalg.norm(placed - frame.points, axis=-1).max(axis=1)
            np.testing.assert_allclose(apart, frame.fk_distance, atol=1e-9)
            for verdict, distance, reason in zip(
                frame.certified, frame.fk_distance, frame.reasons, strict=True
            ):
                assert verdict is bool(distance <= 1e-6 * thing.linkage.lengths.max())
                assert verdict or reason.startswith("undecided: ")

    def test_limits_leave_few_and_tell_a_hand_from_its_mirror_image(self, robots):
        thing, truth = robots("allegro")
        frames = recover_object(view_of(thing, truth, scale=SCALE), thing, certify=False).frames
        assert all(1 <= len(frame) <= 8 and family_of(frame).mirrored == 0 for frame in frames)
        arm, truth = robots("panda")
        result = recover_object(view_of(arm, truth, scale=SCALE), arm, certify=False)
        # Without the points on its axes, eight.
        assert all(len(frame) <= 4 for frame in result.frames)
        assert all(family_of(frame).mirrored == len(frame) > 0 for frame in result.frames)
        assert any(
            "in 3 a posture and its mirror image both survive" in line for line in object_lines(result)
        )


class TestScale:
    def test_the_least_is_the_default_and_names_its_segment(self):
        thing, truth = drawn(3, 5, 0)
        family = family_of(recover_object(view_of(thing, truth), thing).frames[0])
        a, b = np.array(thing.linkage.segments).T
        bounds = np.linalg.norm(truth[0, a, :2] - truth[0, b, :2], axis=1) * SCALE / thing.linkage.lengths
        assert family.how == "min" and family.segment == thing.linkage.segment_names[bounds.argmax()]
        np.testing.assert_allclose(family.chosen, [bounds.max()])

    def test_the_views_own_scale_comes_next(self):
        thing, truth = drawn(3, 5, 0)
        frame = recover_object(view_of(thing, truth, scale=SCALE), thing).frames[0]
        assert family_of(frame).how == "view" and off(frame, truth[0]) < 1e-9
        np.testing.assert_allclose(frame.scales, SCALE)

    def test_a_closed_loop_fixes_it(self):
        thing, truth = drawn(11, 5, 1)
        frame = recover_object(view_of(thing, truth), thing, scale=CLOSURE).frames[0]
        assert np.abs(family_of(frame).minima_s / SCALE - 1).min() < 1e-9
        assert off(frame, truth[0]) < 1e-7

    def test_a_single_loop_that_was_made_to_close_is_no_evidence(self):
        thing, truth = drawn(11, 5, 1)
        assert recover_object(view_of(thing, truth), thing, scale=CLOSURE).frames[0].judged == "closed"
        assert recover_object(view_of(thing, truth), thing, scale=VALUE).frames[0].judged == "exact"
        thing, truth = drawn(11, 5, 2)
        assert recover_object(view_of(thing, truth), thing, scale=CLOSURE).frames[0].judged == "exact"

    def test_rigid_triangles_fix_it_where_there_are_too_many_flips(self, robots):
        thing, truth = robots("allegro")
        frames = recover_object(view_of(thing, truth), thing, scale=CLOSURE, certify=False).frames
        for frame, posture in zip(frames, truth, strict=True):
            assert abs(family_of(frame).minima_s[0] / SCALE - 1) < 1e-9
            assert off(frame, posture) < 1e-6

    @given(seed=st.integers(0, 10_000))
    @settings(deadline=None, max_examples=40, derandomize=True)
    def test_one_triangle_alone(self, seed):
        points = np.random.default_rng(seed).uniform(-1, 1, (3, 3))
        thing = ArticulatedObject(
            linkage=Linkage.from_names(
                name="triangle",
                segments={
                    (f"p{a}", f"p{b}"): float(np.linalg.norm(points[a] - points[b]))
                    for a, b in ((0, 1), (1, 2), (0, 2))
                },
            )
        )
        from posekit.linkages import LinkageFamily

        family = LinkageFamily(linkage=thing.linkage, image=points[:, :2] * SCALE)
        found = Triangles.of(family)
        assert len(found) == 1 and len(triangles(thing.linkage)) == 1
        # How sharp the root is depends on how far the triangle is from its line of sight.
        np.testing.assert_allclose(found.scales(), SCALE, rtol=1e-5)
        assert found.residual(np.array(SCALE)) < 1e-12

    def test_from_the_height_in_pixels(self):
        thing = load_object("taylor_human")
        rng = np.random.default_rng(0)
        linkage = thing.linkage
        points = np.zeros((1, len(linkage.points), 3))
        place = {}
        # Shoulders and hips on one plane, limbs anywhere.
        for name, at in {
            "right_shoulder": (-9, 0, 0),
            "left_shoulder": (9, 0, 0),
            "right_hip": (-7, 24, 0),
            "left_hip": (7, 24, 0),
        }.items():
            place[name] = np.array(at, dtype=float)
        for name, (a, b), length in zip(
            linkage.segment_names, linkage.segments, linkage.lengths, strict=True
        ):
            start, end = linkage.nodes[a], linkage.nodes[b]
            if end not in place and start in place:
                way = rng.standard_normal(3)
                place[end] = place[start] + length * way / np.linalg.norm(way)
            assert name
        for k, name in enumerate(linkage.points):
            points[0, k] = place[name]
        frame = recover_object(
            view_of(thing, points), thing, scale=Scale(how="stature", value=70 * SCALE)
        ).frames[0]
        np.testing.assert_allclose(frame.scales, SCALE)
        assert off(frame, points[0]) < 1e-9

    def test_below_the_bound_is_refused_with_the_segment_and_what_it_needs(self):
        thing, truth = drawn(3, 5, 0)
        view = view_of(thing, truth)
        family = family_of(recover_object(view, thing).frames[0])
        match = rf"below {family.bound:.6g}, which {family.segment} needs: .*give at least"
        with pytest.raises(InputError, match=match):
            recover_object(view, thing, scale=Scale(how="value", value=0.9 * family.bound))

    def test_no_height_no_stature(self):
        thing, truth = drawn(3, 5, 0)
        with pytest.raises(InputError, match="has no height"):
            recover_object(view_of(thing, truth), thing, scale=Scale(how="stature", value=100.0))

    def test_no_loop_no_closure(self):
        thing, truth = drawn(3, 5, 0)
        with pytest.raises(InputError, match="no loop to search by closure"):
            recover_object(view_of(thing, truth), thing, scale=CLOSURE)

    def test_all_at_one_pixel(self):
        thing, truth = drawn(3, 5, 0)
        with pytest.raises(InputError, match="seen end on"):
            recover_object(view_of(thing, truth * [0, 0, 1]), thing)


class TestShape:
    def test_coplanar_sets_prune(self):
        rng = np.random.default_rng(0)
        points = np.concatenate([rng.uniform(-1, 1, (5, 2)), np.zeros((5, 1))], axis=1)
        turn = np.linalg.qr(rng.standard_normal((3, 3)))[0]
        points = points @ turn.T
        names = [f"p{k}" for k in range(5)]
        linkage = Linkage.from_names(
            name="flat",
            segments={
                (names[k], names[k + 1]): float(np.linalg.norm(points[k] - points[k + 1])) for k in range(4)
            },
            coplanar=[names],
        )
        thing = ArticulatedObject(linkage=linkage)
        frame = recover_object(view_of(thing, points[None]), thing, scale=VALUE).frames[0]
        assert off(frame, points) < 1e-9 and len(frame) < 16 and frame.judged == "exact"
        assert any(reason.startswith("coplanar/") for reason in frame.rejected)

    def test_right_angles_and_lines_prune(self):
        points = np.array([[0, 0, 0], [3, 0, 0], [3, 4, 0], [3, 8, 0.0]])
        turn = np.linalg.qr(np.random.default_rng(1).standard_normal((3, 3)))[0]
        points = points @ turn.T
        linkage = Linkage.from_names(
            name="square",
            segments={("a", "b"): 3.0, ("b", "c"): 4.0, ("c", "d"): 4.0},
            perpendicular=[("a-b", "b-c")],
            collinear=[("b", "c", "d")],
        )
        thing = ArticulatedObject(linkage=linkage)
        frame = recover_object(view_of(thing, points[None]), thing, scale=VALUE).frames[0]
        assert off(frame, points) < 1e-9 and len(frame) == 2  # and its mirror image
        assert {reason.split("/")[0] for reason in frame.rejected} == {"perpendicular", "collinear"}


class TestNearer:
    def test_flips_given_by_hand_leave_one(self):
        thing, truth = drawn(4, 6, 0)
        nearer = {
            name: thing.linkage.points[a] if truth[0, a, 2] < truth[0, b, 2] else thing.linkage.points[b]
            for name, (a, b) in zip(thing.linkage.segment_names, thing.linkage.segments, strict=True)
        }
        frame = recover_object(view_of(thing, truth), thing, scale=VALUE, nearer=[nearer]).frames[0]
        assert len(frame) == 1 and off(frame, truth[0]) < 1e-9
        assert any(reason.startswith("nearer/") for reason in frame.rejected)

    def test_one_mapping_a_frame_and_names_either_way_round(self):
        thing, truth = drawn(4, 3, 0)
        both = np.concatenate([truth, truth * [1, 1, -1]])
        name = thing.linkage.segment_names[0]
        a, b = name.split("-")
        end = a if truth[0, 0, 2] < truth[0, 1, 2] else b
        other = b if end == a else a
        frames = recover_object(
            view_of(thing, both), thing, scale=VALUE, nearer=[{f"{b}-{a}": end}, {name: other}]
        ).frames
        assert [len(frame) for frame in frames] == [4, 4]
        assert off(frames[0], both[0]) < 1e-9 and off(frames[1], both[1]) < 1e-9

    def test_unknown_segments_and_ends(self):
        thing, truth = drawn(4, 3, 0)
        view = view_of(thing, truth)
        with pytest.raises(InputError, match="no point"):
            recover_object(view, thing, nearer=[{"p0-p9": "p0"}])
        with pytest.raises(InputError, match="not one of its ends"):
            recover_object(view, thing, nearer=[{thing.linkage.segment_names[0]: "p3"}])
        with pytest.raises(InputError, match="expected 1"):
            recover_object(view, thing, nearer=[{}, {}])


class TestMissing:
    def test_a_leaf_may_be_missing(self, robots):
        thing, truth = robots("panda")
        view = view_of(thing, truth, scale=SCALE, missing=["panda_hand_tcp"])
        result = recover_object(view, thing)
        for frame, posture in zip(result.frames, truth, strict=True):
            assert np.isnan(frame.points[:, -1]).all()
            assert off(frame, posture) < 1e-6
            tcp = [k for k, ends in enumerate(result.segments) if "panda_hand_tcp" in ends]
            assert (frame.flips[:, tcp] == 0).all() and any(frame.certified)

    def test_a_corner_of_a_triangle_may_be_missing(self, robots):
        thing, truth = robots("panda")
        view = view_of(thing, truth, scale=SCALE, missing=["panda_joint3"])
        frames = recover_object(view, thing, certify=False).frames
        assert all(off(frame, posture) < 1e-6 for frame, posture in zip(frames, truth, strict=True))

    def test_what_joins_the_rest_may_not(self, robots):
        thing, truth = robots("panda")
        view = view_of(thing, truth, scale=SCALE, missing=["panda_joint5"])
        with pytest.raises(InputError, match="panda_joint5 not seen, and without the rest falls apart"):
            recover_object(view, thing)

    def test_nothing_seen_at_all(self):
        thing, truth = drawn(4, 3, 0)
        view = view_of(thing, truth, missing=thing.linkage.points)
        with pytest.raises(InputError, match="no segment is seen at both ends"):
            recover_object(view, thing)

    def test_a_picture_whose_pixels_are_not_square(self):
        thing, truth = drawn(4, 5, 1)
        view = view_of(thing, truth)
        camera = ScaledOrthographicModel(scale=SCALE, aspect=1.25)
        image = view.image / [1.25, 1.0]
        wide = ObjectView(points=view.points, camera=camera, time=view.time, image=image, unit=None)
        assert off(recover_object(wide, thing).frames[0], truth[0]) < 1e-9

    def test_other_frames_are_recovered_all_the_same(self, robots):
        thing, truth = robots("panda")
        view = view_of(thing, truth, scale=SCALE)
        image = view.image.copy()
        image[1, thing.linkage.points.index("panda_joint5")] = np.nan
        broken = ObjectView(points=view.points, camera=view.camera, time=view.time, image=image, unit="m")
        result = recover_object(broken, thing, certify=False)
        assert [bool(frame.reason) for frame in result.frames] == [False, True, False]
        assert len(result.frames[1]) == 0 and any("falls apart" in line for line in object_lines(result))


class TestTolerance:
    def truth_survives(self, thing, truth, frame):
        """Tell whether a survivor has the true flips of the tree's segments, or none where they are level."""
        tree = sorted({segment for segment in span(thing.linkage).segments if segment >= 0})
        ends = np.array(thing.linkage.segments)
        flips = np.sign(truth[ends[:, 1], 2] - truth[ends[:, 0], 2])
        same = (frame.flips == flips) | (frame.flips == 0)
        return bool(same[:, tree].all(axis=1).any())

    @given(seed=st.integers(0, 10_000), segments=st.integers(2, 7), loops=st.integers(1, 3))
    @settings(deadline=None, max_examples=30, derandomize=True)
    def test_image_points_that_are_off_by_the_tolerance_never_cost_the_truth(self, seed, segments, loops):
        thing, truth = drawn(seed, segments, loops)
        view = view_of(thing, truth)
        beside = 0.02
        rng = np.random.default_rng(seed)
        angle, radius = rng.uniform(0, 2 * np.pi, (2, *view.image.shape[:2]))
        shift = np.stack([np.cos(angle), np.sin(angle)], axis=-1) * (radius / 2 / np.pi)[..., None]
        noisy = ObjectView(
            points=view.points,
            camera=view.camera,
            time=view.time,
            image=view.image + shift * beside * SCALE,
            unit=None,
        )
        allowed = ObjectTolerance(rigid=1e-9, tangent=2 * beside, point=beside)
        frame = recover_object(noisy, thing, scale=VALUE, tolerance=allowed).frames[0]
        assert self.truth_survives(thing, truth[0], frame)

    @given(seed=st.integers(0, 10_000))
    @settings(deadline=None, max_examples=20, derandomize=True)
    def test_nor_that_of_what_is_flat_or_at_right_angles(self, seed):
        rng = np.random.default_rng(seed)
        flat = np.array([[0, 0, 0], [3, 0, 0], [3, 4, 0], [3, 8, 0], [1, 5, 0.0]])
        turn = np.linalg.qr(rng.standard_normal((3, 3)))[0]
        truth = (flat @ turn.T)[None]
        linkage = Linkage.from_names(
            name="sign",
            segments={("a", "b"): 3.0, ("b", "c"): 4.0, ("c", "d"): 4.0, ("d", "e"): 13**0.5},
            perpendicular=[("a-b", "b-c")],
            collinear=[("b", "c", "d")],
            coplanar=[("a", "b", "c", "d", "e")],
        )
        thing = ArticulatedObject(linkage=linkage)
        view = view_of(thing, truth)
        image = view.image + rng.uniform(-7, 7, view.image.shape)
        noisy = ObjectView(points=view.points, camera=view.camera, time=view.time, image=image, unit=None)
        allowed = ObjectTolerance(rigid=1e-9, tangent=0.08, point=0.04)
        frame = recover_object(noisy, thing, scale=VALUE, tolerance=allowed).frames[0]
        assert self.truth_survives(thing, truth[0], frame)

    @pytest.mark.parametrize("name", ["panda", "ur5"])
    def test_nor_that_of_a_robot(self, robots, name):
        thing, _ = robots(name)
        q = draw_configurations(robot_of(thing), 40, np.random.default_rng(9))
        kinematics = Kinematics(model=robot_of(thing).model, points=body_points(thing.linkage.points))
        truth = kinematics.positions(q)
        view = view_of(thing, truth, scale=SCALE)
        image = view.image + np.random.default_rng(0).uniform(-0.7, 0.7, view.image.shape)
        noisy = ObjectView(points=view.points, camera=view.camera, time=view.time, image=image)
        frames = recover_object(noisy, thing, certify=False).frames
        assert {frame.judged for frame in frames} == {"measured"}
        assert all(self.truth_survives(thing, one, frame) for one, frame in zip(truth, frames, strict=True))

    def test_a_level_segment_may_be_off_by_much_and_a_steep_one_by_little(self):
        thing = ArticulatedObject(
            linkage=Linkage.from_names(name="arm", segments={("a", "b"): 1.0, ("b", "c"): 1.0})
        )
        spanned = span(thing.working)
        spread = ImageSpread.of(spanned, np.array([[0, 0], [1, 0], [1.1, 0]]), 0.01)
        level, steep = spread.between(0, 1), spread.between(1, 2)
        np.testing.assert_allclose(level, np.sqrt(1 - 0.98**2))
        assert steep < 0.003 and spread.between(0, 2) == pytest.approx(level + steep)
        assert spread.off((0, 2)) == pytest.approx((level + steep) / 2 + 0.01)
        assert spread.off((0, 1, 2)) == pytest.approx(level + 0.01)

    def test_a_view_that_is_not_exact_is_judged_as_measured(self):
        thing, truth = drawn(21, 6, 3)
        view = view_of(thing, truth)
        noise = np.random.default_rng(0).normal(0, 0.5, view.image.shape)
        noisy = ObjectView(
            points=view.points, camera=view.camera, time=view.time, image=view.image + noise, unit=None
        )
        frame = recover_object(noisy, thing, scale=VALUE, tolerance=None).frames[0]
        assert frame.judged == "measured"
        given_ = ObjectTolerance(rigid=0.3, tangent=0.1, point=0.1)
        frame = recover_object(noisy, thing, scale=VALUE, tolerance=given_).frames[0]
        assert frame.judged == "given" and off(frame, truth[0]) < 0.3

    @pytest.mark.parametrize("value", [-1.0, np.nan, np.inf])
    def test_bad_tolerances(self, value):
        with pytest.raises(InputError, match="expected zero or a positive length"):
            ObjectTolerance(rigid=value, tangent=0.0, point=0.0)

    def test_tolerances_of_the_command_line(self, robots):
        panda, _ = robots("panda")
        assert tolerance_of(panda) is None
        given_ = tolerance_of(panda, rigid=0.02)
        assert given_ is not None and given_.rigid == 0.02 and given_.point == given_.tangent / 2 > 0
        given_ = tolerance_of(panda, tangent=0.03)
        assert given_ is not None and (given_.tangent, given_.point) == (0.03, 0.015)
        with pytest.raises(InputError, match="lengths of linkage taylor_human are relative"):
            tolerance_of(load_object("taylor_human"), rigid=0.02)


class TestBadInput:
    def test_too_many_survivors(self):
        thing, truth = drawn(1, 16, 0)
        with pytest.raises(InputError, match=r"more than 16,384 postures at 1 scales; say which end"):
            recover_object(view_of(thing, truth), thing, scale=VALUE)

    def test_too_many_segments(self):
        thing, truth = drawn(1, 23, 0)
        with pytest.raises(InputError, match=r"23 segments to enumerate, 2\^23 flips"):
            recover_object(view_of(thing, truth), thing, scale=VALUE)

    def test_a_view_of_something_else(self, robots):
        panda, truth = robots("panda")
        ur5, _ = robots("ur5")
        with pytest.raises(InputError, match="not those of the linkage ur5"):
            recover_object(view_of(panda, truth), ur5)
