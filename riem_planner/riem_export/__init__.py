"""The `riem_export` command: plans and timelines as flight dynamics reads them."""
