"""The `riem_timeline` command: months of observations as one certified reference."""
