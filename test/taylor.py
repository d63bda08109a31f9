# SPDX-License-Identifier: Apache-2.0
"""The order of a Taylor remainder, from its decrease over shrinking steps."""

import numpy as np


def remainder_order(remainder, largest, noise, halvings=7):
    """Slope of log(remainder) over log(step).

    Parameters
    ----------
    remainder
        Function of a step that gives remainders (m,), one for each direction tried. Their root
        mean square is taken, so that one direction without the leading term does no harm.
    largest
        First step; each next one is half of it.
    noise
        What rounding may leave; steps whose remainder is within 30 of these are not counted.
    """
    steps = largest * 0.5 ** np.arange(halvings)
    sizes = np.array([np.sqrt(np.mean(np.square(remainder(h)))) for h in steps])
    clear = sizes > 30.0 * noise
    assert clear[:3].all(), f"the remainders {sizes} drown in the rounding {noise}"
    last = clear.size if clear.all() else int(np.argmin(clear))
    first = max(last - 4, 0)  # the smallest steps, where the leading term rules
    return np.polyfit(np.log(steps[first:last]), np.log(sizes[first:last]), 1)[0]
