"""The reliability grid: contacts' regions and free space as beliefs on sparse tiles."""
