"""Measurements of the planner beside its peers; run by `make bench` as `python -m benchmark`."""
