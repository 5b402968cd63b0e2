"""The configuration space of a Pinocchio model, batched: which joints it has, steps on it and differences."""

from __future__ import annotations

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from posekit.errors import InputError
from posekit.geometry import (
    Array,
    cross,
    dot,
    quaternion_conjugate,
    quaternion_exp,
    quaternion_log,
    quaternion_product,
    quaternion_rotate,
)

HINGE_MODELS = frozenset({"JointModelRX", "JointModelRY", "JointModelRZ", "JointModelRevoluteUnaligned"})
CONTINUOUS_MODELS = frozenset(
    {"JointModelRUBX", "JointModelRUBY", "JointModelRUBZ", "JointModelRevoluteUnboundedUnaligned"}
)
SLIDE_MODELS = frozenset({"JointModelPX", "JointModelPY", "JointModelPZ", "JointModelPrismaticUnaligned"})
FREE_FLYER_MODEL = "JointModelFreeFlyer"

UNIT_LENGTH_ERROR = 1e-6
"""How far a quaternion, or a continuous joint's (cos, sin), may be from unit length."""

SERIES_ANGLE_RADIANS = 1e-2
"""Angle (rad) below which the exponential's and the logarithm's factors are taken from their series."""


class ConfigurationSpace:
    """What q and v of a model are made of.

    Parameters
    ----------
    model : pinocchio.Model
        With fixed or free-flying base, of revolute (along or beside an axis), continuous and prismatic joints.

    Attributes
    ----------
    hinges, slides, turns, free : tuple of int
        Joint indices: revolute; prismatic; continuous, whose two entries of q are cosine and sine; free-flyers.
    bounded_q, bounded_v : int array
        Entries of q and v of hinges and slides, which alone have limits.
    lower, upper : array (nq,)
        Limits from the model, radians and metres; infinite where there are none.

    Raises
    ------
    InputError
        Where a joint is of another kind: planar, spherical, mimic, helical, universal, composite.
    """

    def __init__(self, model: pin.Model) -> None:
        self.nq, self.nv = int(model.nq), int(model.nv)
        kinds: dict[str, list[int]] = {"hinges": [], "slides": [], "turns": [], "free": []}
        for index in range(1, model.njoints):
            kind = model.joints[index].shortname()
            if kind in HINGE_MODELS:
                kinds["hinges"].append(index)
            elif kind in SLIDE_MODELS:
                kinds["slides"].append(index)
            elif kind in CONTINUOUS_MODELS:
                kinds["turns"].append(index)
            elif kind == FREE_FLYER_MODEL:
                kinds["free"].append(index)
            else:
                raise InputError(
                    f"model {model.name!r}: joint {model.names[index]!r} is a {kind.removeprefix('JointModel')}; "
                    "expected revolute, continuous, prismatic, fixed or a free-flyer; replace it by such joints"
                )
        self.hinges, self.slides = tuple(kinds["hinges"]), tuple(kinds["slides"])
        self.turns, self.free = tuple(kinds["turns"]), tuple(kinds["free"])
        bounded = sorted(self.hinges + self.slides)
        self.bounded_q = _indices([model.idx_qs[j] for j in bounded])
        self.bounded_v = _indices([model.idx_vs[j] for j in bounded])
        self.turn_q = _indices([model.idx_qs[j] for j in self.turns])
        self.turn_v = _indices([model.idx_vs[j] for j in self.turns])
        self.free_q = _indices([model.idx_qs[j] for j in self.free])
        self.free_v = _indices([model.idx_vs[j] for j in self.free])
        self.lower, self.upper = np.full(self.nq, -np.inf), np.full(self.nq, np.inf)
        self.lower[self.bounded_q] = model.lowerPositionLimit[self.bounded_q]
        self.upper[self.bounded_q] = model.upperPositionLimit[self.bounded_q]
        for array in (self.lower, self.upper):
            array.flags.writeable = False

    def check(self, q: Array) -> None:
        """Refuse configurations that are not (N, nq), not finite, or whose rotations are not of unit length.

        Raises
        ------
        InputError
            Pinocchio would place a non-rotation without a word.
        """
        if q.ndim != 2 or q.shape[1] != self.nq:
            raise InputError(f"q has shape {q.shape}; expected (N, {self.nq})")
        finite = np.isfinite(q).all(axis=1)
        if not finite.all():
            raise InputError(f"configuration {int(np.argmin(finite))} is not finite; expected numbers")
        for what, starts, first, last in (
            ("the quaternion", self.free_q, 3, 7),
            ("(cos, sin) of a continuous joint", self.turn_q, 0, 2),
        ):
            for start in starts:
                norm = np.linalg.norm(q[:, start + first : start + last], axis=1)
                wrong = np.abs(norm - 1) > UNIT_LENGTH_ERROR
                if wrong.any():
                    row = int(np.argmax(wrong))
                    raise InputError(
                        f"configuration {row}: {what} at q[{start + first}:{start + last}] has length "
                        f"{norm[row]:g}; expected 1; normalise it"
                    )

    def integrate(self, q: Array, dv: Array) -> Array:
        """Take the step dv (N, nv) from q (N, nq): Pinocchio's `integrate`, for a batch.

        A free-flyer moves by the exponential of its twist in its own frame: v linear, then angular.
        """
        out = q.copy()
        out[:, self.bounded_q] += dv[:, self.bounded_v]
        if self.turn_q.size:
            cos, sin = q[:, self.turn_q], q[:, self.turn_q + 1]
            c, s = np.cos(dv[:, self.turn_v]), np.sin(dv[:, self.turn_v])
            length = np.hypot(cos, sin)
            out[:, self.turn_q] = (cos * c - sin * s) / length
            out[:, self.turn_q + 1] = (sin * c + cos * s) / length
        for k, v in zip(self.free_q, self.free_v, strict=True):
            linear, angular = dv[:, v : v + 3], dv[:, v + 3 : v + 6]
            quaternion = q[:, k + 3 : k + 7]
            out[:, k : k + 3] += quaternion_rotate(quaternion, _left_jacobian(angular, linear))
            turned = quaternion_product(quaternion, quaternion_exp(angular))
            # Of the two quaternions of a rotation the one nearer to where the step began, as Pinocchio does.
            turned *= np.where(dot(turned, quaternion) < 0, -1.0, 1.0)[:, None]
            out[:, k + 3 : k + 7] = turned / np.linalg.norm(turned, axis=1, keepdims=True)
        return out

    def difference(self, q_from: Array, q_to: Array) -> Array:
        """Return the step (N, nv) that `integrate` takes from one configuration (N, nq) to another."""
        dv = np.zeros((len(q_from), self.nv))
        dv[:, self.bounded_v] = q_to[:, self.bounded_q] - q_from[:, self.bounded_q]
        if self.turn_q.size:
            a, b = q_from[:, self.turn_q], q_from[:, self.turn_q + 1]
            c, d = q_to[:, self.turn_q], q_to[:, self.turn_q + 1]
            dv[:, self.turn_v] = np.arctan2(a * d - b * c, a * c + b * d)
        for k, v in zip(self.free_q, self.free_v, strict=True):
            back = quaternion_conjugate(q_from[:, k + 3 : k + 7])
            angular = quaternion_log(quaternion_product(back, q_to[:, k + 3 : k + 7]))
            linear = quaternion_rotate(back, q_to[:, k : k + 3] - q_from[:, k : k + 3])
            dv[:, v : v + 3] = _inverse_left_jacobian(angular, linear)
            dv[:, v + 3 : v + 6] = angular
        return dv


def _indices(values: list[int]) -> NDArray[np.intp]:
    return np.array(values, dtype=np.intp)


def _left_jacobian(angular: Array, linear: Array) -> Array:
    """Return V(angular) linear: the translation of the exponential of a twist (Murray, Li & Sastry 1994, eq. 2.36)."""
    squared = dot(angular, angular)[:, None]
    angle = np.sqrt(squared)
    small = angle < SERIES_ANGLE_RADIANS
    safe = np.where(small, 1.0, angle)
    first = np.where(small, 0.5 - squared / 24 + squared**2 / 720, (1 - np.cos(safe)) / safe**2)
    second = np.where(small, 1 / 6 - squared / 120 + squared**2 / 5040, (safe - np.sin(safe)) / safe**3)
    once = cross(angular, linear)
    return np.asarray(linear + first * once + second * cross(angular, once))


def _inverse_left_jacobian(angular: Array, linear: Array) -> Array:
    """Return the solution x of V(angular) x = linear."""
    squared = dot(angular, angular)[:, None]
    angle = np.sqrt(squared)
    small = angle < SERIES_ANGLE_RADIANS
    half = np.where(small, 1.0, angle) / 2
    second = np.where(
        small,
        1 / 12 + squared / 720 + squared**2 / 30240,
        (1 - half * np.cos(half) / np.sin(half)) / (4 * half**2),
    )
    once = cross(angular, linear)
    return np.asarray(linear - 0.5 * once + second * cross(angular, once))
