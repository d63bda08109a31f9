# SPDX-License-Identifier: Apache-2.0
"""The `riem_export` command: plans and timelines as flight dynamics reads them."""
