"""Certificates, access rules and configuration of a fleet, all from one file, ``fleet.toml``."""
