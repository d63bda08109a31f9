"""Pictures of plans: boresight paths among the zones, rates, clearances."""
