"""The camera of a photograph, from its EXIF data."""

import math
import sys
from collections.abc import Mapping
from pathlib import Path

import pytest
from PIL import Image
from PIL.TiffImagePlugin import IFDRational

from posekit.cameras.guesses import camera_from_focal35
from posekit.errors import InputError
from posekit.formats.cameras import read_cameras, read_exif

FOCAL, FOCAL_35, ORIENTATION, ZOOM = 0x920A, 0xA405, 0x0112, 0xA404
PLANE_X, PLANE_Y, PLANE_UNIT, PIXELS_X, PIXELS_Y = 0xA20E, 0xA20F, 0xA210, 0xA002, 0xA003


def photograph(
    folder: Path, tags: Mapping[int, object], size: tuple[int, int] = (400, 300), orientation: int = 0
) -> Path:
    path = folder / "photo.jpg"
    exif = Image.Exif()
    if orientation:
        exif[ORIENTATION] = orientation
    exif.get_ifd(0x8769).update(tags)
    Image.new("RGB", size).save(path, exif=exif)
    return path


def test_the_equivalent_is_taken(tmp_path: Path) -> None:
    camera = read_exif(photograph(tmp_path, {FOCAL_35: 26}))
    assert camera.K[0, 0] == pytest.approx(500 * 26 / math.hypot(36, 24))
    assert camera.K.tolist() == camera_from_focal35((400, 300), 26).K.tolist()
    assert camera.size == (400, 300) and camera.name == "photo"
    assert camera.deviation == 0.05 and "EXIF" in camera.how and "26 mm" in camera.how
    assert list(read_cameras(tmp_path / "photo.jpg")) == ["photo"]


@pytest.mark.parametrize("orientation", range(9))
def test_the_size_is_that_of_the_upright_picture(orientation: int, tmp_path: Path) -> None:
    camera = read_exif(photograph(tmp_path, {FOCAL_35: 26}, orientation=orientation))
    assert camera.size == ((300, 400) if orientation in (5, 6, 7, 8) else (400, 300))
    assert camera.size is not None and camera.K[0, 2] == (camera.size[0] - 1) / 2


def test_a_sensors_resolution_will_do(tmp_path: Path) -> None:
    # 400 pixels at 100 a millimetre: a sensor of 4 x 3 mm, 5 mm across.
    tags = {FOCAL: IFDRational(6), PLANE_X: IFDRational(2540), PLANE_Y: IFDRational(2540), PLANE_UNIT: 2}
    tags |= {PIXELS_X: 400, PIXELS_Y: 300}
    assert read_exif(photograph(tmp_path, tags)).K[0, 0] == pytest.approx(600.0)
    # The picture was made smaller afterwards: the angle stays.
    assert read_exif(photograph(tmp_path, tags, (200, 150))).K[0, 0] == pytest.approx(300.0)


def test_what_makes_it_doubtful_is_said(tmp_path: Path) -> None:
    zoomed = read_exif(photograph(tmp_path, {FOCAL_35: 26, ZOOM: IFDRational(3, 2)}))
    assert zoomed.deviation == pytest.approx(1 / 3) and "digital zoom 1.5" in zoomed.how
    cut = read_exif(photograph(tmp_path, {FOCAL_35: 26, PIXELS_X: 4000, PIXELS_Y: 1500}))
    assert cut.deviation == 0.2 and "cut from 4000 x 1500" in cut.how
    turned = read_exif(photograph(tmp_path, {FOCAL_35: 26, PIXELS_X: 3000, PIXELS_Y: 4000}))
    assert turned.deviation == 0.05


@pytest.mark.parametrize(
    "tags",
    [
        {},
        {FOCAL: IFDRational(4)},
        {FOCAL_35: 0},
        {FOCAL: IFDRational(4), PLANE_X: IFDRational(2540), PLANE_UNIT: 9, PIXELS_X: 400, PIXELS_Y: 300},
        {FOCAL: IFDRational(4), PLANE_X: IFDRational(1, 1000), PIXELS_X: 400, PIXELS_Y: 300},
    ],
)
def test_without_an_angle_of_view_it_is_refused(tags: dict[int, object], tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"photo.jpg: EXIF focal length.*angle of view"):
        read_exif(photograph(tmp_path, tags))


def test_a_damaged_photograph_is_refused_or_read(tmp_path: Path) -> None:
    whole = photograph(tmp_path, {FOCAL_35: 26}, orientation=6).read_bytes()
    path = tmp_path / "cut.jpg"
    for length in range(1, min(len(whole), 400), 3):
        path.write_bytes(whole[:length])
        try:
            read_exif(path)
        except InputError as error:
            assert "\n" not in str(error)
    for place in range(2, 160):
        path.write_bytes(whole[:place] + bytes([whole[place] ^ 0xFF]) + whole[place + 1 :])
        try:
            read_exif(path)
        except InputError as error:
            assert "\n" not in str(error)
    path.write_bytes(b"not a picture")
    with pytest.raises(InputError, match="photograph"):
        read_exif(path)
    with pytest.raises(InputError, match="No such file"):
        read_exif(tmp_path / "none.jpg")


def test_without_pillow_one_line_says_what_to_install(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = photograph(tmp_path, {FOCAL_35: 26})
    monkeypatch.setitem(sys.modules, "PIL.Image", None)
    with pytest.raises(InputError, match=r"pip install 'posekit\[pictures\]'"):
        read_exif(path)
