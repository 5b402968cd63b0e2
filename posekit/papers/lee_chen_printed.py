"""What Lee & Chen 1985 print: Tables 2, 3, 4 and A.2(b), and what §4.2 says of frame 1."""

from __future__ import annotations

from typing import Final

import numpy as np

PRINTED_FRAMES: Final = (1, 3, 5)

IMAGE_A2: Final = np.array(
    [
        [-0.00024, 0.59320],
        [-0.00025, 0.70944],
        [-0.06329, 0.74631],
        [0.06280, 0.74631],
        [-0.09680, 0.68273],
        [0.09631, 0.68273],
    ]
)
"""Table A.2(b), centimetres on the image plane, y up: neck, nose, right eye, left eye, right ear, left ear."""

T: Final = np.array(
    [
        [0.00003, -0.00002, -0.20000],
        [0.00000, 0.99999, 0.00001],
        [-1.00000, -0.00001, -0.00001],
        [-0.02061, 0.00085, 80.99937],
    ]
)
"""Table 2(a)."""

R: Final = np.array(
    [[0.00003, -0.00002, 1.00001], [0.00000, 0.99999, -0.00004], [-1.00000, -0.00001, 0.00007]]
)
"""Table 2(b)."""

PRINTED_POSITION: Final = np.array([400.00116, -0.01535, 0.00595])
"""Table 2(c), centimetres."""

PRINTED_HEAD: Final = np.array(
    [
        [-0.00499, 52.12662, 434.17551],
        [-0.00485, 61.62641, 429.17581],
        [-5.50490, 65.12637, 431.17560],
        [5.49510, 65.12647, 431.17633],
        [-8.50501, 60.12647, 435.17526],
        [8.49499, 60.12663, 435.17639],
    ]
)
"""Table 2(d), centimetres, the paper's camera frame."""

PRINTED_PHYSICAL: Final = {
    "seq1": (
        (1, 2, 4, 4, 4, 8, 16, 32, 48, 48, 48, 96, 192, 192),
        (1, 2, 2, 2, 2, 4, 8, 16, 24, 24, 24, 48, 96, 96),
        (1, 2, 4, 4, 4, 8, 12, 24, 32, 40, 40, 40, 80, 80),
    ),
    "seq2": (
        (1, 2, 2, 2, 2, 2, 3, 6, 8, 11, 22, 44, 44, 44),
        (1, 2, 2, 2, 2, 2, 2, 4, 6, 8, 16, 32, 32, 32),
        (1, 1, 1, 1, 1, 1, 1, 2, 2, 4, 4, 8, 8, 8),
    ),
}
"""Tables 3 and 4, after the physical constraints: by frame 1, 3, 5, then by level."""

PRINTED_MOTION: Final = {
    "seq1": (
        (1, 2, 4, 4, 4, 8, 8, 8, 16, 16, 16, 16, 32, 32),
        (1, 2, 2, 2, 2, 4, 6, 6, 10, 10, 10, 10, 20, 20),
        (1, 2, 4, 4, 4, 8, 8, 12, 18, 24, 28, 28, 28, 28),
    ),
    "seq2": (
        (1, 2, 2, 2, 2, 2, 3, 3, 4, 6, 6, 6, 6, 6),
        (1, 2, 2, 2, 2, 2, 2, 2, 3, 5, 5, 5, 5, 5),
        (1, 1, 1, 1, 1, 1, 1, 2, 2, 4, 4, 4, 4, 4),
    ),
}
"""Tables 3 and 4, after Rules 1 and 2 too."""

PRINTED_FINAL: Final = {"seq1": (32, 16, 2), "seq2": (6, 6, 1)}
"""Frame 1 after Rules 1-2, after grouping, after Rules 3-5 (§4.2)."""

TABLE_1: Final = {
    "shoulder.flexion": (-50.0, 180.0),
    "shoulder.abduction": (-50.0, 180.0),
    "elbow.flexion": (0.0, 160.0),
    "hip.flexion": (-40.0, 120.0),
    "hip.flexion_with_straight_knee": (-40.0, 90.0),
    "hip.abduction": (-30.0, 45.0),
    "knee.flexion": (0.0, 130.0),
    "pelvis.flexion": (-30.0, 75.0),
    "pelvis.rotation": (-30.0, 30.0),
    "pelvis.bending": (-35.0, 35.0),
    "neck.flexion": (-55.0, 45.0),
    "neck.rotation": (-70.0, 70.0),
    "neck.bending": (-40.0, 40.0),
}
"""Table 1, degrees: extension and adduction are the negative sides of flexion and abduction."""

TABLE_A1: Final = {
    ("neck", "right_shoulder"): 20.5,
    ("neck", "left_shoulder"): 20.5,
    ("neck", "pelvis"): 46.3,
    ("right_shoulder", "pelvis"): 50.2,
    ("left_shoulder", "pelvis"): 50.2,
    ("right_shoulder", "left_shoulder"): 40.3,
    ("right_shoulder", "right_elbow"): 30.0,
    ("left_shoulder", "left_elbow"): 30.0,
    ("right_elbow", "right_wrist"): 26.0,
    ("left_elbow", "left_wrist"): 26.0,
    ("pelvis", "right_hip"): 19.0,
    ("pelvis", "left_hip"): 19.0,
    ("right_hip", "left_hip"): 32.2,
    ("right_hip", "right_knee"): 38.0,
    ("left_hip", "left_knee"): 38.0,
    ("right_knee", "right_ankle"): 37.0,
    ("left_knee", "left_ankle"): 37.0,
}
"""Table A.1, centimetres."""
