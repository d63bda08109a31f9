# SPDX-License-Identifier: Apache-2.0
"""Basilisk as an independent plant, and its constrained-manoeuvre module as a peer.

Run by `make basilisk` in an environment of its own. Only `plant` and `peer` import Basilisk.
"""
