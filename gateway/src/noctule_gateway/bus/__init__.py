"""What a unit has on the bus."""
