"""Several mappers share sites: each site is mapped by one of them, and by another as soon as that one is gone."""
