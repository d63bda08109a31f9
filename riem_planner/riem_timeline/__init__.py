# SPDX-License-Identifier: Apache-2.0
"""The `riem_timeline` command: months of observations as one certified reference."""
