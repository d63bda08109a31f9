# SPDX-License-Identifier: Apache-2.0
"""Problem and plan files: read, checked by key, and written."""
