# SPDX-License-Identifier: Apache-2.0
"""Clearance of an extremal in continuous time.

Between two samples of an extremal, lengths of v, v', v'' are enclosed: if L, A, J bound them on an
interval of length h, the first-order conditions bound their rates there, and if what follows from
the sampled values and these rates is no more than L, A, J, they hold indeed (the curve would have
to leave the box through its wall first). A distance changes at most as fast as the curve and the
obstacle move, so it is at least `(d_i + d_(i+1) - (L + rate) h) / 2`. Intervals are halved until
the box closes and the bound is close to the samples.

The extremal is that of the samples' states; the error of the integration is taken off.
"""

from __future__ import annotations

import numpy as np

from riem_planner.manifolds.matrices import Real
from riem_planner.manifolds.repulsion import Repulsion
from riem_planner.manifolds.solution import GeneralTrajectory

_FIRST_SAMPLES = 4  # per interval of the shooting
_MOST_HALVINGS = 12
_MOST_SAMPLES = 20_000
_SLACK = 2e-3  # that a bound may be below the samples


def proven_clearance(
    trajectory: GeneralTrajectory, error: float = 0.0
) -> tuple[dict[str, float], bool]:
    """Lower bound of the distance to each obstacle's ball, and whether it is proven.

    It is not where a box does not close, as with a potential whose slope has no stated bound; then
    the least sampled distance is given.

    Parameters
    ----------
    trajectory
        The extremal.
    error
        Of its integration, in lengths; taken off the bounds.
    """
    problem, T = trajectory.problem, trajectory.duration
    if not problem.obstacles:
        return {}, True
    repulsion = Repulsion(problem.space, problem.obstacles)
    share = np.arange(_FIRST_SAMPLES) / _FIRST_SAMPLES
    t = (trajectory.times[:-1, None] + np.diff(trajectory.times)[:, None] * share).ravel() * T
    t = np.append(t, T)
    sizes, d = _sampled(trajectory, repulsion, t)
    least = d.min(axis=0)
    for _ in range(_MOST_HALVINGS):
        bounds = _bounds(trajectory, repulsion, np.diff(t), sizes, d)
        coarse = np.flatnonzero(~(bounds >= least - _SLACK).all(axis=1))
        if coarse.size == 0 or t.size + coarse.size > _MOST_SAMPLES:
            break
        middle = 0.5 * (t[coarse] + t[coarse + 1])
        new_sizes, new_d = _sampled(trajectory, repulsion, middle)
        t = np.insert(t, coarse + 1, middle)
        sizes, d = np.insert(sizes, coarse + 1, new_sizes, 0), np.insert(d, coarse + 1, new_d, 0)
        least = np.minimum(least, d.min(axis=0))
    else:
        bounds = _bounds(trajectory, repulsion, np.diff(t), sizes, d)
    bound = np.minimum(bounds.min(axis=0), least)
    proven = bool(np.all(np.isfinite(bound)))
    found = (bound if proven else least) - repulsion.radii - error
    names = [str(o.name) for o in problem.obstacles]
    return dict(zip(names, map(float, found), strict=True)), proven


def _sampled(trajectory: GeneralTrajectory, repulsion: Repulsion, t: Real) -> tuple[Real, Real]:
    """Lengths (k, 3) of v, v', v'' and distances (k, m) at times (k,)."""
    g, v, a, j = trajectory.evaluate_state(t)
    sizes = np.stack([np.linalg.norm(x, axis=-1) for x in (v, a, j)], axis=-1)
    return sizes, repulsion.distances(g, t)[0]


def _bounds(
    trajectory: GeneralTrajectory, repulsion: Repulsion, h: Real, sizes: Real, d: Real
) -> Real:
    """Lower bounds (k, m) of the distances in intervals of lengths h (k,); -inf if not proven."""
    problem = trajectory.problem
    v0, a0, j0 = sizes[:-1].T
    own = np.array(
        [0.0 if o.rate is None else float(np.linalg.norm(o.rate)) for o in problem.obstacles]
    )

    def mapped(box: tuple[Real, Real, Real]) -> tuple[Real, Real, Real]:
        speed, bend, jerk = box
        nearest = d[:-1] - (speed[:, None] + own) * h[:, None]
        force = sum(
            (0.5 * x.slope_bound(nearest[:, i]) for i, x in enumerate(repulsion.shapes)),
            np.zeros_like(h),
        )
        snap = problem.space.curvature_bound(*box) + problem.tension * bend + force
        return v0 + h * bend, a0 + h * jerk, j0 + h * snap

    with np.errstate(all="ignore"):
        box = mapped((v0, a0, j0))
        for _ in range(4):
            box = mapped(box)
        wide = tuple(1.02 * x + 1e-12 for x in box)
        inside = mapped(wide)  # type: ignore[arg-type]
        holds = np.all([a <= b for a, b in zip(inside, wide, strict=True)], axis=0)
        travelled = (inside[0][:, None] + own) * h[:, None]
        bounds = 0.5 * (d[1:] + d[:-1] - travelled)
    return np.where(holds[:, None] & np.isfinite(bounds), bounds, -np.inf)
