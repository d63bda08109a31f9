"""The node: the only room that knows ROS.

Decisions are made by plain classes over integer nanoseconds, which know no ROS either and are
tested without it: `settings`, `world` (what is known of the zones), `timeline` (what is
streamed when), `safety` (what may be streamed), `planning` (one request, carried out beside
the stream) and `mission` (what to do about goals, changes and faults). The rest turns messages
into calls and results into messages: `parameters`, `inputs`, `outputs`, `planner_node`, `main`.
"""
