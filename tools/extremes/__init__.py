"""What tools/plot_extremes.py measures, and how it is drawn."""
