"""What cameras and placements are made with: the last value that is taken, and the first that is refused, of each."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from posekit.cameras import PinholeCamera, ScaledOrthographicCamera, lee_chen
from posekit.cameras.calibrated import CalibratedCamera
from posekit.cameras.guesses import camera_from_focal35, camera_from_fov
from posekit.cameras.head import TABLE_A2
from posekit.cameras.head.sighting import sight
from posekit.cameras.neck.given import NeckSettings, PlacementInput
from posekit.cameras.rotation import rotation_from_given_vector, rotation_from_rounded, rotation_from_wxyz
from posekit.errors import PosekitError

K = np.array([[900.0, 0.0, 640.0], [0.0, 900.0, 360.0], [0.0, 0.0, 1.0]])
LEAST = float(np.finfo(np.float64).smallest_subnormal)
BELOW_1, ABOVE_180 = float(np.nextafter(1.0, 0.0)), float(np.nextafter(180.0, 0.0))
NO_NUMBERS = (np.nan, np.inf, -np.inf)


def changed(row: int, column: int, value: float) -> np.ndarray:
    other = K.copy()
    other[row, column] = value
    return other


def lens(**given: Any) -> object:
    return CalibratedCamera(**({"name": "lens", "K": K} | given))


def placed(frames: int = 3, camera: Any = None, root: Any = None, head: Any = None, **given: Any) -> object:
    image = np.full((frames, 14, 2), 5.0)
    return PlacementInput.checked(camera or PinholeCamera(K=K), image, head, root, NeckSettings(**given))


SIZES: tuple[tuple[Any, ...], tuple[Any, ...]] = (
    ((1, 1), (10**6, 1), (1, 10**6)),
    ((0, 1), (1, 0), (10**6 + 1, 1), (1, 10**6 + 1), (1,), (1, 1, 1), (1.0, 1), (1, 1.5), (-1, 1)),
)
ROOTS = np.tile([0.0, 0.0, LEAST], (3, 1))
FLAT = np.tile([0.0, 0.0, 0.0], (3, 1))
CASES: dict[str, tuple[Callable[[Any], object], tuple[Any, ...], tuple[Any, ...]]] = {
    "f of K": (
        lambda K: PinholeCamera(K=K),
        (changed(0, 0, LEAST), changed(1, 1, LEAST), changed(0, 1, -7.0), np.tile(K, (2, 1, 1))),
        (
            *(changed(k, k, value) for k in (0, 1) for value in (0.0, -1.0, *NO_NUMBERS)),
            *(changed(2, k, value) for k in (0, 1, 2) for value in (LEAST, -1e-9, BELOW_1)),
            changed(1, 0, LEAST),
            np.array([K, changed(1, 1, 0.0)]),
            K[:2],
            np.ones(9),
            np.tile(K, (2, 2, 1, 1)),
        ),
    ),
    "distortion": (
        lambda k: PinholeCamera(K=K, distortion=np.array(k)),
        ([1e9, -1e9, 0.0, 0.0, 0.0],),
        ([np.nextafter(1e9, 2e9), 0, 0, 0, 0], [np.nan, 0, 0, 0, 0], [0.0] * 4, [0.0] * 6, [[0.0] * 5]),
    ),
    "coefficients": (
        lambda k: lens(distortion=k),
        ([], [1e9] * 4, [0.0] * 5, [0.0] * 8, [0.0] * 12, [0.0] * 14),
        ([0.0] * 3, [0.0] * 6, [0.0] * 13, [0.0] * 15, [np.nan] * 4, [2e9, 0, 0, 0]),
    ),
    "fisheye": (lambda k: lens(distortion=k, fisheye=True), ([], [0.0] * 4), ([0.0] * 5, [0.0] * 8, [np.inf] * 4)),
    "K": (lambda K: lens(K=K), (K,), (K[:2], np.tile(K, (2, 1, 1)), changed(0, 0, 0.0))),
    "R": (lambda R: lens(R=R), (None, np.eye(3)), (np.eye(2), -np.eye(3), 2 * np.eye(3), np.full((3, 3), np.nan))),
    "t": (lambda t: lens(t=t), (None, [0, 0, 0], [[1], [2], [3]]), ([0, 0], [0, 0, np.nan], [np.inf, 0, 0], [0] * 4)),
    "size": (lambda size: lens(size=size), (None, *SIZES[0]), SIZES[1]),
    "up": (lambda up: lens(up=up), ("", "+x", "-z"), ("x", "+w", "z-")),
    "deviation": (lambda d: lens(deviation=d), (0.0, BELOW_1), (-LEAST, 1.0, *NO_NUMBERS)),
    "fov": (lambda a: camera_from_fov((64, 48), a), (1e-6, 179.9), (0.0, -1.0, 180.0, 181.0, *NO_NUMBERS)),
    "fov size": (lambda size: camera_from_fov(size, 60.0), SIZES[0], SIZES[1]),
    "fov axis": (
        lambda axis: camera_from_fov((64, 48), 60.0, axis),
        ("diagonal", "horizontal", "vertical"),
        ("", "across"),
    ),
    "mm": (
        lambda mm: camera_from_focal35((64, 48), mm),
        (1e-6, 1e4),
        (0.0, -1.0, np.nextafter(1e4, 2e4), *NO_NUMBERS),
    ),
    "mm size": (lambda size: camera_from_focal35(size, 50.0), SIZES[0], SIZES[1]),
    "scale": (
        lambda s: ScaledOrthographicCamera(scale=s),
        (LEAST, 1e300, np.array([1.0, 2.0])),
        (0.0, -1.0, *NO_NUMBERS, np.array([1.0, 0.0]), np.array([1.0, np.inf]), np.ones((1, 1))),
    ),
    "aspect": (
        lambda a: ScaledOrthographicCamera(scale=1.0, aspect=a),
        (LEAST, 1e300),
        (0.0, -1.0, *NO_NUMBERS),
    ),
    "f of the paper": (
        lee_chen.pinhole,
        (LEAST, np.array([1.0, 2.0])),
        (0.0, -1.0, *NO_NUMBERS, np.array([1.0, 0.0])),
    ),
    "vector": (
        rotation_from_given_vector,
        ([0.0, 0.0, 0.0], [[1.0], [2.0], [3.0]]),
        ([0.0, 0.0], [0.0] * 4, [np.nan, 0.0, 0.0], [0.0, 0.0, np.inf], []),
    ),
    "quaternion": (
        rotation_from_wxyz,
        ([1.0, 0.0, 0.0, 0.0], [1.0009, 0.0, 0.0, 0.0]),
        ([1.0011, 0.0, 0.0, 0.0], [0.9989, 0.0, 0.0, 0.0], [np.nan, 0.0, 0.0, 1.0], [0.0] * 4),
    ),
    "matrix": (
        rotation_from_rounded,
        (np.eye(3), np.diag([1.0, -1.0, -1.0]), 1.0004 * np.eye(3)),
        (1.0006 * np.eye(3), np.diag([1.0, 1.0, -1.0]), np.eye(3)[:2], np.eye(4), np.diag([np.nan, 1, 1]), np.ones(9)),
    ),
    "image of a head": (
        lambda image: sight(TABLE_A2, image),
        (np.zeros((6, 2)), np.full((3, 6, 2), np.nan), np.zeros((0, 6, 2))),
        (np.zeros((5, 2)), np.zeros((6, 3)), np.zeros((1, 1, 6, 2)), np.zeros(12), np.full((6, 2), -np.inf)),
    ),
    "cameras": (
        lambda count: placed(camera=PinholeCamera(K=np.tile(K, (count, 1, 1)))),
        (3,),
        (1, 2, 4),
    ),
    "root": (
        lambda root: placed(root=root),
        (None, ROOTS, np.full((3, 3), np.nan)),
        (FLAT, -ROOTS, ROOTS[:2], np.full((3, 3), np.inf)),
    ),
    "head": (lambda head: placed(head=head), (np.zeros((3, 5, 2)),), (np.zeros((2, 5, 2)), np.zeros((3, 4, 2)))),
    "tolerance": (lambda value: placed(tolerance=value), (None, 0.0), (-LEAST, *NO_NUMBERS)),
    "tangent": (lambda value: placed(tangent=value), (0.0, 1.0), (-LEAST, *NO_NUMBERS)),
    "reach": (lambda value: placed(reach=value), (1e-6, 1.0), (float(np.nextafter(1e-6, 0.0)), 0.0, *NO_NUMBERS)),
    "most": (lambda value: placed(most=value), (1, 12), (0, -1)),
    "pixels off": (lambda value: placed(deviation=value), (0.0, np.ones(19)), (-LEAST, *NO_NUMBERS, np.ones(18))),
    "metres off": (lambda value: placed(offset=value), (0.0, np.ones(19)), (-LEAST, *NO_NUMBERS, np.ones(14))),
}  # fmt: skip


TAKEN, REFUSED = (
    [
        pytest.param(make, value, id=f"{name} {k}")
        for name, make, values in side
        for k, value in enumerate(values)
    ]
    for side in (
        [(name, make, taken) for name, (make, taken, _) in CASES.items()],
        [(name, make, refused) for name, (make, _, refused) in CASES.items()],
    )
)


@pytest.mark.parametrize(("make", "value"), TAKEN)
def test_the_last_value_is_taken(make: Callable[[Any], object], value: Any) -> None:
    make(value)


@pytest.mark.parametrize(("make", "value"), REFUSED)
def test_the_first_value_beyond_is_refused_in_one_line(make: Callable[[Any], object], value: Any) -> None:
    with pytest.raises(PosekitError) as refused:
        make(value)
    assert len(str(refused.value).splitlines()) == 1
