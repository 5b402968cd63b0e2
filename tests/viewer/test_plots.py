"""What the plots show is what the result says: as many lines, marks and numbers, the sides told apart."""

import dataclasses
import functools
import itertools
import sys
from collections import Counter

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from posekit.errors import InputError, ViewerError
from posekit.papers.lee_chen_printed import PRINTED_MOTION, PRINTED_PHYSICAL
from posekit.recovery import recover
from posekit.recovery.result import result_of
from posekit.skeleton import JOINTS, SEGMENTS
from posekit.viewer.illustrate import illustrate
from posekit.viewer.plots.image_plot import plot_image
from posekit.viewer.plots.levels import plot_levels
from posekit.viewer.plots.plot_file import PLOT_STYLE, save
from posekit.viewer.plots.projections import letter, plot_projections, side_view
from posekit.viewer.plots.stick import side, wave
from posekit.viewer.plots.tree_nodes import pruned_branches, tips
from posekit.viewer.plots.tree_plot import place, plot_tree
from posekit.views.builtin import builtin_view

mpl = pytest.importorskip("matplotlib")

WALKING = ("rigid-parts", "joint-range", "collision", "walking")
SIDES = Counter(side(segment) for segment in SEGMENTS)


@functools.cache
def walking_result():
    return result_of(recover(builtin_view("seq1"), checks=WALKING), explain=True)


def first_frame():
    return walking_result().frames[0]


def segment_lines(axes):
    return [line for line in axes.lines if ":" in (line.get_gid() or "")]


def check_sticks(axes, figures):
    lines = segment_lines(axes)
    assert Counter(line.get_gid().split(":")[0] for line in lines) == {
        k: figures * n for k, n in SIDES.items()
    }
    for line in lines:
        whose = line.get_gid().split(":")[0]
        assert line.is_dashed() == (whose == "left")
        assert (len(line.get_xdata()) > 2) == (whose == "right")


def test_four_segments_are_in_each_sides_arm_and_leg():
    assert SIDES == {"right": 4, "left": 4, "trunk": 9}


def test_each_frame_of_the_image_is_one_figure_with_its_points_where_the_view_has_them():
    view = builtin_view("seq1")
    figure = plot_image(view)
    assert len(figure.axes) == len(view)
    for axes, image in zip(figure.axes, view.image, strict=True):
        check_sticks(axes, 1)
        (joints,) = [line for line in axes.lines if line.get_gid() == "joints"]
        np.testing.assert_allclose(np.asarray(joints.get_xydata()), 100 * image)  # the view's unit is cm
        low, high = axes.get_ylim()
        assert low > high  # y grows downwards


def test_each_survivor_has_its_panel_or_all_have_one():
    joints = first_frame().joints
    apart = plot_projections(joints)
    assert [axes.get_title() for axes in apart.axes] == [letter(k) for k in range(len(joints))]
    for axes in apart.axes:
        check_sticks(axes, 1)
    (together,) = plot_projections(joints, superposed=True).axes
    check_sticks(together, len(joints))


def test_a_superposition_labels_the_solutions_of_a_joint_and_not_what_they_carry():
    from matplotlib.text import Annotation

    joints = np.repeat(first_frame().joints[:1], 4, axis=0)
    knee, ankle, wrist = (JOINTS.index(name) for name in ("left_knee", "left_ankle", "right_wrist"))
    joints[1::2, [knee, ankle], 2] += 0.1  # the ankle goes with the knee
    joints[2:, wrist, 2] += 0.2
    joints[3, wrist, 2] += 0.001  # a near-twin
    (axes,) = plot_projections(joints, superposed=True).axes
    assert axes.get_title() == "a right wrist, b left knee"
    placed = {text.get_text(): text.xy for text in axes.texts if isinstance(text, Annotation)}
    assert sorted(placed) == ["a1", "a2", "b1", "b2"]
    assert placed["b2"][0] - placed["b1"][0] == pytest.approx(0.1)
    (alone,) = plot_projections(joints[:1], superposed=True).axes
    assert (alone.get_title(), len(alone.texts)) == ("", 0)


def test_one_of_each_group_is_drawn(tmp_path, monkeypatch):
    view = builtin_view("seq2")
    result = result_of(recover(view, group=0.05), unit="cm", explain=True)
    assert result.frames[0].groups is not None
    groups = result.frames[0].groups.tolist()
    drawn = []

    def draw(joints, **options):
        drawn.append((joints, options))
        return plot_projections(joints, **options)

    monkeypatch.setattr("posekit.viewer.plots.plot_projections", draw)
    monkeypatch.setattr("posekit.viewer.illustrate._page", lambda *_: None)
    monkeypatch.setattr("posekit.viewer.illustrate._scene", lambda *_: None)
    assert list(illustrate(tmp_path, "walk", result, view)) == []
    (apart, options), (together, _) = drawn
    assert len(groups) > len(set(groups)) == len(apart)
    np.testing.assert_array_equal(
        apart, result.frames[0].joints[[groups.index(one) for one in sorted(set(groups))]]
    )
    np.testing.assert_array_equal(apart, together)
    sizes = [groups.count(one) for one in sorted(set(groups))]
    assert options["titles"] == [f"{letter(k)} 1 of {size}" for k, size in enumerate(sizes)]
    assert (tmp_path / "walk.superposed.png").read_bytes().startswith(b"\x89PNG")


def test_side_view_is_depth_and_height_and_a_far_eye_sees_the_same():
    joints = first_frame().joints
    flat = side_view(joints)
    np.testing.assert_array_equal(flat[..., 0], joints[..., 2])
    np.testing.assert_array_equal(flat[..., 1], -joints[..., 1])
    np.testing.assert_allclose(side_view(joints, eye=1e6), flat, atol=1e-5)
    near = side_view(joints, eye=4.0)
    assert np.abs(near - flat).max() > 0.01
    np.testing.assert_allclose(near[0, 0], flat[0, 0])  # the eye is level with the first neck


@given(
    ends=st.lists(st.floats(-3, 3), min_size=4, max_size=4).map(lambda e: np.array(e).reshape(2, 2)),
    amplitude=st.floats(0, 0.1),
)
def test_waves_start_and_end_at_the_joints_and_stay_near(ends, amplitude):
    line = wave(ends, amplitude)
    np.testing.assert_allclose(line[[0, -1]], ends, atol=1e-12)
    along = ends[1] - ends[0]
    length = np.hypot(*along)
    if length > 1e-6:
        offset = line - ends[0]
        across = np.abs(along[0] * offset[:, 1] - along[1] * offset[:, 0]) / length
        assert across.max() <= amplitude + 1e-9


def test_an_unknown_joint_leaves_out_its_segments_alone():
    joints = first_frame().joints.copy()
    joints[0, JOINTS.index("left_wrist")] = np.nan
    axes = plot_projections(joints[:1]).axes[0]
    assert len(segment_lines(axes)) == len(SEGMENTS) - 1


def test_levels_are_the_results_and_the_print_is_beside_them():
    frames = [walking_result().frames[index] for index in (0, 2, 4)]
    figure = plot_levels(
        frames, printed={"physical": PRINTED_PHYSICAL["seq1"], "motion": PRINTED_MOTION["seq1"]}
    )
    assert len(figure.axes) == 3
    for index, (axes, frame) in enumerate(zip(figure.axes, frames, strict=True)):
        drawn = {line.get_gid(): line.get_xdata() for line in axes.lines}
        for stage, table in (("physical", PRINTED_PHYSICAL), ("motion", PRINTED_MOTION)):
            np.testing.assert_array_equal(drawn[stage], frame.levels[stage])
            np.testing.assert_array_equal(drawn[f"printed {stage}"], table["seq1"][index])
        np.testing.assert_array_equal(drawn["full tree"], 2.0 ** np.arange(14))
    assert [text.get_text() for text in figure.axes[0].get_yticklabels()] == [
        j.replace("_", " ") for j in JOINTS
    ]


def test_without_a_motion_model_one_line_is_drawn():
    frame = first_frame()
    levels = {**frame.levels, "motion": frame.levels["physical"]}
    (axes,) = plot_levels([dataclasses.replace(frame, levels=levels)]).axes
    assert [line.get_gid() for line in axes.lines] == ["physical", "full tree"]


def test_the_whole_tree_is_drawn_once():
    frame = first_frame()
    axes = plot_tree(frame, 13).axes[0]
    marks = Counter(line.get_gid() for line in axes.lines)
    assert marks == {"survivor": len(frame.joints), "pruned": len(frame.pruned)}
    edges = {lines.get_gid(): len(lines.get_paths()) for lines in axes.collections}
    # A path to each living node of a level: the counts of the paper's tables.
    assert edges["surviving"] == sum(frame.levels["motion"][1:])
    ends = tips(frame, 13)
    nodes = {tip.branch[:level] for tip in ends for level in range(1, len(tip.branch) + 1)}
    assert sum(edges.values()) == len(nodes)


@settings(max_examples=13)
@given(levels=st.integers(1, 13))
def test_a_tree_cut_short_keeps_its_survivors_and_its_nodes_their_order(levels):
    frame = first_frame()
    ends = tips(frame, levels)
    assert sum(tip.survivors for tip in ends) == len(frame.branches)
    assert all(len(tip.branch) <= levels for tip in ends)
    assert len({tip.branch for tip in ends}) == len(ends)
    for level in range(1, levels + 1):
        row = sorted((branch, x) for branch, (x, depth) in place(ends).items() if depth == level)
        assert all(a[1] < b[1] for a, b in itertools.pairwise(row))


def test_the_legend_names_every_reason_with_its_leaves():
    frame = first_frame()
    (legend,) = plot_tree(frame).legends
    labels = " ".join(text.get_text() for text in legend.get_texts())
    for leaves in frame.rejected.values():
        assert f"({leaves})" in labels
    lost = sum(2 ** (13 - len(branch)) for branch, _ in pruned_branches(frame))
    assert lost == 8192 - len(frame.branches)


@pytest.mark.parametrize(("suffix", "start"), [("png", b"\x89PNG"), ("svg", b"<?xml"), ("pdf", b"%PDF")])
def test_a_figure_is_written_whole_and_the_same_every_time(tmp_path, suffix, start):
    for name in ("a", "b"):
        save(plot_levels([first_frame()]), tmp_path / f"{name}.{suffix}")
    content = (tmp_path / f"a.{suffix}").read_bytes()
    assert content.startswith(start)
    assert content == (tmp_path / f"b.{suffix}").read_bytes()
    assert len(list(tmp_path.iterdir())) == 2


def test_drawing_leaves_matplotlibs_own_settings_alone(monkeypatch):
    monkeypatch.setitem(sys.modules, "matplotlib.pyplot", None)  # holds global state: an import would fail
    before = {name: mpl.rcParams[name] for name in PLOT_STYLE}
    plot_levels([first_frame()])
    assert {name: mpl.rcParams[name] for name in PLOT_STYLE} == before


def pruned_as(pruned):
    return dataclasses.replace(first_frame(), pruned=pruned)


@pytest.mark.parametrize(
    ("draw", "match"),
    [
        (lambda: plot_projections(np.empty((0, 14, 3))), "no posture"),
        (lambda: plot_projections(np.zeros((1, 13, 3))), r"\(N, 14, 3\)"),
        (lambda: plot_projections(np.full((1, 14, 3), np.nan)), "no joint"),
        (lambda: plot_projections(np.zeros((65, 14, 3))), "65 postures"),
        (lambda: plot_projections(first_frame().joints, titles=["one"]), "titles: got 1"),
        (lambda: plot_projections(first_frame().joints, eye=0.0), "inside the figure"),
        (lambda: plot_image(builtin_view("seq1"), frames=[]), "0 frames"),
        (lambda: plot_levels([]), "0 frames"),
        (lambda: plot_levels([first_frame()], printed={"other": [[1] * 14]}), "other"),
        (lambda: plot_levels([first_frame()], printed={"motion": [[1] * 13]}), "13"),
        (lambda: plot_levels([first_frame()], titles=[]), "titles"),
        (lambda: plot_tree(first_frame(), 0), "levels: got 0"),
        (lambda: plot_tree(first_frame(), 14), "levels: got 14"),
        (lambda: plot_tree(pruned_as(None)), "--explain"),
        (lambda: plot_tree(pruned_as([{"branch": "02", "reason": "x"}])), "'02'"),
        (lambda: plot_tree(pruned_as([{"branch": 7, "reason": "x"}])), "without branch"),
        (lambda: plot_tree(pruned_as([{"branch": first_frame().branches[0], "reason": "x"}])), "survivor"),
    ],
)
def test_what_cannot_be_drawn_is_refused_in_one_line(draw, match):
    with pytest.raises(ViewerError, match=match) as caught:
        draw()
    assert "\n" not in str(caught.value)


def test_an_unknown_format_or_folder_is_refused(tmp_path):
    figure = plot_levels([first_frame()])
    with pytest.raises(InputError, match=r"\.png"):
        save(figure, tmp_path / "levels.bmp")
    with pytest.raises(InputError, match="does not exist"):
        save(figure, tmp_path / "no" / "levels.png")
    assert not list(tmp_path.iterdir())


def test_without_matplotlib_the_error_says_what_to_install(monkeypatch):
    monkeypatch.setitem(sys.modules, "matplotlib", None)
    with pytest.raises(ViewerError, match=r"posekit\[pictures\]"):
        plot_levels([first_frame()])


# --- uncalibrated views ----------------------------------------------------------------------------------


def test_y_grows_downwards_in_every_number_of_panels():
    view = builtin_view("seq1")
    for count in (1, 2, 3, 4):
        for axes in plot_image(view, range(count)).axes:
            low, high = axes.get_ylim()
            assert low > high


def test_rings_are_where_the_camera_projects_the_survivors(flat, narrow_view, scales, flat_view):
    for result, view in ((flat, narrow_view), (scales, flat_view)):
        figure = plot_image(view, [0, 3], result=result)
        for axes, k in zip(figure.axes, (0, 3), strict=True):
            (rings,) = [line for line in axes.lines if line.get_gid() == "reprojected"]
            found = np.asarray(rings.get_xydata())
            # All survivors, of whatever scale, have one image: that of the view.
            assert len(found) == len(JOINTS)
            gaps = np.linalg.norm(found[:, None] - view.image[k], axis=2)
            assert gaps.min(axis=0).max() < 1e-5
            assert axes.get_aspect() == pytest.approx(1 / view.camera.aspect)


def test_rings_of_a_calibrated_view_are_its_image_too():
    view, result = builtin_view("seq1"), walking_result()
    figure = plot_image(view, [0], result=result)
    (rings,) = [line for line in figure.axes[0].lines if line.get_gid() == "reprojected"]
    gaps = np.linalg.norm(np.asarray(rings.get_xydata())[:, None] - 100 * view.image[0], axis=2)
    assert gaps.min(axis=0).max() < 1e-5
    assert not any(line.get_gid() == "reprojected" for line in plot_image(view, [0]).axes[0].lines)


def test_depth_counts_from_the_root_where_it_is_relative(flat):
    assert "from the root" in plot_projections(flat.frames[0].joints).get_supxlabel()
    assert "from the optical centre" in plot_projections(first_frame().joints).get_supxlabel()


def test_levels_of_several_scales_are_compared_with_as_many_trees(flat, scales):
    for result, trees in ((flat, 1), (scales, 3)):
        (axes,) = plot_levels(result.frames[:1]).axes
        (full,) = [line for line in axes.lines if line.get_gid() == "full tree"]
        np.testing.assert_array_equal(full.get_xdata(), trees * 2.0 ** np.arange(14))


def test_trees_of_several_scales_are_drawn_as_their_union(flat):
    single = flat.frames[0]
    assert plot_tree(single).axes
    survivor = single.branches[0]
    family = dataclasses.replace(single.family, chosen=np.array([400.0, 410.0]))
    # At the second scale a survivor of the first is pruned early, and nothing else grew.
    early = {"branch": survivor[:4], "reason": "rigid_parts/early"}
    both = dataclasses.replace(single, family=family, pruned=[*single.pruned, early])
    shown = tips(both, 13)
    assert sum(tip.survivors for tip in shown) == len(single.branches)
    assert "rigid_parts/early" not in {tip.reason for tip in shown}
    assert {tip.branch for tip in shown} == {tip.branch for tip in tips(single, 13)}
    assert "2 scales of 8192 leaves each" in plot_tree(both).axes[0].get_title(loc="left")
    # At one scale that would be a contradiction.
    with pytest.raises(ViewerError, match="also leads to a survivor"):
        tips(dataclasses.replace(both, family=single.family), 13)
