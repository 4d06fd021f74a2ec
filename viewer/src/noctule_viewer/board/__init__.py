"""How a site fares, in words, as the viewer's own process hears it on the bus: a mapper that is dead can't fake it."""
