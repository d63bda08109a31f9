# SPDX-License-Identifier: Apache-2.0
"""The paper's figures and table: as printed, corrected, and as boundary-value problems."""
