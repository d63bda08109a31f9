# SPDX-License-Identifier: Apache-2.0
"""ROS messages to NumPy and back, in pairs of functions named by both sides.

Every reader raises `MessageError` on a zero or non-finite value, on a wrong frame, or on a bad
stamp; none changes its input. Quaternions are in the order x, y, z, w; angular quantities of
`Twist` and `Accel` are in the body frame.
"""

from msg_adapters.errors import MessageError

__all__ = ["MessageError"]
