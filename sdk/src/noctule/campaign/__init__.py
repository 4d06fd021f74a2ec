"""New firmware for a site's units, group by group."""
