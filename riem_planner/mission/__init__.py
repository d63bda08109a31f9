# SPDX-License-Identifier: Apache-2.0
"""What the planner decides, without ROS: plain classes over integer nanoseconds.

`settings` (the validated parameters), `zone_tracker` (what is known of the zones), `timeline`
(what is streamed when), `safety` (what may be streamed), `requests` and `planning` (one request,
carried out beside the stream), `recovery` (stops, dodges, the way out) and `mission` (what to do
about goals, changes and faults).
"""
