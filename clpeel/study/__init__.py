"""Studies: pictures and counts set beside each other."""
