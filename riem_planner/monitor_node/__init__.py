# SPDX-License-Identifier: Apache-2.0
"""The node `riem_monitor`: hears the planner and tells the first promise that is broken."""
