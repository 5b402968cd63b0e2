"""A learned lifter's forward pass, for its time alone: its weights are random, so its answers mean nothing.

The layers of Martinez et al. 2017, "A simple yet effective baseline for 3d human pose estimation": 32 numbers in,
1024 wide, two residual blocks of two layers with batch normalisation and ReLU, 48 numbers out; 4.3 million weights. It
gives one posture a view, where the tree gives all that are possible. PyTorch on the processor, one thread; where it is
missing the same layers in NumPy, in single precision.
"""

from __future__ import annotations

from collections.abc import Callable
from importlib import import_module, util
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

LAYER_SIZES = ((32, 1024), (1024, 1024), (1024, 1024), (1024, 1024), (1024, 1024), (1024, 48))
N_RUNS = 20


class Lifter(NamedTuple):
    """A lifter: its name, what runs it over `views` views, and what is to be said of it."""

    name: str
    run: Callable[[], object]
    views: int
    note: str = ""


def make_lifter(batch: int, image: NDArray[np.float64]) -> Lifter:
    """Make a lifter that takes views in batches.

    Parameters
    ----------
    batch : int
    image : array (F, 14, 2)
        Image points, of as many views as there are; two more joints are left at zero.
    """
    points = np.zeros((batch, 32), dtype=np.float32)
    flat = np.nan_to_num(image.reshape(len(image), -1))[:batch]
    points[: len(flat), : flat.shape[1]] = flat / max(float(np.abs(flat).max(initial=0.0)), 1.0)
    if util.find_spec("torch") is not None:
        return Lifter(f"lifter, PyTorch, {batch} a call", _torch(points), N_RUNS * batch)
    note = "PyTorch is not installed: the lifter's layers ran in NumPy, with NumPy's own threads"
    return Lifter(f"lifter, NumPy, {batch} a call", _numpy(points), N_RUNS * batch, note)


def _torch(points: NDArray[np.float32]) -> Callable[[], object]:
    torch: Any = import_module("torch")
    torch.set_num_threads(1)
    torch.manual_seed(0)
    nn = torch.nn

    def block(size_in: int, size_out: int) -> Any:
        return nn.Sequential(
            nn.Linear(size_in, size_out), nn.BatchNorm1d(size_out), nn.ReLU(), nn.Dropout(0.5)
        )

    first, *blocks, last = LAYER_SIZES
    layers = [block(*first).eval(), *(block(*size).eval() for size in blocks), nn.Linear(*last).eval()]
    given = torch.from_numpy(points)

    def run() -> object:
        with torch.inference_mode():
            for _ in range(N_RUNS):
                x = layers[0](given)
                for k in (1, 3):
                    x = x + layers[k + 1](layers[k](x))
                out = layers[-1](x)
        return out

    return run


def _numpy(points: NDArray[np.float32]) -> Callable[[], object]:
    rng = np.random.default_rng(0)
    weights = [rng.normal(0, 0.02, size).astype(np.float32) for size in LAYER_SIZES]
    scales = [np.ones(size[1], dtype=np.float32) for size in LAYER_SIZES]

    def layer(x: NDArray[np.float32], k: int) -> NDArray[np.float32]:
        y: NDArray[np.float32] = x @ weights[k]
        y *= scales[k]
        np.maximum(y, 0, out=y)
        return y

    def run() -> object:
        for _ in range(N_RUNS):
            x = layer(points, 0)
            for k in (1, 3):
                x = x + layer(layer(x, k), k + 1)
            out = x @ weights[-1]
        return out

    return run
