# SPDX-License-Identifier: Apache-2.0
"""Proofs of plans by a checker that shares nothing with the planner; it stands in `check.py`.

This room is empty on purpose: `riem_planner.proof.check` imports the standard library and
python-flint only, and works as well when its one file is copied elsewhere.
"""
