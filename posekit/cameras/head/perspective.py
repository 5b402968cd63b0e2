r"""How a head looks in the image: the model that is fitted, and its derivatives.

With the points centred and of size 1, :math:`q = R\,(p - c) / \sigma`, and the head's centre at depth
:math:`z`, their perspective image is

.. math:: u = \frac{a + s\,q_{xy}}{1 + d\,q_z}, \qquad s = f \sigma / z, \quad d = \sigma / z,

where :math:`a` is the image of the centre. Written so, the unknowns :math:`R, a, s, d` are each seen in the
image and the limit of a far camera, :math:`d = 0`, is an ordinary place (the scaled orthographic projection),
while depth and f alone would run to infinity together. With f free there are seven unknowns; with known
intrinsics :math:`u` is the normalised image (f = 1), :math:`d = s`, and six.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from posekit.geometry import Array, rotation_from_vector


class Heads(NamedTuple):
    """What is known of F heads.

    Attributes
    ----------
    points : array (F, P, 3)
        Centred on the seen points and scaled to their size; 0 where not seen.
    image : array (F, P, 2)
        Image points, image units (pixels with K); 0 where not seen.
    seen : array (F, P)
        1 where a point counts, else 0.
    K : array (F, 3, 3) or None
        Intrinsics; None where f is free.
    distortion : array (5,) or None
        Brown's coefficients, as `posekit.cameras.PinholeCamera` has them.
    side : array (F,)
        With K: 1 for heads in front of the camera, -1 for heads behind it.
    """

    points: Array
    image: Array
    seen: Array
    K: Array | None
    distortion: Array | None
    side: Array

    def take(self, index: NDArray[np.intp] | NDArray[np.bool_]) -> Heads:
        """Select heads."""
        K = None if self.K is None else self.K[index]
        return Heads(
            self.points[index], self.image[index], self.seen[index], K, self.distortion, self.side[index]
        )

    @property
    def unknowns(self) -> int:
        """The number of unknowns."""
        return 7 if self.K is None else 6


class HeadPlacement(NamedTuple):
    """The unknowns: R (F, 3, 3), shift a (F, 2), scale s (F,) and slope d (F,)."""

    R: Array
    shift: Array
    scale: Array
    slope: Array

    def take(self, index: NDArray[np.intp] | NDArray[np.bool_]) -> HeadPlacement:
        """Select placements."""
        return HeadPlacement(*(array[index] for array in self))

    def put(self, index: NDArray[np.intp] | NDArray[np.bool_], other: HeadPlacement) -> None:
        """Overwrite placements."""
        for array, values in zip(self, other, strict=True):
            array[index] = values

    def moved(self, step: Array, heads: Heads) -> HeadPlacement:
        """Add steps (F, 6 or 7): a rotation vector in the camera's frame, shift, scale, and slope if free."""
        scale = self.scale + step[:, 5]
        slope = self.slope + step[:, 6] if heads.K is None else heads.side * scale
        return HeadPlacement(
            rotation_from_vector(step[:, :3]) @ self.R, self.shift + step[:, 3:5], scale, slope
        )


def look(heads: Heads, placement: HeadPlacement) -> tuple[Array, Array, NDArray[np.bool_]]:
    """Compare a placement with the image.

    Returns
    -------
    residual : array (F, 2P)
        Projection less image point, 0 where a point does not count: u of every point, then v.
    jacobian : array (F, 2P, 6 or 7)
        Its derivative by `HeadPlacement.moved`'s step.
    possible : bool array (F,)
        Whether every point is on its side of the camera.
    """
    q = heads.points @ np.swapaxes(placement.R, -1, -2)
    x, y, z = q[..., 0], q[..., 1], q[..., 2]
    scale, slope = placement.scale[:, None], placement.slope[:, None]
    depth = 1.0 + slope * z
    possible = (depth > 0).all(axis=-1) & (placement.scale > 0)
    inverse = heads.seen / np.where(depth > 0, depth, 1.0)
    u = (placement.shift[:, :1] + scale * x) * inverse
    v = (placement.shift[:, 1:] + scale * y) * inverse
    count = z.shape[1]
    jacobian = np.zeros((len(z), 2 * count, heads.unknowns))
    of_u, of_v = jacobian[:, :count], jacobian[:, count:]
    near, bend_u, bend_v = scale * inverse, u * slope * inverse, v * slope * inverse
    of_u[..., 0] = -bend_u * y
    of_u[..., 1] = near * z + bend_u * x
    of_u[..., 2] = -near * y
    of_v[..., 0] = -near * z - bend_v * y
    of_v[..., 1] = bend_v * x
    of_v[..., 2] = near * x
    of_u[..., 3] = of_v[..., 4] = inverse
    of_u[..., 5] = x * inverse
    of_v[..., 5] = y * inverse
    if heads.K is None:
        of_u[..., 6] = -u * z * inverse
        of_v[..., 6] = -v * z * inverse
    else:
        side = heads.side[:, None]
        of_u[..., 5] -= side * u * z * inverse
        of_v[..., 5] -= side * v * z * inverse
        u, v = _to_pixels(u, v, jacobian, heads.K, heads.distortion)
    residual = np.concatenate(
        [(u - heads.image[..., 0]) * heads.seen, (v - heads.image[..., 1]) * heads.seen], axis=1
    )
    return residual, jacobian, possible


def _to_pixels(
    x: Array, y: Array, jacobian: Array, K: Array, distortion: Array | None
) -> tuple[Array, Array]:
    """Distort normalised points and apply K, changing the jacobian (F, 2P, 6) in place by the chain rule."""
    count = x.shape[1]
    of_x, of_y = jacobian[:, :count], jacobian[:, count:]
    if distortion is not None:
        k1, k2, p1, p2, k3 = distortion
        r2 = x * x + y * y
        radial = 1 + r2 * (k1 + r2 * (k2 + r2 * k3))
        slope = 2 * (k1 + r2 * (2 * k2 + r2 * 3 * k3))
        xx = (radial + x * x * slope + 2 * p1 * y + 6 * p2 * x)[..., None]
        yy = (radial + y * y * slope + 6 * p1 * y + 2 * p2 * x)[..., None]
        xy = (x * y * slope + 2 * p1 * x + 2 * p2 * y)[..., None]
        of_x[:], of_y[:] = xx * of_x + xy * of_y, xy * of_x + yy * of_y
        x, y = (
            x * radial + 2 * p1 * x * y + p2 * (r2 + 2 * x * x),
            y * radial + p1 * (r2 + 2 * y * y) + 2 * p2 * x * y,
        )
    f_x, skew, c_x = K[:, 0, 0, None], K[:, 0, 1, None], K[:, 0, 2, None]
    f_y, c_y = K[:, 1, 1, None], K[:, 1, 2, None]
    of_x *= f_x[..., None]
    of_x += skew[..., None] * of_y
    of_y *= f_y[..., None]
    return f_x * x + skew * y + c_x, f_y * y + c_y
