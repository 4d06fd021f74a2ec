"""The live mapper: a site's sweeps as they come, its map on the bus and in Rerun."""
