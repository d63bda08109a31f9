# SPDX-License-Identifier: Apache-2.0
"""The `riem_plan` command: plans, batches and checks of problem and plan files."""
