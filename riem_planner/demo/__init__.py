# SPDX-License-Identifier: Apache-2.0
"""The demonstration: plans a published manoeuvre and flies it with a simulated spacecraft."""
