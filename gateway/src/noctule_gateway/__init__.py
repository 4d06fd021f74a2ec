"""Serial scanner units to Zenoh."""
