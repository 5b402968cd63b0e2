"""Build the compiled solver where there is a compiler; without one posekit installs and uses its NumPy reference."""

from pybind11.setup_helpers import Pybind11Extension
from setuptools import setup

setup(
    ext_modules=[
        Pybind11Extension(
            "posekit.solver._compiled",
            ["posekit/solver/solver.cpp"],
            depends=["posekit/solver/limits.hpp"],
            cxx_std=17,
            extra_compile_args=["-O3", "-fno-math-errno", "-pthread"],
            extra_link_args=["-pthread"],
            optional=True,
        )
    ]
)
