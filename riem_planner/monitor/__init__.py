# SPDX-License-Identifier: Apache-2.0
"""A monitor of the planner's stream that imports neither the solver nor the certificate.

`sentences` judges messages as plain numbers; the room `monitor_node` hears them for it.
"""
