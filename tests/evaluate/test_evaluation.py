"""Evaluation where the truth is known: a walker, of whom everything is known, through virtual cameras."""

import dataclasses
import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from posekit.body import load_figure
from posekit.errors import InputError
from posekit.evaluate import (
    Choice,
    FrameSampling,
    Method,
    SurvivorOrder,
    Sweep,
    by_path,
    by_probability,
    evaluate,
    write_evaluation,
)
from posekit.evaluate.condition import lost_to, numbers
from posekit.evaluate.evaluated_frames import CONDITION_KEYS
from posekit.evaluate.evaluation_report import csv_lines, document, summary
from posekit.evaluate.material import of_capture, of_view
from posekit.formats.own import OpenCVModel, View
from posekit.measures import mpjpe
from posekit.recovery.recovery import FrameRecovery
from posekit.settings import MEASURED_TOLERANCE, RecoverSettings, Tolerance
from posekit.skeleton import JOINTS
from posekit.synthesis import Capture, Walker, random_views, read_capture, seq1
from posekit.views.builtin import forget_camera, view_of

FIGURE = load_figure()
SWEEP = Sweep(yaws=(0.0, 90.0, 135.0), heights=(1.0, 2.0))
FEW = FrameSampling(frames_per_clip=3)


def walk(velocity: float, frames: int = 20, fps: float = 30.0) -> np.ndarray:
    """Return the joints of the walker over the ground (F, 14, 3), y up."""
    walker, time = Walker(velocity=velocity), np.arange(frames) / fps
    points = FIGURE.forward_kinematics(walker.configurations(walker.phase(time)))
    return np.asarray(points[:, :14] + walker.travel(time)[:, None])


def arrays(**changed: Any) -> dict[str, Any]:
    joints = [walk(0.7), walk(1.2)]
    content = {
        "joints": np.concatenate(joints),
        "joint_names": np.array(JOINTS),
        "clip": np.repeat([0, 1], [len(each) for each in joints]),
        "clip_names": np.array(["slow", "fast"]),
        "clip_action": np.array(["walking", "hurrying"]),
        "clip_fps": np.array([30.0, 30.0]),
        "up": np.array("+y"),
    }
    return {**content, **changed}


@pytest.fixture(scope="module")
def capture(tmp_path_factory: pytest.TempPathFactory) -> Capture:
    path = tmp_path_factory.mktemp("motion") / "walks.npz"
    np.savez(path, **arrays())
    return read_capture(path)


@pytest.fixture(scope="module")
def exact(capture: Capture) -> Any:
    return evaluate(capture, sampling=FEW, sweep=SWEEP, method=Method(noise=(0.0, 2.0)))


def of(evaluation: Any, **key: Any) -> dict[str, Any]:
    """Return the numbers of one condition."""
    for found, rows in evaluation.frames.conditions(tuple(key)):
        if found == key:
            return numbers(evaluation.frames, rows)
    raise AssertionError(key)


def test_exact_points_keep_the_truth_everywhere(exact: Any) -> None:
    told = of(exact, noise=0.0)
    assert told["frames"] == 2 * 3 * 6
    assert told["frames_without_survivor"] == 0
    assert told["retained_within_10mm"] == told["retained_branch"] == 1.0
    assert told["error_mm"]["mpjpe"]["best"]["p95"] < 1e-3
    assert told["cps_mm"]["best"]["aligned"] == pytest.approx(300.0, abs=1e-3)
    assert not lost_to(exact.frames, np.flatnonzero(exact.frames.keys["noise"] == 0))


def test_survivors_break_neither_lengths_nor_ranges(exact: Any) -> None:
    broken = of(exact)["violations"]
    assert broken["certified"] > 100
    assert broken["lengths"] == broken["ranges"] == 0
    assert broken["length_excess_mm"] <= 1e-3
    assert broken["range_excess_deg"] <= 1e-6
    assert (
        broken["witness_turned_deg"] is None
    )  # ranges with couplings are no box that a witness is inside of


def test_noise_takes_the_truth_away_and_is_found_in_the_numbers(exact: Any) -> None:
    clean, noisy = of(exact, noise=0.0), of(exact, noise=2.0)
    assert noisy["retained_within_10mm"] < clean["retained_within_10mm"]
    assert noisy["error_mm"]["mpjpe"]["best"]["mean"] > 1
    rows = np.flatnonzero(exact.frames.keys["noise"] == 2)
    lost = lost_to(exact.frames, rows)
    known = exact.frames.measured.branch[rows]
    assert sum(lost.values()) == int((known == 0).sum()) > 0
    assert all("/" in reason for reason in lost)


def test_errors_are_those_of_the_survivors(capture: Capture) -> None:
    method = Method(noise=(1.0,), seed=3)
    works = of_capture(capture, FEW, SWEEP, method).works
    found = evaluate(capture, sampling=FEW, sweep=SWEEP, method=method).frames
    place = 0
    for work in works:
        for frame, truth in zip(method.recover(work.view), work.view.truth, strict=True):
            errors = mpjpe(frame.joints, np.broadcast_to(truth, frame.joints.shape)).value
            assert found.measured.survivors[place] == len(frame)
            if len(frame):
                assert found.error("best", "mpjpe")[place] == pytest.approx(errors.min(), abs=1e-12)
                assert np.isclose(errors, found.error("random", "mpjpe")[place], atol=1e-12).any()
                order = by_probability([frame], FIGURE)[0].order
                assert found.error("first", "mpjpe")[place] == pytest.approx(errors[order[0]], abs=1e-9)
            else:
                assert np.isnan(found.error("best", "mpjpe")[place])
            place += 1
    assert place == len(found)


def test_noise_is_one_draw_of_several_sizes(capture: Capture) -> None:
    one, two, none = (
        of_capture(capture, FEW, SWEEP, Method(noise=(level,), seed=5)).works[0].view.image
        for level in (1.0, 2.0, 0.0)
    )
    assert np.allclose(two - none, 2 * (one - none), atol=1e-9)
    assert np.array_equal(one[:, 0], none[:, 0])  # the neck is given: its image point says nothing
    assert 0.5 < (one - none)[:, 1:].std() < 1.5
    placed = of_capture(capture, FEW, SWEEP, Method(noise=(1.0,), seed=5, root="auto")).works[0].view
    assert np.isnan(placed.root).all()
    assert (placed.image[:, 0] != none[:, 0]).all()
    other = of_capture(capture, FEW, SWEEP, Method(noise=(1.0,), seed=6)).works[0].view.image
    assert not np.allclose(one, other)


def test_the_same_seed_gives_the_same_numbers_in_any_number_of_processes(capture: Capture) -> None:
    method = Method(noise=(0.0, 1.0), seed=1)
    alone, together = (
        evaluate(capture, sampling=FrameSampling(frames_per_clip=2), sweep=SWEEP, method=method, jobs=jobs)
        for jobs in (1, 2)
    )
    assert json.dumps([*document(alone)[1]]) == json.dumps([*document(together)[1]])
    other = evaluate(
        capture,
        sampling=FrameSampling(frames_per_clip=2),
        sweep=SWEEP,
        method=dataclasses.replace(method, seed=2),
    )
    assert json.dumps([*document(alone)[1]]) != json.dumps([*document(other)[1]])


def test_conditions_share_out_all_frames(exact: Any) -> None:
    counts = [len(rows) for _, rows in exact.frames.conditions(CONDITION_KEYS)]
    assert counts == [3] * (2 * 3 * 2 * 2)
    every = np.concatenate([rows for _, rows in exact.frames.conditions(CONDITION_KEYS)])
    assert sorted(every.tolist()) == list(range(len(exact.frames)))
    assert [key["noise"] for key, _ in exact.frames.conditions(("noise",))] == [0.0, 2.0]


class Oracle:
    """Ranks by the distance from the truth that it was told, and says how sure it is."""

    def __init__(self, truth: dict[float, np.ndarray], probability: float | None = None) -> None:
        self.truth, self.probability = truth, probability

    def __call__(self, frames: Any, figure: Any) -> list[SurvivorOrder]:
        found = []
        for frame in frames:
            away = np.linalg.norm(frame.joints - self.truth[frame.time], axis=-1).mean(axis=1)
            stated = (
                None if self.probability is None else np.full(len(away), self.probability / max(len(away), 1))
            )
            if stated is not None and len(away):
                stated[np.argmin(away)] = self.probability
            found.append(SurvivorOrder(order=np.argsort(away), probability=stated))
        return found


@pytest.fixture(scope="module")
def seen(capture: Capture) -> View:
    """Return a view of one camera, with a time of its own for every frame."""
    work = of_capture(
        capture, FrameSampling(frames_per_clip=20), Sweep(yaws=(60.0,), heights=(1.5,)), Method(noise=(0.0,))
    )
    return dataclasses.replace(work.works[0].view, deviation=None)


def test_any_ranking_can_be_taken(seen: View) -> None:
    oracle = Oracle(dict(zip(seen.time.tolist(), seen.truth, strict=True)))
    told = of(evaluate(seen, method=Method(noise=(0.0,), rank=oracle)))
    assert told["error_mm"]["mpjpe"]["first"] == told["error_mm"]["mpjpe"]["best"]
    assert told["limbs_right"]["first"] == 1.0
    assert told["calibration"] is None
    assert told["error_mm"]["mpjpe"]["random"]["mean"] > 1
    assert told["limbs_right"]["random"] < 1


@pytest.mark.parametrize("sure", [1.0, 0.6])
def test_probabilities_are_judged(seen: View, sure: float) -> None:
    oracle = Oracle(dict(zip(seen.time.tolist(), seen.truth, strict=True)), sure)
    evaluation = evaluate(seen, method=Method(noise=(0.0,), rank=oracle))
    told = of(evaluation)["calibration"]
    assert told["branch"]["frames"] == len(seen)
    assert told["branch"]["ece"] == pytest.approx(1 - sure, abs=1e-5)
    assert told["within_35mm"]["brier"] == pytest.approx((1 - sure) ** 2, abs=1e-5)
    (curve,) = document(evaluation)[0]["curves"]
    assert sum(curve["reliability"]["branch"]["frames"]) == len(seen)


@pytest.mark.parametrize(
    ("rank", "says"),
    [
        (lambda frames, figure: [], "expected 20"),
        (
            lambda frames, figure: [SurvivorOrder(order=np.zeros(len(one), dtype=int)) for one in frames],
            "no order",
        ),
        (
            lambda frames, figure: [
                SurvivorOrder(order=np.arange(len(one)), probability=np.full(len(one), np.nan))
                for one in frames
            ],
            "numbers from 0 to 1",
        ),
        (
            lambda frames, figure: [
                SurvivorOrder(order=np.arange(len(one)), probability=np.array([0.5])) for one in frames
            ],
            "numbers from 0 to 1",
        ),
    ],
)
def test_a_ranking_that_is_none_is_refused(seen: View, rank: Any, says: str) -> None:
    with pytest.raises(InputError, match=says):
        evaluate(seen, method=Method(noise=(0.0,), rank=rank))


def test_a_sequence_is_followed_camera_by_camera_in_order(capture: Capture) -> None:
    heard: list[list[float]] = []

    def last(frames: Sequence[FrameRecovery], rankings: Sequence[SurvivorOrder]) -> Choice:
        heard.append([frame.time for frame in frames])
        assert [len(one.order) for one in rankings] == [len(frame) for frame in frames]
        return Choice(survivor=np.array([len(frame) - 1 for frame in frames]))

    method = Method(noise=(0.0, 1.0), choose=last)
    found = evaluate(capture, sampling=FrameSampling(frames_per_clip=6), sweep=SWEEP, method=method)
    assert len(heard) == 2 * 2 * len(SWEEP)  # clips, levels, cameras
    assert all(np.allclose(np.diff(times), 1 / 30) and len(times) == 6 for times in heard)
    told = of(found, noise=0.0)
    assert told["error_mm"]["mpjpe"]["path"]["mean"] > 0
    assert 0 <= told["limbs_right"]["path"] <= 1
    assert "MPJPE path" in "\n".join(summary(found))
    still = of_capture(
        capture, FrameSampling(frames_per_clip=6, consecutive=True), SWEEP, Method(noise=(0.0,))
    )
    moved = np.diff(still.works[0].view.truth[:6].mean(axis=1), axis=0)
    assert np.linalg.norm(moved, axis=1).min() > 0.01  # the camera stands, the walker does not


def last(frames: Sequence[FrameRecovery]) -> np.ndarray:
    return np.array([len(frame) - 1 for frame in frames])


@pytest.mark.parametrize(
    "choose",
    [
        lambda frames, rankings: Choice(survivor=np.array([0])),
        lambda frames, rankings: Choice(survivor=np.full(len(frames), 10**6)),
        lambda frames, rankings: Choice(survivor=np.full(len(frames), 0.5)),
        lambda frames, rankings: Choice(survivor=last(frames), joints=np.zeros((len(frames), 13, 3))),
        lambda frames, rankings: None,
    ],
)
def test_a_choice_that_is_none_is_refused(seen: View, choose: Any) -> None:
    with pytest.raises(InputError, match="sequence"):
        evaluate(seen, method=Method(noise=(0.0,), choose=choose))


def test_a_person_is_followed(seen: View) -> None:
    """A wrist that no forearm reaches leaves two frames without survivor: the path bridges them, and they count."""
    image = seen.image.copy()
    image[3:5, JOINTS.index("left_wrist")] += 700
    odd = dataclasses.replace(seen, image=image)
    evaluation = evaluate(odd, method=Method(noise=(0.0,), choose=by_path))
    found, told = evaluation.frames, of(evaluation)
    assert told["bridged"] == pytest.approx(2 / len(seen))
    assert np.isnan(found.error("best", "mpjpe")[3:5]).all()
    path = found.error("path", "mpjpe")
    assert np.isfinite(path).all()
    taken = found.measured.bridged == 0
    assert (path[taken] >= found.error("best", "mpjpe")[taken] - 1e-12).all()
    assert path.mean() < 0.6 * np.nanmean(found.error("random", "mpjpe"))
    limbs = told["limbs_right"]
    assert limbs["random"] < limbs["path"] <= limbs["best"] <= 1
    text = "\n".join(summary(evaluation))
    assert "limbs right: path" in text
    assert evaluation.settings["sequences"] == "by_path"
    single = of(evaluate(odd, method=Method(noise=(0.0,))))
    assert "bridged" not in single
    assert "path" not in single["limbs_right"]


def test_a_sequence_without_survivors_has_no_path(seen: View) -> None:
    none = [FrameRecovery(time=float(at), batch=None, index=0) for at in range(3)]
    empty = SurvivorOrder(order=np.empty(0, dtype=np.intp))
    assert by_path(none, [empty] * 3).survivor.tolist() == [-1, -1, -1]


def test_functions_that_cannot_be_sent_need_one_process(capture: Capture) -> None:
    with pytest.raises(InputError, match="--jobs: the method cannot be sent"):
        evaluate(
            capture,
            sampling=FEW,
            method=Method(choose=lambda frames, rankings: Choice(survivor=last(frames))),
            jobs=2,
        )


def test_views_are_taken_as_they_are() -> None:
    scene = random_views(FIGURE, 6, np.random.default_rng(2))
    evaluation = evaluate(view_of(scene), method=Method(noise=(0.0, 1.0)), source="scene")
    told = of(evaluation, noise=0.0)
    assert told["frames"] == 6
    assert told["retained_branch"] == 1.0
    assert {key["yaw"] for key, _ in evaluation.frames.conditions(CONDITION_KEYS)} == {None}
    assert of(evaluation, action="scene", noise=1.0)["frames"] == 6


def test_photographs_tell_no_place() -> None:
    view = forget_camera(view_of(seq1()))
    told = of(evaluate(view, method=Method(noise=(0.0,))))
    assert told["frames"] == 5
    assert told["error_mm"]["mpjpe"] == told["error_mm"]["centred"]


def test_a_given_neck_is_the_true_one() -> None:
    view = view_of(random_views(FIGURE, 3, np.random.default_rng(2)))
    work = of_view(view, Method(noise=(1.0,), root="given")).works[0]
    assert np.array_equal(work.view.root, view.truth[:, 0])


def test_what_cannot_be_recovered_is_a_frame_without_survivor(seen: View) -> None:
    image = seen.image.copy()
    image[::2, JOINTS.index("left_wrist")] += 700  # farther than any forearm reaches
    odd = dataclasses.replace(seen, image=image)
    found = evaluate(odd, method=Method(noise=(0.0,))).frames
    assert np.array_equal(found.measured.survivors == 0, np.arange(len(seen)) % 2 == 0)
    assert all(found.measured.killer[::2])
    assert of(evaluate(odd, method=Method(noise=(0.0,))))["retained_branch"] == 0.5


def test_nothing_that_can_be_recovered_is_refused(seen: View) -> None:
    image = seen.image.copy()
    image[:, JOINTS.index("left_wrist")] += 700
    with pytest.raises(InputError, match="no frame can be recovered"):
        view = dataclasses.replace(seen, image=image, length_deviation=0.0)
        evaluate(view, method=Method(noise=(0.0,)), source="far")


def test_a_clip_without_a_body_is_left_out_and_said(tmp_path: Path) -> None:
    content = arrays()
    joints = content["joints"].copy()
    right, left = (JOINTS.index(f"{side}_shoulder") for side in ("right", "left"))
    joints[20:, left] = joints[20:, right]  # no breadth
    np.savez(tmp_path / "odd.npz", **{**content, "joints": joints})
    found = evaluate(
        read_capture(tmp_path / "odd.npz"), sampling=FEW, sweep=SWEEP, method=Method(noise=(0.0,))
    )
    assert len(found.frames) == 3 * len(SWEEP)
    assert found.material.left_out[0].startswith("clip fast: ")
    assert "left out: clip fast" in "\n".join(summary(found))


def test_a_clip_with_the_pelvis_between_the_hips_is_evaluated(tmp_path: Path) -> None:
    content = arrays()
    joints = content["joints"].copy()
    hips = [JOINTS.index(f"{side}_hip") for side in ("right", "left")]
    joints[20:, JOINTS.index("pelvis")] = joints[20:, hips].mean(axis=1)
    np.savez(tmp_path / "middle.npz", **{**content, "joints": joints})
    found = evaluate(
        read_capture(tmp_path / "middle.npz"), sampling=FEW, sweep=SWEEP, method=Method(noise=(0.0,))
    )
    assert len(found.frames) == 6 * len(SWEEP)
    assert not found.material.left_out


def test_a_person_outside_the_picture_is_left_out_and_counted(capture: Capture) -> None:
    near = Sweep(yaws=(0.0, 90.0), heights=(1.0,), distance=2.4, f=1500.0)
    method = Method(noise=(0.0,))
    with pytest.raises(InputError, match="leaves every picture"):
        of_capture(capture, FEW, dataclasses.replace(near, f=5000.0), method)
    still = of_capture(capture, FrameSampling(frames_per_clip=20, consecutive=True), near, method)
    assert still.frames + still.out_of_picture == 2 * 20 * 2


@pytest.mark.parametrize(
    ("make", "says"),
    [
        (lambda: FrameSampling(frames_per_clip=0), "--frames-per-clip"),
        (lambda: Sweep(yaws=()), "--yaws"),
        (lambda: Sweep(yaws=(0.0, np.nan)), "--yaws"),
        (lambda: Sweep(heights=(1.0, 1.0)), "each once"),
        (lambda: Sweep(yaws=tuple(np.arange(0, 180, 0.01))), "cameras"),
        (lambda: Sweep(distance=-1.0), "distances"),
        (lambda: Method(noise=()), "--noise"),
        (lambda: Method(noise=(-1.0,)), "--noise"),
        (lambda: Method(noise=(np.inf,)), "--noise"),
        (lambda: Method(noise=(1.0, 1.0)), "each level once"),
        (lambda: Method(root="head"), "--root"),  # type: ignore[arg-type]
        (lambda: Method(settings=RecoverSettings(checks=("gravity",))), "not a check"),
        (lambda: Method(settings=RecoverSettings(ranges="nowhere")), "--ranges"),
        (lambda: Method(settings=RecoverSettings(rules=(9,))), "--rules"),
        (lambda: Method(seed=-1), "--seed"),
    ],
)
def test_what_makes_no_sense_is_refused(make: Any, says: str) -> None:
    with pytest.raises(InputError, match=says):
        make()


def test_what_does_not_go_with_the_motion_is_refused(capture: Capture, seen: View) -> None:
    method = Method(noise=(0.0,))
    with pytest.raises(InputError, match='--clips: "swim" is not in'):
        evaluate(capture, sampling=FrameSampling(clips=("swim",)), method=method)
    with pytest.raises(InputError, match="no clip is of both"):
        evaluate(capture, sampling=FrameSampling(clips=("slow",), actions=("hurrying",)), method=method)
    with pytest.raises(InputError, match="--heights: 9 m"):
        evaluate(capture, sweep=Sweep(heights=(9.0,)), method=method)
    with pytest.raises(InputError, match="--jobs: 0"):
        evaluate(capture, method=method, jobs=0)
    with pytest.raises(InputError, match="views; expected at most"):
        evaluate(
            capture, sweep=Sweep(yaws=tuple(np.arange(3000) / 50)), sampling=FrameSampling(frames_per_clip=40)
        )
    with pytest.raises(InputError, match="no frame has a truth"):
        evaluate(dataclasses.replace(seen, truth=np.full(seen.truth.shape, np.nan)), method=method)
    with pytest.raises(InputError, match="lee-chen"):
        evaluate(view_of(seq1()), method=Method(noise=(0.0, 1.0)))


def test_reports_hold_the_same_numbers(exact: Any, tmp_path: Path) -> None:
    for name in ("report.json", "report.csv", "report.md"):
        write_evaluation(tmp_path / name, exact)
    read = json.loads((tmp_path / "report.json").read_text())
    assert read["schema"] == "posekit.evaluation/1"
    assert read["settings"]["yaws"] == [0.0, 90.0, 135.0]
    assert read["frames"] == len(exact.frames) == sum(row["frames"] for row in read["conditions"])
    assert [row["noise"] for row in read["by_noise"]] == [0.0, 2.0]
    assert len(read["curves"][0]["correct_poses"]["first"]["aligned"]) == 301
    reliability = read["curves"][0]["reliability"]["branch"]
    assert sum(reliability["frames"]) == sum(
        row["frames"] for row in read["conditions"] if row["noise"] == 0.0
    )
    head, *rows = (line.split(",") for line in (tmp_path / "report.csv").read_text().splitlines())
    assert len(rows) == len(read["conditions"])
    for row, condition in zip(rows, read["conditions"], strict=True):
        cells = dict(zip(head, row, strict=True))
        assert (cells["action"], float(cells["yaw"])) == (condition["action"], condition["yaw"])
        assert float(cells["survivors.median"]) == condition["survivors"]["median"]
        first = condition["error_mm"]["mpjpe"]["first"]["mean"]
        assert cells["error_mm.mpjpe.first.mean"] == ("" if first is None else str(first))
    assert next(iter(csv_lines(exact))) == ",".join(head)
    assert (tmp_path / "report.md").read_text().count("| 0 px") == 1
    with pytest.raises(InputError, match="suffix"):
        write_evaluation(tmp_path / "report.txt", exact)


def test_tolerances_and_ranges_are_used(capture: Capture) -> None:
    def asked(noise: float, **changes: Any) -> Any:
        method = Method(noise=(noise,), settings=RecoverSettings(**changes))
        return evaluate(capture, sampling=FEW, sweep=SWEEP, method=method)

    wide = Tolerance(rigid=0.1, tangent=0.05, placement=False, angle=10.0)
    loose = evaluate(
        capture,
        sampling=FEW,
        sweep=SWEEP,
        method=Method(noise=(2.0,), settings=RecoverSettings(tolerance=wide)),
    )
    strict = evaluate(
        capture,
        sampling=FEW,
        sweep=SWEEP,
        method=Method(noise=(2.0,), settings=RecoverSettings(tolerance=MEASURED_TOLERANCE)),
    )
    assert (loose.frames.measured.survivors >= strict.frames.measured.survivors).all()
    assert of(loose)["violations"]["ranges"] == 0
    table = evaluate(
        capture,
        sampling=FEW,
        sweep=SWEEP,
        method=Method(noise=(0.0,), settings=RecoverSettings(ranges="table1")),
    )
    assert of(table)["violations"]["ranges"] == 0
    assert of(table)["violations"]["witness_turned_deg"] is None
    free = evaluate(
        capture,
        sampling=FEW,
        sweep=SWEEP,
        method=Method(noise=(0.0,), settings=RecoverSettings(checks=("rigid-parts",))),
    )
    assert of(free)["violations"]["range_excess_deg"] is None
    assert of(free)["survivors"]["mean"] > of(table)["survivors"]["mean"]


def test_cameras_of_a_capture_have_their_own_intrinsics(capture: Capture) -> None:
    sweep = Sweep(yaws=(0.0,), heights=(1.0,), f=800.0, size=(1000, 800), distance=5.0)
    model = of_capture(capture, FEW, sweep, Method(noise=(0.0,))).works[0].view.camera
    assert isinstance(model, OpenCVModel)
    assert model.K.tolist() == [[800, 0, 500], [0, 800, 400], [0, 0, 1]]
    assert model.size == (1000, 800)
