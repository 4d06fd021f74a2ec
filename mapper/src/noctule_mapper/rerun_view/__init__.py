"""What those who watch see: the map, the sweeps and the counters, in Rerun."""
