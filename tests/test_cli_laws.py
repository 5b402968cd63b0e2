"""A command does what the function of its name does, prints its numbers, and hands every option on."""

from __future__ import annotations

import json
import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import posekit
from posekit.cli.recover import probability
from posekit.settings import RecoverSettings, ValidateSettings
from tests.test_cli import folder, run
from tests.test_report_validate import clip

__all__ = ["folder", "run"]  # fixtures


def test_validate_prints_and_writes_the_report_of_the_function(run: Any, tmp_path: Path) -> None:
    posekit.save(clip(broken=slice(20, 26)), tmp_path / "bad.npz")
    posekit.save(clip(), tmp_path / "good.npz")
    files = [str(tmp_path / name) for name in ("bad.npz", "good.npz")]
    code, out, _ = run("validate", *files, "-o", str(tmp_path / "report.json"), "--checks", "joint-range")
    report = posekit.validate(files, checks="joint-range")
    printed, _, following = out.partition("next: ")
    assert code == 1 and printed.strip() == report.summary().strip()
    assert following.startswith("the same command with --repair repaired/")
    written = posekit.open(tmp_path / "report.json").table()
    for name, column in report.table().items():
        np.testing.assert_array_equal(written[name], column)
    bad = posekit.validate(files[0], checks="joint-range")
    lines = dict(re.findall(r"^(joint-range)\s+(\d+ \([\d.]+%\))", out, flags=re.M))
    assert lines == {"joint-range": f"{int(bad.invalid.sum())} ({bad.invalid.sum() / 120:.1%})"}


def test_kept_and_repaired_clips_decide_the_exit_code(run: Any, tmp_path: Path) -> None:
    posekit.save(clip(broken=slice(20, 26)), tmp_path / "bad.npz")
    (tmp_path / "text.bvh").write_text("HIERARCHY\nnothing", encoding="utf-8")
    bad = str(tmp_path / "bad.npz")
    code, out, _ = run("validate", bad, "--repair", str(tmp_path / "mended.npz"))
    assert code == 0 and "repaired: keep 1 of 1 clip" in out and "next:" not in out
    assert "--repair bad.repaired.npz" in run("validate", bad)[1]
    assert posekit.validate(tmp_path / "mended.npz").ok.all()
    assert run("validate", bad, str(tmp_path / "text.bvh"))[0] == 2
    code, out, _ = run("validate", bad, "--keep", str(tmp_path / "kept"), "--keep-spans", "0.5")
    assert code == 1 and "1 of 1 clip kept" in out
    good = posekit.validate(bad).clips[0].good
    assert good is not None
    assert len(posekit.open(tmp_path / "kept" / "bad.npz")) == good[1] - good[0] + 1


def test_recover_prints_what_it_found(run: Any, tmp_path: Path) -> None:
    code, out, _ = run(
        "recover", "walk.json", "-o", str(tmp_path / "found.json"), "--follow", "2", "--explain"
    )
    found = posekit.recover("walk.json", follow=2)
    written = posekit.open(tmp_path / "found.json")
    np.testing.assert_allclose(written.survivors.joints, found.survivors.joints, atol=1e-6)
    counts = [len(found[k]) for k in range(len(found))]
    differ = [len(rows) for rows in found.answer.representatives]
    assert code == 0 and f"found.json: {sum(counts)} postures in {len(counts)} frames" in out
    sure = float(np.nanmedian(found.answer.sure))
    text = f"{sure:.2f}" if sure >= 0.01 else "less than 0.01"
    assert f"{int(np.median(counts))} postures, {int(np.median(differ))} that differ" in out
    assert f"with probability {text}" in out
    assert found.path is not None
    assert f"likeliest path through the frames: probability {found.path.probability[0]:.2f}" in out
    lost: dict[str, int] = {}
    for one in found.frames.rejected:
        for reason, count in one.items():
            lost[reason] = lost.get(reason, 0) + count
    listed = re.findall(r"^ +(\d+)  (\S+)$", out, flags=re.M)
    assert {reason: int(count) for count, reason in listed} == lost
    assert [int(count) for count, _ in listed] == sorted(lost.values(), reverse=True)


def test_frames_without_a_posture_are_counted_with_their_reason(run: Any, tmp_path: Path) -> None:
    view = json.loads(Path("walk.json").read_text(encoding="utf-8"))
    image = view["frames"][1]["image"]
    image["left_wrist"] = [2 * a - b for a, b in zip(image["left_wrist"], image["right_ankle"], strict=True)]
    (tmp_path / "odd.json").write_text(json.dumps(view), encoding="utf-8")
    code, out, _ = run("recover", str(tmp_path / "odd.json"), "-o", str(tmp_path / "found.json"))
    assert code == 0 and "1 of 5 frames empty: " in out, out


@pytest.mark.parametrize("name", ["validate", "convert", "render", "inspect", "recover", "evaluate"])
def test_only_commands_about_configurations_ask_for_a_robot(run: Any, name: str) -> None:
    _, out, _ = run(name, "--help")
    assert ("--urdf" in out) is (name not in ("recover", "evaluate"))
    assert all(option in out for option in ("--unit", "--up", "--rate")) or name in ("render", "recover")


def test_a_line_that_cannot_be_read_ends_following_unless_it_is_to_go_on(run: Any) -> None:
    image = posekit.open("walk.json").image[0] * 1000 + 500
    good = json.dumps({"time": 0.0, "points": image.tolist()})
    later = good.replace('"time": 0.0', '"time": 0.1')
    words = ("follow", "--stdin", "--size", "1280x720", "--stature", "175cm")
    lines = f"{good}\nno JSON\n{later}\n"
    code, out, err = run(*words, stdin=lines)
    assert code == 2 and len(out.splitlines()) <= 1 and "no JSON" in err
    code, out, _ = run(*words, "--keep-going", stdin=lines)
    answers = [json.loads(line) for line in out.splitlines()]
    errors = [one["error"] for one in answers if "error" in one]
    assert code == 0 and len(errors) == 1 and "no JSON" in errors[0]


# Views


def test_synth_walker_has_the_camera_time_and_noise_that_are_given(run: Any, tmp_path: Path) -> None:
    path = tmp_path / "walk.json"
    away = []
    for distance in (300, 600):
        run("synth", "walker", "-o", str(path), "--camera", f"{distance},0,0", "--frames", "3", "--dt", "0.1")
        view = posekit.open(path)
        assert len(view) == 3 and np.diff(view.time) == pytest.approx(0.1)
        away.append(np.linalg.norm(view.truth[0, 0]))
    assert away[1] - away[0] == pytest.approx(3.0, abs=0.1)
    still = view.image
    run(
        "synth",
        "walker",
        "-o",
        str(path),
        "--camera",
        "600,0,0",
        "--frames",
        "3",
        "--dt",
        "0.1",
        "--noise",
        "0.01",
    )
    noisy = posekit.open(path).image
    assert np.nanstd(noisy - still) == pytest.approx(1e-4, rel=0.3)  # 0.01 cm in metres
    # A cycle lasts 1.346 / sqrt(v) seconds (Boulic et al. 1990).
    for velocity in (0.6, 1.2):
        cycle = ("--velocity", str(velocity), "--dt", str(1.346 / velocity**0.5), "--frames", "3")
        run("synth", "walker", "-o", str(path), *cycle)
        joints = posekit.open(path).truth
        assert np.abs(np.diff(joints, axis=0)).max() < 1e-3
        run("synth", "walker", "-o", str(path), "--phase", "0.5", *cycle)
        assert np.abs(posekit.open(path).truth - joints).max() > 0.1
    backs = []
    for lean in ("0", "10"):
        run("synth", "walker", "-o", str(path), "--lean", lean, "--frames", "1")
        back = posekit.open(path).truth[0, [0, 3]]
        backs.append((back[0] - back[1]) / np.linalg.norm(back[0] - back[1]))
    assert np.degrees(np.arccos(backs[0] @ backs[1])) == pytest.approx(10, abs=0.5)


def test_synth_random_has_the_distance_noise_and_seed_that_are_given(run: Any, tmp_path: Path) -> None:
    images = {}
    for name, words in (
        ("exact", ()),
        ("noisy", ("--noise", "2")),
        ("other", ("--seed", "1")),
    ):
        path = tmp_path / f"{name}.json"
        run("synth", "random", "-o", str(path), "--frames", "20", "--distance", "3,4", *words)
        view = posekit.open(path)
        images[name] = view.image
        assert len(view) == 20
        away = np.linalg.norm(view.truth.mean(axis=1), axis=-1)
        assert (away > 2.7).all() and (away < 4.3).all()
        if name != "noisy":
            np.testing.assert_allclose(view.camera.project(view.truth), view.image, atol=1e-6)
    assert (images["noisy"] - images["exact"]).std() == pytest.approx(2.0, rel=0.1)
    assert not np.allclose(images["other"], images["exact"])
    run("synth", "random", "-o", str(tmp_path / "plain.json"), "--uncalibrated")
    assert not posekit.open(tmp_path / "plain.json").camera.perspective


def test_synth_mocap_stands_where_it_is_put(run: Any, tmp_path: Path) -> None:
    path, motion = tmp_path / "seen.json", posekit.open("walk.npz")
    words = ("--frames", "4", "--dt", "0.1", "--camera", "3,1,1.5")
    assert run("synth", "mocap", "walk.npz", "-o", str(path), *words)[0] == 0
    view = posekit.open(path)
    assert len(view) == 4 and np.diff(view.time) == pytest.approx(0.1)
    rows = np.round((view.time - view.time[0]) * motion.rate).astype(int)
    away = np.linalg.norm(motion.figure_joints[rows] - [3, 1, 1.5], axis=-1)
    np.testing.assert_allclose(np.linalg.norm(view.truth, axis=-1), away, atol=1e-6)


# Settings


@pytest.mark.parametrize("kind", [RecoverSettings, ValidateSettings])
def test_every_setting_is_printed_with_its_default(run: Any, kind: Any) -> None:
    name = "recover" if kind is RecoverSettings else "validate"
    _, out, _ = run("settings", name)
    for field, value in kind().to_json().items():
        assert re.search(rf"^{field} = ", out, flags=re.M) or (value is None and field in out), field
        if isinstance(value, int | float) and not isinstance(value, bool):
            assert re.search(rf"^{field} = {value:g}\b", out, flags=re.M), field


@pytest.mark.parametrize(
    ("kind", "field", "low", "high"),
    [
        (RecoverSettings, "deviation", 0.0, 1000.0),
        (RecoverSettings, "length_deviation", 0.0, 0.3),
        (RecoverSettings, "stature", 0.1, 10.0),
        (RecoverSettings, "coverage", 0.0, 1.0),
        (RecoverSettings, "tangent_tolerance", 0.0, None),
        (RecoverSettings, "group", 0.0, None),
        (RecoverSettings, "follow", 0, None),
        (RecoverSettings, "rigid_tolerance", 0.0, None),
        (ValidateSettings, "angle_tolerance", 0.0, None),
        (ValidateSettings, "noise", 0.0, None),
    ],
)
def test_numbers_of_settings_have_the_bounds_that_are_stated(
    kind: Any, field: str, low: float, high: float | None
) -> None:
    for value in (low, high):
        if value is not None:
            assert getattr(kind(**{field: value}), field) == value
    for value in (low - 1e-6, None if high is None else high + 1e-6):
        if value is not None:
            with pytest.raises(posekit.InputError, match=field):
                kind(**{field: value})


def test_options_win_over_set_and_set_over_a_file(run: Any, tmp_path: Path) -> None:
    (tmp_path / "mine.toml").write_text("coverage = 0.5\nranges = 'urdf'\nfollow = 1\n", encoding="utf-8")
    words = ("--settings", str(tmp_path / "mine.toml"), "--set", "ranges=table1", "--set", "coverage=0.9")
    assert run("recover", "walk.json", "-o", str(tmp_path / "a.json"), *words, "--coverage", "0.95")[0] == 0
    found = posekit.open(tmp_path / "a.json").settings
    assert (found["coverage"], found["ranges"], found["follow"]) == (0.95, "table1", 1)


@pytest.mark.parametrize(
    ("value", "text"), [(0.0, "less than 0.01"), (0.009, "less than 0.01"), (0.012, "0.01"), (0.976, "0.98")]
)
def test_small_probabilities_are_printed_as_a_bound(value: float, text: str) -> None:
    assert probability(value) == text


@pytest.mark.parametrize(
    ("pair", "name", "value"),
    [
        ("infer=false", "infer", False),
        ("infer=True", "infer", True),
        ("refine=none", "refine", None),
        ("refine=FALSE", "refine", False),
        ("length-deviation = 0.02", "length_deviation", 0.02),
        ("coverage=1", "coverage", 1.0),
        ("checks=rigid-parts,collision", "checks", ["rigid-parts", "collision"]),
    ],
)
def test_set_reads_the_kind_of_its_field(
    pair: str, name: str, value: object, run: Any, tmp_path: Path
) -> None:
    code, _, err = run("recover", "walk.json", "-o", str(tmp_path / "a.json"), "--set", pair)
    assert code == 0, err
    found = posekit.open(tmp_path / "a.json").settings[name]
    assert (list(found) if isinstance(value, list) else found) == value
    assert (found is value) or not isinstance(value, bool | None)


@pytest.mark.parametrize(
    ("words", "field", "least"),
    [
        (("walker",), "--frames", 1),
        (("walker",), "--noise", 0),
        (("walker",), "--seed", 0),
        (("walker",), "--dt", 0.001),
        (("random",), "--frames", 1),
        (("mocap", "walk.npz"), "--frames", 1),
        (("object", "panda"), "--frames", 1),
    ],
)
def test_the_least_number_of_an_option_is_accepted_and_the_next_one_refused(
    run: Any, words: tuple[str, ...], field: str, least: float, tmp_path: Path
) -> None:
    command = ("synth", *words, "-o", str(tmp_path / "view.json"))
    small = ("--frames", "1") if field != "--frames" else ()
    code, _, err = run(*command, *small, field, str(least))
    assert code == 0, err
    code, _, err = run(*command, *small, field, str(least - 1))
    assert code == 2 and field in err
