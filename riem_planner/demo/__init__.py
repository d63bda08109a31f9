"""The demonstration: plans a published manoeuvre and flies it with a simulated spacecraft."""
