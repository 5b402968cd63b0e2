"""Short names of published robots: the files of example-robot-data that they stand for."""

from __future__ import annotations

from types import MappingProxyType
from typing import Final

SHORT_NAMES: Final = MappingProxyType(
    {
        "allegro": ("allegro_hand_description/urdf/allegro_right_hand.urdf", ""),
        "anymal": (
            "anymal_b_simple_description/robots/anymal.urdf",
            "anymal_b_simple_description/srdf/anymal.srdf",
        ),
        "anymal_c": (
            "anymal_c_simple_description/urdf/anymal.urdf",
            "anymal_c_simple_description/srdf/anymal.srdf",
        ),
        "anymal_kinova": (
            "anymal_b_simple_description/robots/anymal-kinova.urdf",
            "anymal_b_simple_description/srdf/anymal-kinova.srdf",
        ),
        "asr_twodof": ("asr_twodof_description/urdf/TwoDofs.urdf", ""),
        "b1_z1": ("b1_description/urdf/b1-z1.urdf", "b1_description/srdf/b1-z1.srdf"),
        "g1": ("g1_description/urdf/g1_29dof_rev_1_0.urdf", ""),
        "g1_with_hands": ("g1_description/urdf/g1_29dof_with_hand_rev_1_0.urdf", ""),
        "hector": ("hector_description/robots/quadrotor_base.urdf", ""),
        "hyq": ("hyq_description/robots/hyq_no_sensors.urdf", "hyq_description/srdf/hyq.srdf"),
        "icub": ("icub_description/robots/icub.urdf", "icub_description/srdf/icub.srdf"),
        "icub_reduced": ("icub_description/robots/icub_reduced.urdf", "icub_description/srdf/icub.srdf"),
        "iris": ("iris_description/robots/iris_simple.urdf", ""),
        "kinova": ("kinova_description/robots/kinova.urdf", "kinova_description/srdf/kinova.srdf"),
        "romeo": ("romeo_description/urdf/romeo.urdf", ""),
        "solo8": ("solo_description/robots/solo.urdf", "solo_description/srdf/solo.srdf"),
        "solo12": ("solo_description/robots/solo12.urdf", "solo_description/srdf/solo.srdf"),
        "talos": ("talos_data/robots/talos_reduced.urdf", "talos_data/srdf/talos.srdf"),
        "talos_arm": ("talos_data/robots/talos_left_arm.urdf", "talos_data/srdf/talos.srdf"),
        "talos_box": ("talos_data/robots/talos_reduced_box.urdf", "talos_data/srdf/talos.srdf"),
        "talos_full": ("talos_data/robots/talos_full_v2.urdf", "talos_data/srdf/talos.srdf"),
        "talos_full_box": ("talos_data/robots/talos_full_v2_box.urdf", "talos_data/srdf/talos.srdf"),
        "ur3": ("ur_description/urdf/ur3_robot.urdf", ""),
        "ur3_limited": ("ur_description/urdf/ur3_joint_limited_robot.urdf", ""),
        "ur5": ("ur_description/urdf/ur5_robot.urdf", "ur_description/srdf/ur5.srdf"),
        "ur5_limited": ("ur_description/urdf/ur5_joint_limited_robot.urdf", "ur_description/srdf/ur5.srdf"),
        "ur10": ("ur_description/urdf/ur10_robot.urdf", ""),
        "ur10_limited": ("ur_description/urdf/ur10_joint_limited_robot.urdf", ""),
    }
)
"""Name to URDF and SRDF, below ``example-robot-data/robots``; no SRDF is an empty text.

Names and pairs of files are those of ``robots_loader.py`` in the repository Gepetto/example-robot-data, which
the wheel leaves out; ``allegro``, ``g1`` and ``g1_with_hands`` are ours. Every other URDF has its file's name
without the suffix, and the SRDF of that name.
"""
