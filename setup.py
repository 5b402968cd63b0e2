"""Build the compiled solver and tree; without a compiler, their NumPy references are used."""

from pybind11.setup_helpers import Pybind11Extension
from setuptools import setup

setup(
    ext_modules=[
        Pybind11Extension(
            f"posekit.{room}._compiled",
            [f"posekit/{room}/{room}.cpp"],
            depends=["posekit/solver/limits.hpp"],
            cxx_std=17,
            extra_compile_args=["-O3", "-fno-math-errno", "-pthread"],
            extra_link_args=["-pthread"],
            optional=True,
        )
        for room in ("solver", "tree")
    ]
)
