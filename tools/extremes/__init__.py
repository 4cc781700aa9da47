"""What tools/plot_extremes.py measures, and how that is drawn."""
