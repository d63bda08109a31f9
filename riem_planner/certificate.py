"""PROVISIONAL: replaced by CERT within minutes."""
from dataclasses import dataclass, field


@dataclass(frozen=True, eq=False)
class Certificate:
    certified: bool
    reasons: tuple = ()
    clearance: dict = field(default_factory=dict)
    worst: dict = field(default_factory=dict)
    boundary_error: tuple = (0.0, 0.0)
    rate_bound: float = 0.0
    extremality: float = 0.0
    invariant_drift: float | None = None


def certify(trajectory, problem, limits=None):
    import numpy as np

    clearance = {}
    for t in np.linspace(0, trajectory.duration, 200):
        for k, m in problem.margins(trajectory.evaluate(t)[0], t).items():
            clearance[k] = min(clearance.get(k, 9.0), m)
    bad = tuple(f"{k}: enters the zone" for k, m in clearance.items() if m <= 0)
    return Certificate(not bad, bad, clearance, {k: 0.0 for k in clearance})
