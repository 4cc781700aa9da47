"""Studies: compare pictures with each other, and count layers."""
