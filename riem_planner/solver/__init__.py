# SPDX-License-Identifier: Apache-2.0
"""The solver: descent on the discretised cost, then multiple shooting on its extremal."""
