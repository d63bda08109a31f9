# SPDX-License-Identifier: Apache-2.0
"""The `riem_campaign` command: up to a hundred million problems, on this machine or a cluster."""
